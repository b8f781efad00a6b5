"""Lay out figures of panels in inches so that every title, label and legend fits, whatever the
outline: panels have its shape, and texts are wrapped to the width of the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray
from eitskin.errors import UsageError
from eitskin.fem.grid import Grid
from eitskin.fileio import write_beside
from eitskin.skin.skin import Skin
from eitskin.view.panel_texts import Key, plain, wrapped
from eitskin.view.pictures import (
    INK,
    MARGIN,
    SMALL_MARGIN,
    STYLE,
    Mark,
    Panel,
    draw_panel,
    largest,
    load_matplotlib,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
FORMATS = (".png", ".svg", ".pdf")
ASPECT = 1.5  # aimed at if the number of columns is free
EMPTY_COST = 1.5  # weight of empty places, relative to a deviation from ASPECT
MIN_WIDTH = 4.2  # inches, as all below
EDGE, GAP = 0.12, 0.14
BAR, TICKS, LINE = 0.12, 0.24, 0.165
AXIS_LEFT, AXIS_BELOW = 0.62, 0.5
SMALL_SIDE, BIG_SIDE = 1.65, 3.5  # side of a square panel
MAX_SMALL, MAX_BIG = 3.4, 6.4  # longer side of a long panel
MAX_HEADING = 4  # lines
UNIT_TEXT = "change of conductivity / its largest size in the panel"


@dataclass(frozen=True)
class Cell:
    """The size of a panel and the space to its left and below it, in inches."""

    width: float
    height: float
    left: float
    below: float

    @property
    def whole(self) -> float:
        """The width of the panel with the space beside it."""
        return self.left + self.width + GAP


@dataclass
class FigurePage:
    """A figure that is being laid out from top to bottom; ``height`` is how far it reaches so
    far."""

    width: float
    height: float = EDGE
    texts: list[tuple[float, str, float, str]] = field(default_factory=list)

    def text(self, lines: Sequence[str], size: float, weight: str = "normal") -> None:
        """Add centred lines."""
        for line in lines:
            self.texts.append((self.height + LINE / 2, line, size, weight))
            self.height += LINE * size / 8.5


def check_path(
    path: str | Path | None, formats: Sequence[str] = FORMATS, what: str = "picture"
) -> None:
    """Raise a UsageError if the name's suffix is not one of ``formats``, before any work is done.
    ``what`` names the kind of picture in the error."""
    if path is not None and Path(path).suffix.lower() not in formats:
        suffix = Path(path).suffix
        problem = (
            f"{suffix!r} is not a format of a {what}" if suffix else f"a {what} needs a suffix"
        )
        raise UsageError(f"{path}: {problem}; use {', '.join(formats)}")


def check_picture(path: str | Path | None) -> None:
    """Raise an error if the picture cannot be drawn, before any work is done for it.

    Raises:
        UsageError: the suffix is not that of a picture.
        MissingExtraError: matplotlib is not installed.
    """
    if path is not None:
        check_path(path)
        load_matplotlib()


def save_picture(figure: Figure, path: str | Path) -> None:
    """Write the figure as PNG, SVG or PDF, as the suffix says, completely or not at all. Dates and
    versions, by which two runs would differ, are left out."""
    check_path(path)
    kind = Path(path).suffix[1:].lower()
    omitted = {"png": ("Software",), "svg": ("Date",), "pdf": ("CreationDate", "Producer")}[kind]
    matplotlib = load_matplotlib()
    with matplotlib.rc_context({"svg.hashsalt": "eitskin"}), write_beside(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=DPI, metadata=dict.fromkeys(omitted))


def draw_panels(
    path: str | Path,
    skin: Skin,
    grid: Grid,
    panels: Sequence[Panel],
    columns: int | None = None,
    *,
    title: str = "",
    note: str = "",
    legend: bool = False,
) -> None:
    """Write ``panels_figure`` as a picture."""
    figure = panels_figure(skin, grid, panels, columns, title=title, note=note, legend=legend)
    save_picture(figure, path)


def draw_frame(
    path: str | Path,
    skin: Skin,
    grid: Grid,
    values: npt.ArrayLike,
    *,
    truth: Sequence[Mark] = (),
    found: Sequence[Mark] = (),
    title: str = "",
    unit: str = "S/m",
) -> None:
    """Write ``frame_figure`` as a picture."""
    image = np.asarray(values, dtype=np.float64)
    figure = frame_figure(skin, grid, image, truth=truth, found=found, title=title, unit=unit)
    save_picture(figure, path)


def panels_figure(
    skin: Skin,
    grid: Grid,
    panels: Sequence[Panel],
    columns: int | None = None,
    *,
    title: str = "",
    note: str = "",
    legend: bool = False,
    limit: float | None = None,
    large: bool | None = None,
) -> Figure:
    """Return a figure of panels, row by row.

    Each panel is coloured by its own largest change, or all from -``limit`` to ``limit`` S/m. One
    or two panels, or all if ``large`` is set, are large and have axes in mm. ``columns`` is None
    for the number that fits best. ``legend`` adds a key of the marks, and ``note`` is written
    below.
    """
    small = len(panels) > 2 if large is None else not large
    cell = _cell(skin, small)
    size = 8.0 if small else 10.0
    columns = columns or _columns(len(panels), cell, size)
    rows = math.ceil(len(panels) / columns)
    width = max(columns * cell.whole + 2 * EDGE, MIN_WIDTH)
    page = FigurePage(width)
    if title:
        page.text(wrapped(title, width - 2 * EDGE, 11, "bold"), 11, "bold")
    headings = [_heading(panel.title, cell, size) for panel in panels]
    left = (width - columns * cell.whole) / 2
    places = []
    for row in range(rows):
        here = range(row * columns, min((row + 1) * columns, len(panels)))
        lines = max(len(headings[k].split("\n")) for k in here)
        page.height += GAP + lines * LINE * size / 8.5
        for k in here:
            x = left + (k - row * columns) * cell.whole + cell.left
            places.append((x, page.height, cell.width, cell.height))
        page.height += cell.height + cell.below
    bar_top = page.height = page.height + GAP
    coloured = any(panel.values is not None or panel.fill_truth for panel in panels)
    if coloured:
        page.height += BAR + TICKS
        unit = UNIT_TEXT if limit is None else "change of conductivity (S/m)"
        page.text(wrapped(unit, width - 2 * EDGE, 8.5), 8.5)
    key = Key(panels, width) if legend else None
    key_top = page.height
    if key is not None:
        page.height += key.height
    if note:
        page.height += 0.04
        page.text(wrapped(note, width - 2 * EDGE, 8), 8)
    figure = _figure(page)
    for k, (panel, place) in enumerate(zip(panels, places, strict=True)):
        axes = _axes(figure, page, place)
        shown = replace(panel, title=plain(headings[k]))
        colours = draw_panel(axes, skin, grid, shown, limit=limit, small=small)
        _axis_labels(axes, small, k % columns == 0)
    if coloured:
        bar_width = min(0.7 * width, 3.2)
        place = ((width - bar_width) / 2, bar_top, bar_width, BAR)
        _bar(figure, colours, _axes(figure, page, place))
    if key is not None:
        key.draw(figure, key_top / page.height)
    return figure


def frame_figure(
    skin: Skin,
    grid: Grid,
    image: AnyArray,
    *,
    truth: Sequence[Mark] = (),
    found: Sequence[Mark] = (),
    title: str = "",
    unit: str = "S/m",
) -> Figure:
    """Return a large figure of one frame: the truth if it is given, the image, and the touches.

    The panels are side by side, or one below the other for a long skin. They have axes in mm, and
    coloured ones a colour bar in ``unit``.
    """
    panels = [Panel("image", image), Panel("touches", None, tuple(truth), tuple(found))]
    if truth:
        panels.insert(0, Panel("truth", None, tuple(truth), fill_truth=True))
    cell = _cell(skin, small=False)
    columns = 1 if cell.width > 2 * cell.height else len(panels)
    width = max(columns * cell.whole + 2 * EDGE, MIN_WIDTH)
    page = FigurePage(width)
    if title:
        page.text(wrapped(title, width - 2 * EDGE, 11, "bold"), 11, "bold")
    label = "\n".join(wrapped(f"change of conductivity ({unit})", cell.whole - GAP, 9))
    lines = label.count("\n") + 1
    left, places = (width - columns * cell.whole) / 2, []
    for _ in range(math.ceil(len(panels) / columns)):
        page.height += GAP + LINE * 10 / 8.5
        for k in range(columns):
            x = left + k * cell.whole + cell.left
            places.append((x, page.height, cell.width, cell.height))
        page.height += cell.height + cell.below + GAP + BAR + TICKS + lines * LINE * 9 / 8.5
    figure = _figure(page)
    for k, (panel, place) in enumerate(zip(panels, places, strict=True)):
        axes = _axes(figure, page, place)
        shows = panel.values is not None or panel.fill_truth
        changes = [mark.change or 0.0 for mark in panel.truth]
        limit = largest(image if panel.values is not None else changes)
        coloured = draw_panel(axes, skin, grid, panel, limit=limit)
        _axis_labels(axes, False, columns == 1 or k == 0)
        x, top, wide, high = place
        bar_top = top + high + cell.below + GAP
        if shows:
            bar_width = min(0.9 * wide, 3.2)
            bar = _axes(figure, page, (x + (wide - bar_width) / 2, bar_top, bar_width, BAR))
            _bar(figure, coloured, bar, label)
        else:
            key = Key([panel], cell.whole)
            middle = (x + wide / 2) / width
            key.draw(figure, bar_top / page.height, middle)
    return figure


def _cell(skin: Skin, small: bool) -> Cell:
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    margin = 2 * (SMALL_MARGIN if small else MARGIN) * max(x1 - x0, y1 - y0)
    wide, high = x1 - x0 + margin, y1 - y0 + margin
    side, most = (SMALL_SIDE, MAX_SMALL) if small else (BIG_SIDE, MAX_BIG)
    scale = min(side / math.sqrt(wide * high), most / max(wide, high))
    if small:
        return Cell(scale * wide, scale * high, 0.0, 0.0)
    return Cell(scale * wide, scale * high, AXIS_LEFT, AXIS_BELOW)


def _columns(count: int, cell: Cell, size: float) -> int:
    """Return the number of columns that brings a picture near ASPECT with few empty places."""
    high = cell.height + cell.below + GAP + LINE * size / 8.5

    def off(columns: int) -> float:
        rows = math.ceil(count / columns)
        aspect = columns * cell.whole / (rows * high)
        return abs(math.log(aspect / ASPECT)) + EMPTY_COST * (rows * columns - count) / count

    return min(range(1, count + 1), key=off)


def _heading(title: str, cell: Cell, size: float) -> str:
    lines = wrapped(title, max(cell.whole - 0.06, 0.9), size)
    if len(lines) > MAX_HEADING:
        lines = [*lines[: MAX_HEADING - 1], "..."]
    return "\n".join(lines)


def _figure(page: FigurePage) -> Figure:
    matplotlib = load_matplotlib()
    page.height += EDGE
    with matplotlib.rc_context(STYLE):
        figure: Figure = matplotlib.figure.Figure(figsize=(page.width, page.height))
        matplotlib.backends.backend_agg.FigureCanvasAgg(figure)
        for top, text, size, weight in page.texts:
            figure.text(
                0.5, 1 - top / page.height, plain(text), ha="center", va="center",
                fontsize=size, fontweight=weight, color=INK,
            )  # fmt: skip
    return figure


def _axes(figure: Figure, page: FigurePage, place: tuple[float, float, float, float]) -> Axes:
    """Return axes at ``place``: left, top, width and height in inches from the page's upper
    left."""
    left, top, width, height = place
    bottom = page.height - top - height
    matplotlib = load_matplotlib()
    whole = (page.width, page.height)
    share = [size / whole[k % 2] for k, size in enumerate((left, bottom, width, height))]
    with matplotlib.rc_context(STYLE):
        return figure.add_axes((share[0], share[1], share[2], share[3]))


def _axis_labels(axes: Axes, small: bool, first: bool) -> None:
    from matplotlib.ticker import MaxNLocator

    if small:
        return
    figure: Any = axes.get_figure()
    width, height = figure.get_size_inches() * axes.get_position().size
    axes.xaxis.set_major_locator(MaxNLocator(max(min(int(width / 0.6), 7), 2)))
    axes.yaxis.set_major_locator(MaxNLocator(max(min(int(height / 0.35), 7), 1)))
    if first:
        axes.set_ylabel("y (mm)")


def _bar(figure: Figure, coloured: Any, axes: Axes, label: str = "") -> None:
    from matplotlib.ticker import MaxNLocator

    bar = figure.colorbar(coloured, cax=axes, orientation="horizontal")
    bar.locator = MaxNLocator(4)
    bar.update_ticks()
    axes.tick_params(labelsize=8.5)
    if label:
        bar.set_label(label, fontsize=9)
