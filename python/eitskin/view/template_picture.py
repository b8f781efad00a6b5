"""Draw a template in true size to lay on the skin: its outline, its electrodes, and where to
press."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fileio import write_beside
from eitskin.skin.skin import Skin
from eitskin.view.panels import check_path
from eitskin.view.pictures import load_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MM_PER_INCH = 25.4
PAGE_MM, MARGIN_MM = (210.0, 297.0), 6.0
BAR_MM = 50.0
RIM_MM = 2.0
SUFFIXES = (".pdf", ".svg")


def check_template(path: Path) -> None:
    """Raise an error if the template cannot be drawn, before any work is done for it.

    Raises:
        UsageError: the suffix is not that of a template.
        MissingExtraError: matplotlib is not installed.
    """
    check_path(path, SUFFIXES, "template in true size")
    load_matplotlib()


def draw_template(path: Path, skin: Skin, place_mm: FloatArray) -> int:
    """Draw places (n, 2) in mm on ``skin`` in true size, and return the number of pages.

    A PDF has as many A4 pages as are needed, to be laid edge to edge; an SVG has one page of its
    own size.
    """
    check_template(path)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    low_x, low_y, high_x, high_y = skin.outline.bounding_box_mm
    low = np.array([low_x, low_y]) - RIM_MM
    size = np.array([high_x, high_y]) + RIM_MM - low
    single = path.suffix == ".svg"
    page = size + 2 * MARGIN_MM if single else _page_for(size)
    room = page - 2 * MARGIN_MM
    across, down = (max(1, int(np.ceil(n - 1e-9))) for n in size / room)
    with write_beside(path) as temporary, rc_context({"font.size": 7, "svg.hashsalt": "eitskin"}):
        figures = []
        for row in range(down):
            for column in range(across):
                figure = Figure(figsize=tuple(page / MM_PER_INCH))
                axes = figure.add_axes((*(MARGIN_MM / page), *(room / page)))
                corner = low + room * (column, down - 1 - row) - (room * (across, down) - size) / 2
                (left, bottom), (right, top) = corner, corner + room
                axes.set(xlim=(left, right), ylim=(bottom, top))
                _draw(axes, skin, place_mm, corner, f"{row * across + column + 1}/{across * down}")
                figures.append(figure)
        _save(temporary, path.suffix, figures)
    return across * down


def _page_for(size_mm: FloatArray) -> FloatArray:
    """Return the size of an A4 page, upright or across, whichever needs fewer pages."""
    pages = [np.array(PAGE_MM), np.array(PAGE_MM[::-1])]
    return min(pages, key=lambda page: float(np.prod(np.ceil(size_mm / (page - 2 * MARGIN_MM)))))


def _draw(axes: "Axes", skin: Skin, place_mm: FloatArray, corner: FloatArray, page: str) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set(linewidth=0.4, linestyle=":", color="0.6")
    rim = np.array(skin.outline.vertices_mm)
    axes.fill(*rim.T, fill=False, edgecolor="0.3", linewidth=0.8)
    centre = np.array(skin.outline.centre_mm)
    for number, at in enumerate(skin.electrode_centres_mm()):
        outwards = (at - centre) / np.linalg.norm(at - centre)
        axes.plot(*at, "s", color="0.3", markersize=4)
        x, y = at - 5 * outwards
        axes.text(x, y, f"E{number}", ha="center", va="center", clip_on=True)
    axes.plot(*place_mm.T, "+", color="C0", markersize=8, markeredgewidth=0.8)
    for number, at in enumerate(place_mm):
        axes.text(at[0] + 1.2, at[1] + 1.2, str(number + 1), color="C0", va="bottom", clip_on=True)
    bar = corner + 8
    axes.plot([bar[0], bar[0] + BAR_MM], [bar[1]] * 2, "|-", color="black", linewidth=1)
    note = f"{BAR_MM:g} mm: measure it; print at 100 %. Page {page}. Seen from above; E: electrode"
    axes.text(bar[0], bar[1] + 1.5, note)


def _save(path: Path, suffix: str, figures: list[Any]) -> None:
    if suffix == ".svg":
        figures[0].savefig(path, format="svg", metadata={"Date": None})
        return
    from matplotlib.backends.backend_pdf import PdfPages

    with PdfPages(path, metadata={"CreationDate": None, "Producer": None}) as pages:
        for figure in figures:
            pages.savefig(figure)
