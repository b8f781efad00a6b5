"""One style for all pictures of the studies: colours that colour-blind readers tell apart, and
legends below the panels, where they hide nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.view.panels import save_picture
from eitskin.view.pictures import STYLE, load_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# Okabe and Ito, without yellow, which is too pale for lines on white
BLUE, VERMILION, GREEN, ORANGE = "#0072b2", "#d55e00", "#009e73", "#e69f00"
PURPLE, SKY, BLACK, GREY = "#cc79a7", "#56b4e9", "#333333", "#8a8a8a"
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
SNR_COLOURS = {40.0: ORANGE, 60.0: BLUE, 80.0: GREEN}
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")


@contextmanager
def drawing(path: str | Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of so many inches, in the style of all, saved when it is drawn.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(width, height), layout="constrained")
        yield figure
        save_picture(figure, path)


def plain_axes(axes: Axes, grid: str | None = "both") -> None:
    """Take the frame's upper and right side away, and draw a light grid along ``grid``."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    if grid is not None:
        axes.grid(axis=grid, linewidth=0.4, alpha=0.5)  # type: ignore[arg-type]


def plain_ticks(axis: Axis, values: Sequence[float]) -> None:
    """Ticks at ``values`` alone, written as they are, also on a logarithmic axis."""
    axis.set_ticks(list(values), [f"{value:g}" for value in values])
    axis.set_tick_params(which="minor", bottom=False, left=False)
    axis.set_minor_formatter(load_matplotlib().ticker.NullFormatter())


def legend_below(figure: Figure, entries: Any, columns: int) -> None:
    """A legend below all panels. ``entries`` are axes, whose labels are shown once each, or pairs
    of a handle and its label."""
    if hasattr(entries, "get_legend_handles_labels"):
        handles, labels = entries.get_legend_handles_labels()
        entries = list(dict(zip(labels, handles, strict=True)).items())
        entries = [(handle, label) for label, handle in entries]
    figure.legend(
        [handle for handle, _ in entries],
        [label for _, label in entries],
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        fontsize=8,
    )
