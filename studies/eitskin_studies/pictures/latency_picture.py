"""When presses are reported: how many of them by what time after the contact."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eitskin_studies.benchmarks.latency import Latency
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.style import COLOURS, drawing, legend_below, plain_axes

DASHES = ("-", "--", "-.", ":")


def latency_drawing(result: Latency) -> Drawing:
    """The picture of a result."""
    lines = [
        {
            "method": one.method,
            "rise_ms": one.rise_ms,
            "presses": one.presses,
            "scan_ms": [round(float(ms), 2) for ms in sorted(one.scan_ms)],
        }
        for one in result.judged
    ]
    return Drawing(draw_latency, lines)


def draw_latency(path: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    """A panel a method, and a line a rise: of ``presses``, when those that were reported were.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: it cannot be written.
    """
    rises = sorted({one["rise_ms"] for one in lines})
    methods = list(dict.fromkeys(one["method"] for one in lines))
    with drawing(path, 2.6 * len(methods) + 0.8, 3.6) as figure:
        panels = figure.subplots(1, len(methods), sharex=True, sharey=True, squeeze=False)[0]
        for one in lines:
            share = 100 * np.arange(len(one["scan_ms"]) + 1) / one["presses"]
            number = rises.index(one["rise_ms"])
            panels[methods.index(one["method"])].step(
                [0.0, *one["scan_ms"]],
                share,
                where="post",
                color=COLOURS[number % len(COLOURS)],
                linestyle=DASHES[number % len(DASHES)],
                label=f"the press rises in {one['rise_ms']} ms",
            )
        for axes, method in zip(panels, methods, strict=True):
            axes.set_title(method, fontsize=9)
            axes.set_xlim(left=0)
            axes.set_ylim(0, 102)
            axes.set_xlabel("ms from the contact to the end of\nthe scan or drive that reports it")
            plain_axes(axes)
        panels[0].set_ylabel("presses reported, %")
        legend_below(figure, panels[0], len(rises))
