"""When presses are reported: how many of them by what time after the contact."""

from pathlib import Path

import numpy as np

from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.benchmarks.latency import Latency

COLOURS = ("#1f5fa8", "#2a9d8f", "#e9a03b", "#b3202c")
LINES = ("-", "--", ":", "-.")


def draw_latency(path: Path, result: Latency) -> None:
    """A line a rise; methods by the kind of line.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: it cannot be written.
    """
    matplotlib = load_matplotlib()
    rises = sorted({one.rise_ms for one in result.judged})
    methods = list(dict.fromkeys(one.method for one in result.judged))
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.5, 4.2), layout="constrained")
        axes = figure.subplots()
        for one in result.judged:
            share = 100 * np.arange(len(one.scan_ms) + 1) / one.presses
            times = np.sort([0.0, *one.scan_ms])
            label = f"rise {one.rise_ms} ms" if len(methods) == 1 else None
            axes.step(
                times,
                share,
                where="post",
                color=COLOURS[rises.index(one.rise_ms) % len(COLOURS)],
                linestyle=LINES[methods.index(one.method) % len(LINES)],
                label=label or f"{one.rise_ms} ms, {one.method}",
            )
        axes.set_xlabel("from the contact to the end of the scan or drive that reports it, ms")
        axes.set_ylabel("presses reported, %")
        axes.set_xlim(left=0)
        axes.set_ylim(0, 102)
        axes.grid(linewidth=0.4, alpha=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(frameon=False, labelcolor=INK, fontsize=8, loc="outside right upper")
        save_picture(figure, path)
