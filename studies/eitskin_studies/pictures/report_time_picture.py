"""Accuracy against the user's time: image MIoU over contact to report, on the board and on a host,
with what others would take."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.errors import UsageError
from eitskin.tuning.front import (
    DEFAULT_PERIOD_US,
    PRESETS,
    REPORT_US,
    Conditions,
    Front,
    OperatingPoint,
    choose,
    named_preset,
)
from eitskin.tuning.report_time import report_us
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.tradeoff.fronts import pareto
from eitskin_studies.tradeoff.table import MIN_GAIN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BOARDS = {
    "f767": ("on the board, touches sent", "#1f5fa8"),
    "host": ("rows sent, eitskin on the host", "#b35c00"),
}
GREY = "#7a7a7a"
TICKS_MS = (15, 20, 30, 40, 50, 70, 100)


def draw_report_time(path: Path, front: Front) -> None:
    """The front of each board, its presets named, and the peers of ``front.settings``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: it cannot be written.
    """
    matplotlib = load_matplotlib()
    cold = [one for one in front.points if not one.configuration.warm_start]
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.0, 5.4), layout="constrained")
        axes = figure.subplots()
        for board in BOARDS:
            _draw_board(axes, cold, board)
        _draw_peers(axes, front.settings.get("peers", ()))
        axes.set_xscale("log")
        axes.set_xticks(TICKS_MS, [str(ms) for ms in TICKS_MS])
        axes.minorticks_off()
        axes.margins(y=0.1)
        axes.set_xlabel("from contact to report, ms: half a period, scan, solve, link")
        axes.set_ylabel("mean MIoU of the image, 95 % interval")
        axes.grid(linewidth=0.4, alpha=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, loc="lower left")
        scenes, seed = front.settings.get("scenes"), front.settings.get("seed")
        axes.set_title(f"{scenes} scenes of 1 to 3 random touches, 60 dB, seed {seed}")
        save_picture(figure, path)


def chosen_presets(points: Sequence[OperatingPoint], board: str) -> dict[str, OperatingPoint]:
    """The point of each preset on ``board``, where there is one."""
    found = {}
    for name in PRESETS:
        try:
            found[name] = choose(points, named_preset(name, board))
        except UsageError:
            continue
    return found


def _draw_board(axes: Axes, points: Sequence[OperatingPoint], board: str) -> None:
    label, colour = BOARDS[board]
    usable = [one for one in points if board == "host" or one.fits_f767]
    line = pareto(
        usable,
        lambda one: one.cost(REPORT_US, board, Conditions()),
        lambda one: one.accuracy(Conditions()),
        MIN_GAIN,
    )
    if not line:
        return
    _bars(axes, [_mark(one, board) for one in line], colour, "o", label, line=True)
    names: dict[str, list[str]] = {}
    at = {}
    for name, one in chosen_presets(usable, board).items():
        names.setdefault(one.name, []).append(name)
        at[one.name] = _mark(one, board)[:2]
    for point, place in at.items():
        axes.plot(*place, "o", ms=11, mfc="none", mec=colour, mew=1.6)
        axes.annotate(
            ", ".join(names[point]),
            place,
            xytext=(0, 20 if board == "host" else -26),
            textcoords="offset points",
            color=colour,
            ha="center",
            fontweight="bold",
        )


def _draw_peers(axes: Axes, peers: Sequence[dict[str, Any]]) -> None:
    timed = [one for one in peers if "host_us" in one]
    marks = [
        (
            report_us(DEFAULT_PERIOD_US, one["host_us"], "host") / 1e3,
            one["mean"],
            one["low"],
            one["high"],
        )
        for one in timed
    ]
    if not marks:
        return
    _bars(axes, marks, GREY, "s", "rows sent, other methods on the host")
    low = -1.0
    for (x, y, *_), one in sorted(zip(marks, timed, strict=True), key=lambda pair: pair[0][1]):
        low = max(y, low + 0.011)
        axes.annotate(
            one["name"],
            (x, y),
            xytext=(max(1.25 * x, 62), low),
            color=INK,
            fontsize=7.5,
            va="center",
            arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.4, "shrinkB": 3},
        )


def _mark(point: OperatingPoint, board: str) -> tuple[float, float, float, float]:
    score = point.score(Conditions())
    assert score is not None
    image = score["image"]
    us = point.cost(REPORT_US, board, Conditions()) or 0.0
    return us / 1e3, image["mean"], image["low"], image["high"]


def _bars(
    axes: Axes,
    marks: Sequence[tuple[float, float, float, float]],
    colour: str,
    marker: str,
    label: str,
    line: bool = False,
) -> None:
    x, y, low, high = zip(*marks, strict=True)
    below = [a - b for a, b in zip(y, low, strict=True)]
    above = [b - a for a, b in zip(y, high, strict=True)]
    axes.errorbar(
        x,
        y,
        yerr=[below, above],
        fmt=marker,
        ms=4.5,
        color=colour,
        elinewidth=0.8,
        capsize=2,
        label=label,
    )
    if line:
        axes.step(x, y, where="post", color=colour, linewidth=0.9)
