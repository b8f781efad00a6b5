"""How well touches are found over the number of electrodes, and by pattern."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eitskin_studies.pictures.style import (
    BLUE,
    COLOURS,
    MARKERS,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
)

EQUALS = {"noise": "equal noise per row", "time": "equal time, 20.8 ms per frame"}
EQUAL_COLOURS = {"noise": BLUE, "time": VERMILION}
DASHES = ("o-", "s--", "^:")


@dataclass(frozen=True)
class Bar:
    """A scan: image MIoU with its interval, exact counts of six touches (a share), and of pairs by
    their distance in mm."""

    electrodes: int
    pattern: str
    equal: str
    miou: float
    low: float
    high: float
    six: float
    pairs: tuple[tuple[float, float], ...]


def draw_counts(path: str | Path, bars: Sequence[Mapping[str, Any]]) -> None:
    """Image MIoU and six touches counted over the number of electrodes, pairs over their distance;
    adjacent pattern. ``bars`` are those of ``Bar``, as dictionaries.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    shown = [Bar(**one) for one in bars]
    with drawing(path, 10.4, 3.9) as figure:
        axes = figure.subplots(1, 3)
        for equal, colour in EQUAL_COLOURS.items():
            adjacent = [bar for bar in shown if bar.equal == equal and bar.pattern == "adjacent"]
            mine = sorted(adjacent, key=lambda bar: bar.electrodes)
            places = range(len(mine))
            reach = [[bar.miou - bar.low for bar in mine], [bar.high - bar.miou for bar in mine]]
            axes[0].errorbar(
                places, [bar.miou for bar in mine], reach, marker="o", capsize=3, color=colour
            )
            axes[1].plot(places, [100 * bar.six for bar in mine], "o-", color=colour)
            for bar, dashes in zip(mine, DASHES, strict=False):
                apart, shares = zip(*bar.pairs, strict=True)
                axes[2].plot(
                    apart, [100 * share for share in shares], dashes, color=colour,
                    label=f"{bar.electrodes} electrodes, {EQUALS[equal]}",
                )  # fmt: skip
            for one in axes[:2]:
                one.set_xticks(list(places), [str(bar.electrodes) for bar in mine])
        titles = (
            "image MIoU, 1 to 3 touches",
            "six touches counted exactly (%)",
            "pairs counted exactly (%)",
        )
        below = ("electrodes, adjacent pattern",) * 2 + (
            "distance of the centres, radius 9 mm (mm)",
        )
        for one, title, label in zip(axes, titles, below, strict=True):
            one.set_title(title)
            one.set_xlabel(label)
            plain_axes(one)
        for one in axes[1:]:
            one.set_ylim(-4, 104)
        legend_below(figure, axes[2], 2)


def draw_patterns(path: str | Path, bars: Sequence[Mapping[str, Any]]) -> None:
    """Image MIoU of every pattern by number of electrodes, at equal noise and at equal time: dots,
    since the axis of MIoU does not begin at 0. ``bars`` are those of ``Bar``, as dictionaries.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    shown = [Bar(**one) for one in bars]
    patterns = list(dict.fromkeys(bar.pattern for bar in shown))
    counts = sorted({bar.electrodes for bar in shown})
    with drawing(path, 9.6, 5.6) as figure:
        axes = figure.subplots(2, 2, sharex=True, sharey="row")
        for column, (equal, title) in enumerate(EQUALS.items()):
            for k, pattern in enumerate(patterns):
                mine = [bar for bar in shown if (bar.equal, bar.pattern) == (equal, pattern)]
                shift = 0.8 * ((k + 0.5) / len(patterns) - 0.5)
                places = [counts.index(bar.electrodes) + shift for bar in mine]
                reach = [
                    [bar.miou - bar.low for bar in mine],
                    [bar.high - bar.miou for bar in mine],
                ]
                style = {"color": COLOURS[k % len(COLOURS)], "markersize": 6}
                marker = MARKERS[k % len(MARKERS)]
                axes[0][column].errorbar(
                    places, [bar.miou for bar in mine], reach, capsize=2, fmt=marker,
                    label=pattern, **style,
                )  # fmt: skip
                axes[1][column].plot(places, [100 * bar.six for bar in mine], marker, **style)
            axes[0][column].set_title(title)
            axes[1][column].set_ylim(-4, 104)
            axes[1][column].set_xticks(
                range(len(counts)), [f"{count} electrodes" for count in counts]
            )
        axes[0][0].set_ylabel("image MIoU, 1 to 3 touches\n(lines: 95 % interval)")
        axes[1][0].set_ylabel("six touches counted exactly (%)")
        for one in axes.flat:
            plain_axes(one, "y")
        legend_below(figure, axes[0][0], len(patterns))
