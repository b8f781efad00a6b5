"""Pictures of the cost of accuracy: the front with its names, one knob at a time, samples against
noise, and scenes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.tuning.front import F767_MHZ, Conditions, Front, OperatingPoint
from eitskin.view.pictures import INK
from eitskin_studies.pictures.equal_pictures import draw_board, draw_equal, draw_equal_by_noise
from eitskin_studies.pictures.style import (
    BLUE,
    GREY,
    PURPLE,
    SNR_COLOURS,
    VERMILION,
    drawing,
    legend_below,
    plain_axes,
    plain_ticks,
)
from eitskin_studies.tradeoff.table import best_points, x_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KNOBS = {
    "iterations": "iterations at most",
    "rank": "rank of the reduced Jacobian",
    "pixels": "pixels along the skin",
    "storage": "storage of the Jacobian",
    "lambda_rel": "lambda / lambda_max, at least",
    "regularisation": "mu, the regularisation of the whitening",
    "touch_sweeps": "sweeps of the off-grid fit",
    "solver": "solver",
}
WORDS = ("storage", "touch_sweeps", "solver")
NOISY_KNOBS = ("rank", "regularisation", "lambda_rel")
IMAGE, DISCS = BLUE, VERMILION
LOGARITHMIC = ("iterations", "lambda_rel", "regularisation")


def draw_all(folder: Path, front: Front) -> list[Path]:
    """The pictures of ``DRAWN`` into ``folder``; returns their files.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: one cannot be written.
    """
    for name, draw in DRAWN.items():
        draw(folder / name, front)
    return [folder / name for name in DRAWN]


def draw_front(path: Path, front: Front) -> None:
    """MIoU over the cost, images and discs, every configuration a dot, those that nothing beats
    joined and named."""
    counted = any(one.instructions is not None for one in front.points)
    with drawing(path, 11.0, 5.4) as figure:
        both = figure.subplots(1, 2)
        for axes, judged in zip(both, ("image", "discs"), strict=True):
            _draw_one_front(axes, front.points, Conditions(judged=judged), counted)
        legend_below(figure, both[0], 3)
        how = front.settings
        figure.suptitle(
            f"What accuracy costs: {how.get('scenes')} scenes of 1 to 3 random touches, 60 dB, seed"
            f" {how.get('seed')}"
        )


def _draw_one_front(
    axes: Axes, points: Sequence[OperatingPoint], where: Conditions, counted: bool
) -> None:
    best = best_points(points, where)
    named = {one.name for one in best}
    placed = {
        one.name: (x / 1e6, y)
        for one in points
        if (x := x_of(one, where)) is not None and (y := one.accuracy(where)) is not None
    }
    warm = [placed[one.name] for one in points if one.configuration.warm_start]
    others = [at for name, at in placed.items() if name not in named and at not in warm]
    colour = IMAGE if where.judged == "image" else DISCS
    xs, ys = ([placed[one.name][k] for one in best] for k in (0, 1))
    if others:
        axes.plot(*zip(*others, strict=True), "o", color=GREY, markersize=3.5, alpha=0.7,
                  label="other settings")  # fmt: skip
    axes.step(xs, ys, where="post", color=colour, linewidth=1.2)
    axes.plot(xs, ys, "o", color=colour, markersize=5, label="Pareto-optimal settings")
    if warm:
        axes.plot(*zip(*warm, strict=True), "^", color=PURPLE, markersize=5, fillstyle="none",
                  linestyle="none", label="warm, touches held for four frames")  # fmt: skip
    axes.set_xscale("log")
    low, high = min(ys, default=0.5), max((y for _, y in placed.values()), default=1.0)
    axes.set_ylim(max(low - 0.02, 0.0), high + 0.14 * (high - low) + 0.005)
    axes.set_xlim(0.1, max((x for x, _ in placed.values()), default=10) * 1.2)
    _name(axes, best, xs, ys)
    unit = "instructions per frame on a Cortex-M7" if counted else "MACs per frame"
    axes.set_xlabel(f"million {unit}, solve and touches, mean")
    axes.set_ylabel(f"mean MIoU, {'image' if where.judged == 'image' else 'touches as discs'}")
    plain_axes(axes)
    if counted:
        ms = axes.secondary_xaxis("top", functions=(_to_ms, _to_instructions))
        ms.set_xlabel("ms at 216 MHz and one instruction per cycle (an estimate)")
        plain_ticks(ms.xaxis, (1, 2, 5, 10, 20, 50))
    plain_ticks(axes.xaxis, (0.1, 0.2, 0.5, 1, 2, 5, 10))


def _to_ms(millions: Any) -> Any:
    return millions * 1e3 / F767_MHZ


def _to_instructions(ms: Any) -> Any:
    return ms * F767_MHZ / 1e3


def _name(
    axes: Axes, best: Sequence[OperatingPoint], xs: Sequence[float], ys: Sequence[float]
) -> None:
    """Names to the upper left of the dots, where no setting can be; spread upwards where they would
    collide, and joined to their dots."""
    low, high = axes.get_ylim()
    least, previous = 0.036 * (high - low), float("-inf")
    for one, x, y in sorted(zip(best, xs, ys, strict=True), key=lambda row: row[2]):
        previous = at = max(y + 0.3 * least, previous + least)
        arrow = {"arrowstyle": "-", "color": GREY, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2}
        axes.annotate(
            one.name, (x, y), xytext=(x / 1.14, at), fontsize=7, color=INK, ha="right",
            va="center", arrowprops=arrow,
        )  # fmt: skip


def families(
    points: Sequence[OperatingPoint], knob: str, free: tuple[str, ...] = ()
) -> list[list[OperatingPoint]]:
    """Points that differ in ``knob`` alone (and their names, and the fields in ``free``), three
    values or more each (of solvers two); the largest family first."""
    groups: dict[tuple[Any, ...], list[OperatingPoint]] = {}
    for one in points:
        fields = one.configuration.as_dict()
        groups.setdefault(
            tuple(v for k, v in fields.items() if k not in ("name", knob, *free)), []
        ).append(one)
    kept = [
        sorted(group, key=lambda p: _order(getattr(p.configuration, knob)))
        for group in groups.values()
        if len({getattr(one.configuration, knob) for one in group})
        >= (2 if knob == "solver" else 3)
    ]
    return sorted(kept, key=len, reverse=True)


def _order(value: Any) -> Any:
    order = {"f32": 0, "f16": 1, "i16": 2, "i8": 3}
    return order.get(value, value)


def draw_knobs(path: Path, front: Front) -> None:
    """Accuracy against each knob, all else held: images and discs with the 95 % interval of their
    means."""
    with drawing(path, 12.0, 6.4) as figure:
        panels = figure.subplots(2, 4, sharey=True)
        for axes, (knob, label) in zip(panels.ravel(), KNOBS.items(), strict=True):
            _draw_knob(axes, families(front.points, knob)[:2], knob)
            axes.set_xlabel(label)
            plain_axes(axes)
        for axes in panels[:, 0]:
            axes.set_ylabel("mean MIoU")
        legend_below(figure, panels[0, 0], 4)
        scenes = f"{front.settings.get('scenes')} scenes of 1 to 3 random touches, 60 dB"
        figure.suptitle(f"One setting at a time: {scenes}; bars: 95 % interval")


def _draw_knob(axes: Axes, groups: Sequence[Sequence[OperatingPoint]], knob: str) -> None:
    for group, style in zip(groups, ("o-", "s--"), strict=False):
        scored = [(one, score) for one in group if (score := one.score(Conditions())) is not None]
        values = [getattr(one.configuration, knob) for one, _ in scored]
        places = list(range(len(values))) if knob in WORDS else values
        for judged, colour in (("image", IMAGE), ("discs", DISCS)):
            cells = [score[judged] for _, score in scored]
            spread = [
                [cell["mean"] - cell["low"] for cell in cells],
                [cell["high"] - cell["mean"] for cell in cells],
            ]
            axes.errorbar(
                places, [cell["mean"] for cell in cells], yerr=spread, fmt=style, color=colour,
                markersize=4, linewidth=1.1, elinewidth=0.6, capsize=1.5,
                label=f"{'image' if judged == 'image' else 'touches as discs'},"
                f" around {_base_name(group)!r}",
            )  # fmt: skip
        if knob in WORDS:
            axes.set_xticks(places, [str(value) for value in values])
            axes.margins(x=0.15)
    if not groups:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color=GREY)
        return
    _knob_ticks(axes, groups[0], knob)


def _knob_ticks(axes: Axes, group: Sequence[OperatingPoint], knob: str) -> None:
    """Ticks at the values that were measured, on a logarithmic axis where they are multiples."""
    if knob in WORDS:
        return
    if knob in LOGARITHMIC:
        axes.set_xscale("log")
    values = sorted({getattr(one.configuration, knob) for one in group})
    plain_ticks(axes.xaxis, [value for value in values if value not in (0.005, 90)])


def _base_name(group: Sequence[OperatingPoint]) -> str:
    """The name of a family's member that most of the others are named after."""
    return max(
        (one.name for one in group),
        key=lambda name: (sum(one.name.startswith(name) for one in group), -len(name)),
    )


def draw_noise(path: Path, front: Front) -> None:
    """Images and discs at each SNR against rank, regularisation and lambda."""
    with drawing(path, 12.0, 4.6) as figure:
        columns = figure.subplots(1, len(NOISY_KNOBS), sharey=True)
        for axes, knob in zip(columns, NOISY_KNOBS, strict=True):
            group = next(iter(families(front.points, knob)), [])
            _draw_by_snr(axes, group, [getattr(one.configuration, knob) for one in group])
            _knob_ticks(axes, group, knob)
            axes.set_xlabel(KNOBS[knob])
        columns[0].set_ylabel("mean MIoU")
        legend_below(figure, columns[0], 6)
        figure.suptitle(
            "Rank, regularisation and lambda at each SNR; t is that of training scenes at 60 dB"
        )


def _draw_by_snr(axes: Axes, group: Sequence[OperatingPoint], places: Sequence[float]) -> None:
    """A line an SNR: images with full lines, discs with dashed ones."""
    snrs_db = sorted({float(snr) for one in group for snr in one.scores.get("random", {})})
    for snr_db in snrs_db:
        for judged, style in (("image", "o-"), ("discs", "s--")):
            where = Conditions(snr_db=snr_db, judged=judged)
            ys = [one.accuracy(where) or float("nan") for one in group]
            name = "image" if judged == "image" else "touches as discs"
            axes.plot(
                places, ys, style, color=SNR_COLOURS.get(snr_db, GREY), markersize=4,
                linewidth=1.1, label=f"{name}, {snr_db:g} dB",
            )  # fmt: skip
    plain_axes(axes)


def draw_samples(path: Path, front: Front) -> None:
    """Accuracy against samples per measurement at each SNR, both scans; below, the time that a
    frame takes to measure."""
    groups = families(front.points, "samples", ("scan",))
    with drawing(path, 9.6, 5.0) as figure:
        both = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, scan in zip(both, ("full", "reciprocal"), strict=True):
            chosen = [
                one for one in (groups[0] if groups else []) if one.configuration.scan == scan
            ]
            samples = [one.configuration.samples for one in chosen]
            _draw_by_snr(axes, chosen, samples)
            axes.set_xscale("log")
            axes.tick_params(which="minor", bottom=False)
            times = [f"{one.costs['acquisition_us'] / 1000:.1f} ms" for one in chosen]
            for place, time in zip(samples, times, strict=True):
                axes.annotate(time, (place, 0.0), xycoords=("data", "axes fraction"),
                    xytext=(0, 3), textcoords="offset points", ha="center", fontsize=7,
                              color=GREY)  # fmt: skip
            axes.set_title("full scan" if scan == "full" else "half scan (reciprocal rows once)")
            axes.set_xlabel("samples per measurement (grey: time to measure a frame)")
        both[0].margins(x=0.08)
        if groups:
            plain_ticks(both[0].xaxis, sorted({one.configuration.samples for one in groups[0]}))
        low, high = both[0].get_ylim()
        both[0].set_ylim(low - 0.06 * (high - low), high)
        both[0].set_ylabel("mean MIoU")
        legend_below(figure, both[0], 3)
        figure.suptitle(
            "SNR against samples; the SNR is that of 80 samples, noise falls with their root"
        )


def draw_scenes(path: Path, front: Front) -> None:
    """The points of the front on every set of scenes at 60 dB: image, discs, exact count."""
    points = best_points(front.points, Conditions()) or list(front.points)
    kinds: tuple[tuple[str, Callable[[dict[str, Any]], float]], ...] = (
        ("image MIoU", lambda score: float(score["image"]["mean"])),
        ("MIoU of touches as discs", lambda score: float(score["discs"]["mean"])),
        ("share of exact counts", lambda score: float(score["exact_count"])),
    )
    sets = list(points[0].scores)
    with drawing(path, 12.0, 1.8 + 0.28 * len(points)) as figure:
        panels = figure.subplots(1, 3, sharey=True)
        for axes, (title, value) in zip(panels, kinds, strict=True):
            table = [
                [
                    value(score) if (score := one.score(Conditions(name))) else float("nan")
                    for name in sets
                ]
                for one in points
            ]
            shades = axes.imshow(table, cmap="cividis", vmin=0.5, vmax=1.0, aspect="auto")
            for row, values in enumerate(table):
                for column, shown in enumerate(values):
                    axes.text(
                        column, row, f"{shown:.2f}".removeprefix("0"), ha="center", va="center",
                        fontsize=7, color=INK if shown > 0.78 else "white",
                    )  # fmt: skip
            axes.set_xticks(range(len(sets)), sets, rotation=40, ha="right", fontsize=8)
            axes.set_title(title)
        panels[0].set_yticks(range(len(points)), [one.name for one in points], fontsize=8)
        figure.colorbar(shades, ax=panels, fraction=0.02, extend="min")
        figure.suptitle(
            "The Pareto-optimal settings for images on every set of scenes, 60 dB; t is that of"
            " random training scenes for all"
        )


DRAWN = {
    "equal.svg": draw_equal,
    "equal-by-noise.svg": draw_equal_by_noise,
    "board.svg": draw_board,
    "front.svg": draw_front,
    "knobs.svg": draw_knobs,
    "noise.svg": draw_noise,
    "samples.svg": draw_samples,
    "scenes.svg": draw_scenes,
}
