"""Accuracy over the time from contact to report: all methods on equal scans at each SNR, and the
board with its range of times."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.errors import UsageError
from eitskin.tuning.front import F767_MHZ, REPORT_US, Conditions, Front, OperatingPoint
from eitskin.tuning.report_time import report_us
from eitskin.view.pictures import INK, load_matplotlib
from eitskin_emulator.core_on_qemu import checkout_root
from eitskin_studies.benchmarks.time_range import stored_ratios
from eitskin_studies.harness.numbers import file_of
from eitskin_studies.pictures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)
from eitskin_studies.tradeoff.equal import Reached, reached
from eitskin_studies.tradeoff.fronts import chosen_presets, pareto
from eitskin_studies.tradeoff.peers import SCANS
from eitskin_studies.tradeoff.table import MIN_GAIN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OURS = (BLUE, SKY, GREEN, BLACK)
MARKERS = dict(zip(SCANS, "osD^", strict=True))
OTHER = GREY
NAMED = {
    "plain FISTA 3000, non-negative": VERMILION,
    "plain FISTA 300, non-negative": ORANGE,
    "total variation, non-negative": PURPLE,
}
TICKS_MS = (15, 20, 30, 50, 100, 200, 400)
BOARD_COST = Path("studies/results/board-cost.md")  # whose stored numbers have the bounds of time


def draw_equal(path: Path, front: Front) -> None:
    """All methods at 60 dB, a line each over the four scans."""
    _draw_panels(path, front, (60.0,))


def draw_equal_by_noise(path: Path, front: Front) -> None:
    """All methods at each SNR."""
    _draw_panels(path, front, tuple(front.settings["snrs_db"]))


def _draw_panels(path: Path, front: Front, snrs_db: Sequence[float]) -> None:
    every = reached(front)
    named = len(snrs_db) == 1
    with drawing(path, 9.0 if named else 13.0, 5.6) as figure:
        panels = figure.subplots(1, len(snrs_db), sharey=True, squeeze=False)[0]
        for axes, snr_db in zip(panels, snrs_db, strict=True):
            _draw_methods(axes, [one for one in every if one.snr_db == snr_db], named)
            axes.set_title(f"SNR {snr_db:g} dB")
            axes.set_xlabel("ms from contact to report (half a period, scan, solve, link)")
        panels[0].set_ylabel("mean MIoU of the image")
        legend_below(figure, _entries(every, named), 4 if named else 6)
        how = front.settings
        figure.suptitle(
            f"All methods on equal scans: {how.get('scenes')} scenes of 1 to 3 touches, seed"
            f" {how.get('seed')}, solver on a host"
        )


def _style(name: str, ours: Sequence[str]) -> tuple[str, float]:
    """Colour and line width of a method."""
    if name in ours:
        return OURS[ours.index(name) % len(OURS)], 1.8
    return NAMED.get(name, OTHER), 1.0


def _draw_methods(axes: Axes, every: Sequence[Reached], named: bool) -> None:
    ours = list(dict.fromkeys(one.name for one in every if one.ours))
    ends = []
    for name in dict.fromkeys(one.name for one in every):
        line = sorted((one for one in every if one.name == name), key=lambda one: one.report_ms)
        colour, width = _style(name, ours)
        xs, ys = [one.report_ms for one in line], [one.mean for one in line]
        axes.plot(xs, ys, color=colour, linewidth=width, alpha=0.85)
        for one in line:
            axes.plot(one.report_ms, one.mean, MARKERS[one.scan], ms=4.5, color=colour)
        ends.append((ys[-1], xs[-1], name, colour))
    axes.set_xscale("log")
    plain_ticks(axes.xaxis, TICKS_MS)
    plain_axes(axes)
    if named:
        low, high = axes.get_ylim()
        axes.set_xlim(14, 1500)
        _name_ends(axes, ends, 0.034 * (high - low))


def _name_ends(axes: Axes, ends: Sequence[tuple[float, float, str, str]], least: float) -> None:
    """Names to the right of the lines, spread where they would collide."""
    previous = float("-inf")
    for y, x, name, colour in sorted(ends):
        at = max(y, previous + least)
        previous = at
        axes.annotate(
            name,
            (x, y),
            xytext=(max(1.2 * x, 62.0) if x < 200 else 1.15 * x, at),
            fontsize=7,
            color=colour if colour != OTHER else INK,
            va="center",
            arrowprops={"arrowstyle": "-", "color": OTHER, "linewidth": 0.4, "shrinkB": 3},
        )


def _entries(every: Sequence[Reached], named: bool) -> list[tuple[Any, str]]:
    """Return the legend's markers, after the colours if lines have no names."""
    line = load_matplotlib().lines.Line2D
    ours = list(dict.fromkeys(one.name for one in every if one.ours))
    coloured = {} if named else {name: _style(name, ours)[0] for name in (*ours, *NAMED)}
    if not named:
        coloured["other methods"] = OTHER
    entries = [(line([], [], color=colour), name) for name, colour in coloured.items()]
    for scan in SCANS:
        marker = line([], [], color=INK, marker=MARKERS[scan], linestyle="none", ms=4.5)
        entries.append((marker, scan.name))
    return entries


def draw_board(path: Path, front: Front) -> None:
    """The board: image MIoU over the time to the report, presets named; in a checkout, whose
    numbers have the bounds of time, with the range of the times."""
    usable = [one for one in front.points if one.fits_f767 and not one.configuration.warm_start]
    line = pareto(
        usable,
        lambda one: one.cost(REPORT_US, "f767", Conditions()),
        lambda one: one.accuracy(Conditions()),
        MIN_GAIN,
    )
    presets = chosen_presets(usable, "f767")
    shown = {one.name: one for one in (*line, *presets.values()) if one.instructions is not None}
    with drawing(path, 9.0, 5.2) as figure:
        axes = figure.subplots()
        bounds = _bounds()
        labels = _board_labels(bounds)
        for one in shown.values():
            ms, low_ms, high_ms, most_ms = _board_ms(one, bounds)
            y = one.accuracy(Conditions()) or 0.0
            axes.plot(ms, y, "o", mfc="none", color=BLUE, ms=5, label=labels[0])
            axes.plot([low_ms, high_ms], [y, y], color=BLUE, lw=4, alpha=0.4, label=labels[1])
            axes.plot([high_ms, most_ms], [y, y], color=VERMILION, lw=1, label=labels[2])
            axes.annotate(
                one.name, (most_ms, y), xytext=(4, 0), textcoords="offset points", fontsize=7,
                color=INK, va="center",
            )  # fmt: skip
            labels = ("", "", "")
        _name_presets(axes, presets)
        axes.set_xlabel("ms from contact to report on the board (half a period, scan, solve, link)")
        axes.set_ylabel("mean MIoU of the solver's image")
        axes.margins(x=0.25, y=0.1)
        axes.set_xlim(left=0)
        plain_axes(axes)
        legend_below(figure, axes, 2)
        axes.set_title("The board at 60 dB: Pareto-optimal settings and presets, bounds of time")


def _bounds() -> tuple[float, float]:
    """The bounds of the time over that at an instruction per cycle; both 1 without a checkout."""
    try:
        root = checkout_root()
    except UsageError:
        return 1.0, 1.0
    return stored_ratios(file_of(root / BOARD_COST))


def _board_labels(bounds: tuple[float, float]) -> tuple[str, str, str]:
    low, high = bounds
    return (
        "mean frame at an instruction per cycle",
        f"mean frame, from the optimistic to the pessimistic bound ({low:.2f} to {high:.2f} times"
        " as long)",
        "to the slowest frame by the pessimistic bound",
    )


def _board_ms(
    point: OperatingPoint, bounds: tuple[float, float]
) -> tuple[float, float, float, float]:
    """The report of the mean frame at an instruction per cycle, at the optimistic and at the
    pessimistic bound, and of the slowest frame at that bound."""
    assert point.instructions is not None
    mean_us, most_us = (point.instructions[key] / F767_MHZ for key in ("mean", "most"))
    scan = float(point.costs["acquisition_us"])
    low, high = bounds
    times = (mean_us, low * mean_us, high * mean_us, high * most_us)
    a, b, c, d = (report_us(scan, us, "f767") / 1e3 for us in times)
    return a, b, c, d


def _name_presets(axes: Axes, presets: dict[str, OperatingPoint]) -> None:
    names: dict[str, list[str]] = {}
    for name, one in presets.items():
        names.setdefault(one.name, []).append(name)
    for name, one in {one.name: one for one in presets.values()}.items():
        if one.instructions is not None:
            x, y = _board_ms(one, (1.0, 1.0))[0], one.accuracy(Conditions()) or 0.0
            axes.annotate(
                ", ".join(names[name]), (x, y), xytext=(0, -9), textcoords="offset points",
                ha="center", va="top", fontweight="bold", color=INK,
            )  # fmt: skip
            axes.plot(x, y, "o", ms=11, mfc="none", mec=INK, mew=1.4)
