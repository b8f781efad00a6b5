"""How well touches are found over the number of electrodes, and by pattern."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eitskin.view.panels import save_picture
from eitskin.view.pictures import STYLE, load_matplotlib

EQUALS = {"noise": "equal noise a row", "time": "equal time, 20.8 ms a frame"}
COLOURS = {"noise": "#1565c0", "time": "#ef6c00"}
DASHES = ("o-", "s--", "^:")
SHADES = ("#0d47a1", "#1e88e5", "#64b5f6", "#8d6e63", "#bdbdbd")


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


def draw_counts(path: str | Path, bars: Sequence[Bar]) -> None:
    """Image MIoU and six touches counted over the number of electrodes, pairs over their distance;
    adjacent pattern; a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.6, 3.2), layout="constrained")
        axes = figure.subplots(1, 3)
        for equal, colour in COLOURS.items():
            adjacent = [bar for bar in bars if bar.equal == equal and bar.pattern == "adjacent"]
            mine = sorted(adjacent, key=lambda bar: bar.electrodes)
            places = range(len(mine))
            reach = [[bar.miou - bar.low for bar in mine], [bar.high - bar.miou for bar in mine]]
            axes[0].errorbar(
                places,
                [bar.miou for bar in mine],
                reach,
                marker="o",
                capsize=3,
                color=colour,
                label=EQUALS[equal],
            )
            axes[1].plot(places, [100 * bar.six for bar in mine], "o-", color=colour)
            for bar, dashes in zip(mine, DASHES, strict=False):
                label = f"{bar.electrodes} electrodes" if equal == "noise" else None
                apart, shares = zip(*bar.pairs, strict=True)
                axes[2].plot(
                    apart, [100 * share for share in shares], dashes, color=colour, label=label
                )
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
            one.spines[["top", "right"]].set_visible(False)
        axes[0].legend(frameon=False, loc="best")
        axes[2].legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7.5)
        for one in axes[1:]:
            one.set_ylim(-4, 104)
        save_picture(figure, path)


def draw_patterns(path: str | Path, bars: Sequence[Bar]) -> None:
    """Image MIoU of every pattern by number of electrodes, at equal noise and at equal time, as a
    PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    matplotlib = load_matplotlib()
    patterns, counts = (
        list(dict.fromkeys(bar.pattern for bar in bars)),
        sorted({bar.electrodes for bar in bars}),
    )
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.6, 5.6), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        width = 0.8 / len(patterns)
        for column, (equal, title) in enumerate(EQUALS.items()):
            for k, pattern in enumerate(patterns):
                mine = {
                    bar.electrodes: bar
                    for bar in bars
                    if bar.equal == equal and bar.pattern == pattern
                }
                places = [
                    place + (k - (len(patterns) - 1) / 2) * width for place in range(len(counts))
                ]
                shown = [mine[count] for count in counts]
                reach = [
                    [bar.miou - bar.low for bar in shown],
                    [bar.high - bar.miou for bar in shown],
                ]
                style = {"width": 0.92 * width, "color": SHADES[k % len(SHADES)], "label": pattern}
                axes[0][column].bar(
                    places,
                    [bar.miou for bar in shown],
                    yerr=reach,
                    capsize=2,
                    ecolor="#444444",
                    **style,
                )
                axes[1][column].bar(places, [100 * bar.six for bar in shown], **style)
            axes[0][column].set_title(title)
            axes[0][column].set_ylim(
                min(bar.low for bar in bars) - 0.03, max(bar.high for bar in bars) + 0.01
            )
            axes[1][column].set_ylim(0, 104)
            axes[1][column].set_xticks(
                range(len(counts)), [f"{count} electrodes" for count in counts]
            )
        axes[0][0].set_ylabel("image MIoU, 1 to 3 touches")
        axes[1][0].set_ylabel("six touches counted exactly (%)")
        for one in axes.flat:
            one.spines[["top", "right"]].set_visible(False)
        handles, labels = axes[0][0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=len(patterns), frameon=False
        )
        save_picture(figure, path)
