"""When presses are reported: how many of them by what time after the contact."""

from pathlib import Path

import numpy as np

from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.benchmarks.latency import Latency

COLOURS = ("#1f5fa8", "#2a9d8f", "#e9a03b", "#b3202c")


def draw_latency(path: Path, result: Latency) -> None:
    """A panel a method, and a line a rise.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: it cannot be written.
    """
    matplotlib = load_matplotlib()
    rises = sorted({one.rise_ms for one in result.judged})
    methods = list(dict.fromkeys(one.method for one in result.judged))
    with matplotlib.rc_context(STYLE):
        size = (2.6 * len(methods) + 0.8, 3.2)
        figure = matplotlib.figure.Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, len(methods), sharex=True, sharey=True, squeeze=False)[0]
        for one in result.judged:
            share = 100 * np.arange(len(one.scan_ms) + 1) / one.presses
            panels[methods.index(one.method)].step(
                np.sort([0.0, *one.scan_ms]),
                share,
                where="post",
                color=COLOURS[rises.index(one.rise_ms) % len(COLOURS)],
                label=f"{one.rise_ms} ms",
            )
        for axes, method in zip(panels, methods, strict=True):
            axes.set_title(method, fontsize=9)
            axes.set_xlim(left=0)
            axes.set_ylim(0, 102)
            axes.grid(linewidth=0.4, alpha=0.5)
            axes.spines[["top", "right"]].set_visible(False)
        panels[0].set_ylabel("presses reported, %")
        panels[0].legend(title="rise", frameon=False, labelcolor=INK, fontsize=8, loc="lower right")
        figure.supxlabel(
            "from the contact to the end of the scan or drive that reports it, ms", fontsize=9
        )
        save_picture(figure, path)
