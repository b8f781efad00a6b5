"""Skins of several shapes: how sensitive they are where, one reconstruction, and which touches were
found."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.fem.grid import grid_for
from eitskin.skin.skin import Skin
from eitskin.view.panels import save_picture
from eitskin.view.pictures import FOUND, INK, RIM, STYLE, Mark, Panel, draw_panel, load_matplotlib

MIN_LOG10 = -3.0
MISSED = "#c62828"


@dataclass(frozen=True, eq=False)
class ShapePanel:
    """The data that a skin's picture shows.

    Attributes:
        name: above its column.
        sensitivity_log10: (n,) of each pixel, over the greatest.
        image: (n,) of one scene, S/m.
        true, found: its touches and those found, [x, y, radius] in mm.
        places: of every test touch, [x, y] in mm; ``hit`` says which were found.
    """

    name: str
    skin: Skin
    sensitivity_log10: Sequence[float]
    image: Sequence[float]
    true: Sequence[Sequence[float]]
    found: Sequence[Sequence[float]]
    places: Sequence[Sequence[float]]
    hit: Sequence[bool]


def draw_shapes(path: str | Path, shapes: Sequence[ShapePanel]) -> None:
    """A column a skin: sensitivity with electrodes | a reconstruction with its truth | every test
    touch, found or missed; PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(
            figsize=(2.1 * len(shapes) + 1.3, 7.0), layout="constrained"
        )
        cells = figure.add_gridspec(3, len(shapes) + 1, width_ratios=[1.0] * len(shapes) + [0.06])
        rows = [[figure.add_subplot(cells[row, k]) for k in range(len(shapes))] for row in range(3)]
        seen = coloured = None
        for k, shape in enumerate(shapes):
            grid = grid_for(shape.skin.outline)
            draw_panel(rows[0][k], shape.skin, grid, Panel(shape.name), small=True)
            x0, y0 = grid.origin_mm
            extent = (x0, x0 + grid.nx * grid.pixel_mm, y0, y0 + grid.ny * grid.pixel_mm)
            colours = {
                "cmap": "viridis",
                "vmin": MIN_LOG10,
                "vmax": 0.0,
                "interpolation": "nearest",
            }
            seen = rows[0][k].imshow(
                grid.image(shape.sensitivity_log10),
                origin="lower",
                extent=extent,
                zorder=1,
                **colours,
            )
            rim = shape.skin.outline.points_at(
                np.linspace(0, shape.skin.outline.perimeter_mm, 721)[:-1]
            )
            sheet = Polygon(
                rim, closed=True, facecolor="none", edgecolor=RIM, linewidth=0.7, zorder=2
            )
            rows[0][k].add_patch(sheet)
            seen.set_clip_path(sheet)
            true, found = (
                tuple(Mark(*one) for one in discs) for discs in (shape.true, shape.found)
            )
            panel = Panel("", np.asarray(shape.image), true, found)
            coloured = draw_panel(rows[1][k], shape.skin, grid, panel, small=True)
            draw_panel(rows[2][k], shape.skin, grid, Panel(""), small=True)
            places, hit = (
                np.asarray(shape.places).reshape(-1, 2),
                np.asarray(shape.hit, dtype=np.bool_),
            )
            rows[2][k].plot(*places[hit].T, ".", color=FOUND, markersize=2.2, zorder=3)
            rows[2][k].plot(
                *places[~hit].T, "x", color=MISSED, markersize=4.5, markeredgewidth=1.1, zorder=4
            )
        labels = (
            "log10 of the sensitivity\nover the greatest",
            "change / its largest\nin one scene",
        )
        for number, (handle, label) in enumerate(zip((seen, coloured), labels, strict=True)):
            figure.colorbar(handle, cax=figure.add_subplot(cells[number, -1])).set_label(label)
        handles = [
            Line2D(
                [],
                [],
                marker=".",
                color="none",
                markeredgecolor=FOUND,
                markerfacecolor=FOUND,
                label="found",
            ),
            Line2D([], [], marker="x", color="none", markeredgecolor=MISSED, label="missed"),
        ]
        figure.legend(handles=handles, loc="lower right", frameon=False, labelcolor=INK)
        save_picture(figure, path)
