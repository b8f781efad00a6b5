"""Suboptimality of the objective against MIoU of the image, a line a solver."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eitskin_studies.benchmarks.suboptimality import MIN
from eitskin_studies.pictures.style import (
    BLACK,
    BLUE,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

LINES = {
    "fista": ("FISTA (numbers: iterations)", BLACK, "^--"),
    "working-set": ("FISTA on a working set (numbers: iterations)", BLUE, "o-"),
    "active-set": ("active set (numbers: kMAC at most)", VERMILION, "s-"),
}
ABOVE, BELOW, LEFT = (0, 6), (6, -13), (-6, -2)  # of the numbers, in points
RISING = 60  # iterations; before it the line is steep, and its numbers stand on its left


def draw_suboptimality(path: Path, curves: Mapping[str, Any]) -> None:
    """Write the picture of ``GapCurves``, as a dictionary.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    with drawing(path, 8.0, 5.0) as figure:
        axes = figure.subplots()
        for solver, (name, colour, style) in LINES.items():
            stops = [one for one in curves["stops"] if one["solver"] == solver]
            places = [(max(one["suboptimality"], MIN), one["miou"]) for one in stops]
            axes.plot(*zip(*places, strict=True), style, color=colour, label=name, ms=4, lw=1.2)
            if solver == "fista":
                continue
            for one, place in zip(stops, places, strict=True):
                effort = one["effort"] or 0
                shown = effort // 1000 if solver == "active-set" else effort
                where, aligned = BELOW if solver == "active-set" else ABOVE, "center"
                if solver == "working-set" and effort < RISING:
                    where, aligned = LEFT, "right"
                axes.annotate(
                    str(shown) if effort else "optimum", place, color=colour, fontsize=7,
                    xytext=where, textcoords="offset points", ha=aligned,
                )  # fmt: skip
        axes.set_xscale("log")
        axes.invert_xaxis()
        axes.set_xlabel(
            "(F - F*) / F*, F the objective, mean over scenes; right: nearer its optimum"
        )
        axes.set_ylabel("MIoU of the image, mean")
        axes.set_title("The optimum of the objective is not the best picture: 60 dB, rank 64")
        plain_axes(axes)
        legend_below(figure, axes, 3)
