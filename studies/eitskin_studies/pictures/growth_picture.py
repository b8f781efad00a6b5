"""How a frame's cost grows, as a picture: a column for each thing that is varied."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eitskin_studies.pictures.style import (
    BLUE,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)

PARTS = (("solve", "solve", BLUE, "o"), ("touches", "touches", VERMILION, "s"))
TICKS_US, TICKS_KMAC = (10, 20, 50, 100, 200, 500, 1000), (10, 30, 100, 300, 1000, 3000)


def draw_growth(path: Path, data: Mapping[str, Any]) -> None:
    """Time (above) and multiply-accumulates (below) of solve and touches over what is varied.
    ``data`` has the ``sweeps``: name, label, values, exponents of ``time`` and ``macs``, and for
    solve and touches the times in us and the thousand MACs.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    sweeps = data["sweeps"]
    with drawing(path, 2.3 * len(sweeps) + 0.5, 5.4) as figure:
        panels = figure.subplots(2, len(sweeps), sharex="col", sharey="row", squeeze=False)
        for column, one in enumerate(sweeps):
            for row, (kind, exponent) in enumerate((("us", "time"), ("kmac", "macs"))):
                axes = panels[row, column]
                for part, label, colour, marker in PARTS:
                    axes.loglog(one["values"], one[f"{part}_{kind}"], color=colour, marker=marker,
                                ms=4.5, label=label)  # fmt: skip
                what = "time" if kind == "us" else "MACs"
                axes.set_title(f"{what} ~ $x^{{{one[exponent]:.2f}}}$", fontsize=9)
                plain_ticks(axes.xaxis, one["values"])
                plain_axes(axes)
            panels[1, column].set_xlabel(one["name"].replace(", ", "\n"))
        for row, ticks, label in (
            (panels[0], TICKS_US, "µs per frame on a host"),
            (panels[1], TICKS_KMAC, "thousand MACs per frame"),
        ):
            low, high = row[0].get_ylim()
            for axes in row:
                plain_ticks(axes.yaxis, [tick for tick in ticks if low <= tick <= high])
            row[0].set_ylabel(label)
        legend_below(figure, panels[0, 0], 2)
        figure.suptitle("How the cost of a frame grows with x, which the axis below names")
