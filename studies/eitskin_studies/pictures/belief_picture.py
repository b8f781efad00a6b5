"""Belief: the calibration curve of ``confidence``, and how many places lie in their ellipses."""

from pathlib import Path

from eitskin.view.pictures import INK
from eitskin_studies.experiments.belief.tables import HIGH, LOW, Sets, coverage, curve
from eitskin_studies.pictures.style import BLUE, SKY, drawing, plain_axes
from eitskin_studies.worlds.worlds import in_words

SMALLEST = 1e-3


def draw_belief(path: Path, sets: Sets) -> None:
    """Left the share of false touches over what their confidence says, both logarithmic; right
    the coverage of each set's ellipses.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    covered = [(name, one) for name, frames in sets.items() if (one := coverage(frames)).count]
    with drawing(path, 9.6, 0.9 + 0.2 * max(len(covered), 12)) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
        left.plot([SMALLEST, 1], [SMALLEST, 1], color=INK, linewidth=0.7, linestyle=":")
        for part in curve(sets):
            said, true = 1 - part.said, part.true
            ends = [max(1 - value, SMALLEST) for value in (true.high, true.low)]
            left.plot([said, said], ends, color=BLUE, linewidth=1.2)
            left.plot(said, max(1 - true.mean, SMALLEST), "o", color=BLUE, markersize=4)
        left.set(
            xscale="log",
            yscale="log",
            xlabel="1 - confidence",
            ylabel="share of reported touches that are false",
            title="Is the confidence true?",
            xlim=(SMALLEST, 1),
            ylim=(SMALLEST, 1),
        )
        right.axvspan(100 * LOW, 100 * HIGH, color=SKY, alpha=0.25, linewidth=0)
        for place, (_, one) in enumerate(covered):
            right.plot([100 * one.low, 100 * one.high], [place, place], color=BLUE, linewidth=1.2)
            right.plot(100 * one.mean, place, "o", color=BLUE, markersize=4)
        right.set_yticks(range(len(covered)), [in_words(name) for name, _ in covered])
        right.invert_yaxis()
        right.set(
            xlabel="true places in their 90 % ellipses, %",
            xlim=(0, 100),
            title="Is the place's 90 % ellipse true? (band: 87 to 93 %)",
        )
        for axes in (left, right):
            plain_axes(axes)
