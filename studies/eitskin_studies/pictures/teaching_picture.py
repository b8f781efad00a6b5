"""The error of a taught model over the number of presses, beside the baselines."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eitskin_studies.pictures.style import (
    COLOURS,
    MARKERS,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)


def draw_teaching(path: Path, data: Mapping[str, Any]) -> None:
    """A line a method: ``presses`` (how many) and ``median_mm`` by method.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    presses: Sequence[int] = data["presses"]
    with drawing(path, 7.0, 4.4) as figure:
        axes = figure.subplots()
        for k, (name, values) in enumerate(data["median_mm"].items()):
            wide = 2.5 if not k else 1.2
            axes.plot(presses, values, marker=MARKERS[k], color=COLOURS[k], lw=wide, ms=5,
                      label=name)  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="presses taught", ylabel="median error (mm)")
        plain_ticks(axes.xaxis, presses)
        plain_ticks(axes.yaxis, (1, 2, 5, 10, 20))
        plain_axes(axes)
        legend_below(figure, axes, 5)
