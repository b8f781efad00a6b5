"""Belief: the calibration curve of ``confidence``, and how many places lie in their ellipses."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eitskin.view.pictures import INK
from eitskin_studies.pictures.style import BLUE, SKY, drawing, plain_axes
from eitskin_studies.worlds.worlds import in_words

SMALLEST = 3e-4


def draw_belief(path: Path, data: Mapping[str, Any]) -> None:
    """Left the share of false touches over what their confidence says, both logarithmic; right
    the coverage of each set's ellipses, beside the ``band`` asked for. ``curve`` has the mean
    confidence and the share of true touches (mean, low, high) of each part of the touches,
    ``covered`` a share (mean, low, high) for each set.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    covered, (low, high) = data["covered"], data["band"]
    with drawing(path, 9.6, 0.9 + 0.2 * max(len(covered), 12)) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
        left.plot([SMALLEST, 1], [SMALLEST, 1], color=INK, linewidth=0.7, linestyle=":")
        for confidence, true in data["curve"]:
            false, *ends = (max(1 - value, SMALLEST) for value in true)
            left.plot([1 - confidence] * 2, ends, color=BLUE, linewidth=1.2)
            left.plot(1 - confidence, false, "o", color=BLUE, markersize=4)
        left.set(
            xscale="log",
            yscale="log",
            xlabel="1 - confidence",
            ylabel="share of reported touches that are false",
            title="Is the confidence true? (dotted: exactly)",
            xlim=(SMALLEST, 1),
            ylim=(SMALLEST, 1),
        )
        right.axvspan(100 * low, 100 * high, color=SKY, alpha=0.25, linewidth=0)
        for place, (mean, least, most) in enumerate(covered.values()):
            right.plot([100 * least, 100 * most], [place, place], color=BLUE, linewidth=1.2)
            right.plot(100 * mean, place, "o", color=BLUE, markersize=4)
        right.set_yticks(range(len(covered)), [in_words(name) for name in covered])
        right.invert_yaxis()
        right.set(
            xlabel="true places in their 90 % ellipses, %",
            xlim=(0, 100),
            title=f"Is the place's 90 % ellipse true? (band: {100 * low:g} to {100 * high:g} %)",
        )
        for axes in (left, right):
            plain_axes(axes)
