"""Pictures of the cost of accuracy: the front with its names, one knob at a time, samples against
noise, scenes, and the objective beside the picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.tuning.front import F767_MHZ, Conditions, Front, OperatingPoint
from eitskin.view.panels import save_picture
from eitskin.view.pictures import INK, STYLE, load_matplotlib
from eitskin_studies.pictures.equal_pictures import draw_board, draw_equal, draw_equal_by_noise
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
GREY, IMAGE, DISCS = "#9a9a9a", "#1f5fa8", "#b35c00"
LOGARITHMIC = ("iterations", "lambda_rel", "regularisation")


def draw_all(folder: Path, front: Front) -> None:
    """The pictures of ``DRAWN`` that the results have something for.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: one cannot be written.
    """
    for name, draw in DRAWN.items():
        draw(folder / name, front)


def draw_front(path: Path, front: Front) -> None:
    """MIoU over the cost, images and discs, every configuration a dot, those that nothing beats
    joined and named."""
    matplotlib = load_matplotlib()
    counted = any(one.instructions is not None for one in front.points)
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(11.0, 5.2), layout="constrained")
        for axes, judged in zip(figure.subplots(1, 2), ("image", "discs"), strict=True):
            _draw_one_front(axes, front.points, Conditions(judged=judged), counted)
        how = front.settings
        figure.suptitle(
            f"What accuracy costs: {how.get('scenes')} scenes of 1 to 3 random touches, 60 dB, seed"
            f" {how.get('seed')}; line: the front"
        )
        save_picture(figure, path)


def _draw_one_front(
    axes: Axes, points: Sequence[OperatingPoint], where: Conditions, counted: bool
) -> None:
    best = best_points(points, where)
    named = {one.name for one in best}
    for point in points:
        x, y = x_of(point, where), point.accuracy(where)
        if (
            x is not None
            and y is not None
            and point.name not in named
            and not point.configuration.warm_start
        ):
            axes.plot(x / 1e6, y, "o", color=GREY, markersize=3.5, alpha=0.8)
    xs = [(x_of(one, where) or 1.0) / 1e6 for one in best]
    ys = [one.accuracy(where) or 0.0 for one in best]
    axes.step(
        xs, ys, where="post", color=IMAGE if where.judged == "image" else DISCS, linewidth=1.2
    )
    axes.plot(xs, ys, "o", color=IMAGE if where.judged == "image" else DISCS, markersize=5)
    axes.set_xscale("log")
    low = min(ys, default=0.5)
    shown = [y for one in points if (y := one.accuracy(where)) is not None]
    top = max(shown, default=1.0)
    axes.set_ylim(max(low - 0.02, 0.0), top + 0.03 * (top - low) + 0.005)
    _name(axes, best, xs, ys)
    unit = "instructions a frame on a Cortex-M7" if counted else "MACs a frame"
    axes.set_xlabel(f"million {unit}, solve and touches, mean")
    axes.set_ylabel(f"mean MIoU, {'image' if where.judged == 'image' else 'touches as discs'}")
    axes.grid(which="both", linewidth=0.4, alpha=0.4)
    if counted:
        ms = axes.secondary_xaxis("top", functions=(_to_ms, _to_instructions))
        ms.set_xlabel("ms at 216 MHz and an instruction a cycle (an estimate)")
        ms.set_xticks([1, 2, 5, 10, 20, 50, 100], ["1", "2", "5", "10", "20", "50", "100"])
        ms.minorticks_off()
    axes.set_xticks([0.2, 0.5, 1, 2, 5, 10, 20], ["0.2", "0.5", "1", "2", "5", "10", "20"])
    axes.minorticks_off()
    warm = [
        (x, y)
        for one in points
        if one.configuration.warm_start and (x := x_of(one, where)) and (y := one.accuracy(where))
    ]
    if warm:
        axes.plot([x / 1e6 for x, _ in warm], [y for _, y in warm], "^", color="#7a3b8f",
            markersize=5, fillstyle="none",
                  linestyle="none", label="warm, touches held for four frames")  # fmt: skip
        axes.legend(frameon=False, fontsize=8, loc="lower right")


def _to_ms(millions: Any) -> Any:
    return millions * 1e3 / F767_MHZ


def _to_instructions(ms: Any) -> Any:
    return ms * F767_MHZ / 1e3


def _name(
    axes: Axes, best: Sequence[OperatingPoint], xs: Sequence[float], ys: Sequence[float]
) -> None:
    """Names beside the dots, below right where the curve is steep; where they crowd, spread
    downwards and joined by a line."""
    low, high = axes.get_ylim()
    least, previous = 0.034 * (high - low), float("inf")
    for one, x, y in sorted(zip(best, xs, ys, strict=True), key=lambda row: -row[2]):
        at = min(y - 0.3 * least, previous - least)
        previous = at
        axes.annotate(
            one.name,
            (x, y),
            xytext=(x * 1.35, at),
            fontsize=7,
            color=INK,
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": GREY,
                "linewidth": 0.5,
                "shrinkA": 0,
                "shrinkB": 2,
            },
        )
    if xs:
        left, right = axes.get_xlim()
        axes.set_xlim(min(left, min(xs) / 1.3), max(right, max(xs) * 4))


def _plain_ticks(axis: Any) -> None:
    ticker = load_matplotlib().ticker
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())


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
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(14.0, 6.4), layout="constrained")
        for axes, (knob, label) in zip(figure.subplots(2, 4).ravel(), KNOBS.items(), strict=True):
            _draw_knob(axes, families(front.points, knob)[:2], knob)
            axes.set_xlabel(label)
            axes.set_ylabel("mean MIoU")
            axes.grid(linewidth=0.4, alpha=0.5)
        scenes = f"{front.settings.get('scenes')} scenes of 1 to 3 random touches, 60 dB"
        figure.suptitle(f"One knob at a time: {scenes}; bars: 95 % interval")
        save_picture(figure, path)


def _draw_knob(axes: Axes, groups: Sequence[Sequence[OperatingPoint]], knob: str) -> None:
    for number, group in enumerate(groups):
        values = [getattr(one.configuration, knob) for one in group]
        places = list(range(len(values))) if knob in WORDS else values
        base = _base_name(group)
        for judged, colour in (("image", IMAGE), ("discs", DISCS)):
            scores = [one.score(Conditions()) for one in group]
            means = [score[judged]["mean"] for score in scores if score is not None]
            spread = [
                [
                    score[judged]["mean"] - score[judged]["low"]
                    for score in scores
                    if score is not None
                ],
                [
                    score[judged]["high"] - score[judged]["mean"]
                    for score in scores
                    if score is not None
                ],
            ]
            style = ("o-", "s--")[number]
            axes.errorbar(places, means, yerr=spread, fmt=style, color=colour, markersize=4,
                linewidth=1.1, elinewidth=0.6,
                          capsize=1.5, label=f"{judged}, {base}")  # fmt: skip
        if knob in WORDS:
            axes.set_xticks(places, [str(value) for value in values])
            axes.margins(x=0.15)
    if not groups:
        axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color=GREY)
        return
    if knob in LOGARITHMIC:
        axes.set_xscale("log")
        _plain_ticks(axes.xaxis)
    if knob in ("storage", "solver"):  # level lines leave no room
        low, high = axes.get_ylim()
        axes.set_ylim(low - 0.4 * (high - low), high)
    axes.legend(frameon=False, fontsize=7)


def _base_name(group: Sequence[OperatingPoint]) -> str:
    """The name of a family's member that most of the others are named after."""
    return max(
        (one.name for one in group),
        key=lambda name: (sum(one.name.startswith(name) for one in group), -len(name)),
    )


def draw_noise(path: Path, front: Front) -> None:
    """The knobs that noise turns: images and discs at each SNR against rank, regularisation and
    lambda."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(12.0, 4.4), layout="constrained")
        columns = figure.subplots(1, len(NOISY_KNOBS), sharey=True)
        for axes, knob in zip(columns, NOISY_KNOBS, strict=True):
            group = next(iter(families(front.points, knob)), [])
            snrs = sorted({float(snr) for one in group for snr in one.scores.get("random", {})})
            for number, snr_db in enumerate(snrs):
                for judged, style in (("image", "o-"), ("discs", "s--")):
                    ys = [one.accuracy(Conditions(snr_db=snr_db, judged=judged)) for one in group]
                    axes.plot([getattr(one.configuration, knob) for one in group], ys, style,
                        color=f"C{number}", markersize=4,
                              linewidth=1.1, label=f"{judged}, {snr_db:g} dB")  # fmt: skip
            if knob in LOGARITHMIC:
                axes.set_xscale("log")
                _plain_ticks(axes.xaxis)
            if group:
                axes.set_title(f"around {_base_name(group)!r}", fontsize=9)
            axes.set_xlabel(KNOBS[knob])
            axes.grid(linewidth=0.4, alpha=0.5)
        columns[0].set_ylabel("mean MIoU")
        if columns[0].lines:
            columns[0].legend(frameon=False, fontsize=7)
        figure.suptitle(
            "What noise asks for: fewer directions, a higher regularisation; t is that of training"
            " scenes at"
            " 60 dB"
        )
        save_picture(figure, path)


def draw_samples(path: Path, front: Front) -> None:
    """Accuracy against samples a measurement at each SNR, both scans; above, what a frame takes to
    measure."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(9.6, 4.6), layout="constrained")
        both = figure.subplots(1, 2, sharey=True)
        groups = families(front.points, "samples", ("scan",))
        for axes, scan in zip(both, ("full", "reciprocal"), strict=True):
            chosen = [
                one for one in (groups[0] if groups else []) if one.configuration.scan == scan
            ]
            snrs = sorted({float(snr) for one in chosen for snr in one.scores.get("random", {})})
            for number, snr_db in enumerate(snrs):
                for judged, style in (("image", "o-"), ("discs", "s--")):
                    ys = [one.accuracy(Conditions(snr_db=snr_db, judged=judged)) for one in chosen]
                    axes.plot([one.configuration.samples for one in chosen], ys, style,
                        color=f"C{number}", markersize=4,
                              linewidth=1.1, label=f"{judged}, {snr_db:g} dB")  # fmt: skip
            axes.set_xscale("log")
            if chosen:
                labels = [
                    f"{one.configuration.samples}\n{one.costs['acquisition_us'] / 1000:.1f} ms"
                    for one in chosen
                ]
                axes.set_xticks([one.configuration.samples for one in chosen], labels)
                axes.minorticks_off()
                axes.legend(frameon=False, fontsize=7)
            axes.set_title(f"{scan} scan")
            axes.set_xlabel("samples a measurement, and time to measure a frame")
            axes.grid(linewidth=0.4, alpha=0.5)
        both[0].set_ylabel("mean MIoU")
        figure.suptitle(
            "SNR against samples; the SNR is that of 80 samples, noise falls with their root"
        )
        save_picture(figure, path)


def draw_scenes(path: Path, front: Front) -> None:
    """The points of the front on every set of scenes at 60 dB: image, discs, exact count."""
    matplotlib = load_matplotlib()
    points = best_points(front.points, Conditions()) or list(front.points)
    kinds: tuple[tuple[str, Callable[[dict[str, Any]], float]], ...] = (
        ("image MIoU", lambda score: float(score["image"]["mean"])),
        ("discs MIoU", lambda score: float(score["discs"]["mean"])),
        ("exact count", lambda score: float(score["exact_count"])),
    )
    sets = list(points[0].scores)
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(
            figsize=(12.0, 1.6 + 0.28 * len(points)), layout="constrained"
        )
        for number, (axes, (title, value)) in enumerate(
            zip(figure.subplots(1, 3), kinds, strict=True)
        ):
            table = [
                [
                    value(score) if (score := one.score(Conditions(name))) else float("nan")
                    for name in sets
                ]
                for one in points
            ]
            axes.imshow(table, cmap="YlGnBu", vmin=0.5, vmax=1.0, aspect="auto")
            for row, values in enumerate(table):
                for column, shown in enumerate(values):
                    colour = "white" if shown > 0.82 else INK
                    axes.text(
                        column,
                        row,
                        f"{shown:.2f}".lstrip("0"),
                        ha="center",
                        va="center",
                        fontsize=7,
                        color=colour,
                    )
            axes.set_xticks(range(len(sets)), sets, rotation=40, ha="right", fontsize=8)
            axes.set_yticks(
                range(len(points)),
                [one.name for one in points] if number == 0 else [""] * len(points),
                fontsize=8,
            )
            axes.set_title(title)
        figure.suptitle(
            "The front of images on every set of scenes, 60 dB; t is that of random training scenes"
            " for all"
        )
        save_picture(figure, path)


def draw_objective(path: Path, front: Front) -> None:
    """The solver's own measure beside the picture's: MIoU over the relative duality gap, along more
    and more iterations."""
    matplotlib = load_matplotlib()
    with matplotlib.rc_context(STYLE):
        figure = matplotlib.figure.Figure(figsize=(6.4, 4.4), layout="constrained")
        axes = figure.add_subplot()
        for number, group in enumerate(families(front.points, "iterations")[:2]):
            scores = [
                (one, score)
                for one in group
                if (score := one.score(Conditions())) is not None and score["gap_rel"] > 0
            ]
            for judged, style in (("image", "o-"), ("discs", "s--")):
                axes.plot([score["gap_rel"] for _, score in scores],
                    [score[judged]["mean"] for _, score in scores], style,
                          color=f"C{number}", markersize=4, linewidth=1.1,
                          label=f"{judged}, {_base_name(group)}"
                          f" (lambda {group[0].configuration.lambda_rel:g})")  # fmt: skip
            for one, score in scores:
                axes.annotate(f"{one.configuration.iterations}",
                    (score["gap_rel"], score["image"]["mean"]), xytext=(3, -9),
                              textcoords="offset points", fontsize=7)  # fmt: skip
        axes.set_xscale("log")
        axes.invert_xaxis()
        axes.set_xlabel("relative duality gap, median (to the right: nearer the optimum)")
        axes.set_ylabel("mean MIoU")
        axes.grid(linewidth=0.4, alpha=0.5)
        axes.set_title(
            "The optimum of the objective is not the best picture; numbers: iterations", fontsize=9
        )
        if axes.lines:
            axes.legend(frameon=False, fontsize=7)
        save_picture(figure, path)


DRAWN = {
    "equal.png": draw_equal,
    "equal-by-noise.png": draw_equal_by_noise,
    "board.png": draw_board,
    "front.png": draw_front,
    "knobs.png": draw_knobs,
    "noise.png": draw_noise,
    "samples.png": draw_samples,
    "scenes.png": draw_scenes,
    "objective.png": draw_objective,
}
