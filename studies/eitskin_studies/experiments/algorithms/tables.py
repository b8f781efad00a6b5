"""The results as tables, as sentences, and as plain values."""

from collections.abc import Sequence
from typing import Any

from eitskin.scoring import metrics
from eitskin_studies.experiments.algorithms.measure import SNR_DB, TEST, TUNING, Field
from eitskin_studies.experiments.algorithms.results import FIXED_THRESHOLD, AlgorithmResult, column
from eitskin_studies.experiments.algorithms.scenes import NUMBERS
from eitskin_studies.experiments.experiment import Table
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.harness.summary import Summary, summarise
from eitskin_studies.harness.thresholds import THRESHOLDS

TOUCHES = ("1 touch", "2 touches", "3 touches")
SHOWN_AT = (0.1, 0.2, 0.3, 0.5, 0.7)


def tables(results: Sequence[AlgorithmResult]) -> tuple[Table, ...]:
    """All tables of the page."""
    return (
        Table("fixed",
        ("method", "parameter", *TOUCHES, "all", "mean of worst 10 %", "any parameter", "paper"),
        _fixed(results)),
        Table(
            "best",
            ("method", "chosen", "t", *TOUCHES, "all", "mean of worst 10 %"),
            _best(results),
        ),
        Table("counts",
        ("method", "kMAC per frame", *(f"position, {n}" for n in TOUCHES),
        *(f"exact, {n}" for n in TOUCHES)),
              _counts(results)),
        Table("thresholds", ("method", *(f"t = {t:g}" for t in SHOWN_AT)), _thresholds(results)),
        Table("why", ("what changes", *(one.candidate.name for one in _explained(results))),
        _why(results)),
    )  # fmt: skip


def words(field: Field, results: Sequence[AlgorithmResult]) -> dict[str, str]:
    """Sentences with numbers: the conditions, and what agrees with the paper and what does not."""
    return {"conditions": _conditions(field), "verdict": _verdict(results)}


def data(field: Field, results: Sequence[AlgorithmResult]) -> dict[str, Any]:
    """Everything, for JSON."""
    return {
        "conditions": _conditions(field),
        "fixed_threshold": FIXED_THRESHOLD,
        "thresholds": list(THRESHOLDS),
        "methods": [_method(one) for one in results],
    }


def _method(one: AlgorithmResult) -> dict[str, Any]:
    chosen = one.chosen
    return {
        "name": one.candidate.name,
        "parameter": one.candidate.parameter,
        "fixed": {
            "value": one.candidate.fixed,
            "miou": (
                {str(n): vars(one.at_fixed(n)) for n in NUMBERS} | {"all": vars(one.at_fixed())}
            ),
            "curve": one.curve(fixed=True).tolist(),
            "tuning_range_over_all_values": list(one.low_t_range),
        },
        "best": {
            "value": chosen.value,
            "threshold": chosen.threshold,
            "touch_threshold": chosen.touch_threshold,
            "miou": {str(n): vars(one.at_best(n)) for n in NUMBERS} | {"all": vars(one.at_best())},
            "curve": one.curve(fixed=False).tolist(),
            "position_median_mm": {str(n): one.position_mm(n) for n in NUMBERS},
            "exact_count": {str(n): one.exact_count(n) for n in NUMBERS},
            "false_per_scene": {str(n): float(one.best[n]["false"].mean()) for n in NUMBERS},
        },
        "kmac": one.kmacs,
    }


def _fixed(results: Sequence[AlgorithmResult]) -> tuple[tuple[str, ...], ...]:
    return tuple(
        (
            one.candidate.name,
            _parameter(one, one.candidate.fixed),
            *(_with_interval(one.at_fixed(number)) for number in NUMBERS),
            _with_interval(one.at_fixed()),
            short(one.at_fixed().worst_tenth),
            (
                ""
                if one.candidate.own
                else f"{short(one.low_t_range[0])} to {short(one.low_t_range[1])}"
            ),
            _claimed(one),
        )
        for one in results
    )


def _best(results: Sequence[AlgorithmResult]) -> tuple[tuple[str, ...], ...]:
    return tuple(
        (
            one.candidate.name,
            _parameter(one, one.chosen.value),
            f"{one.chosen.threshold:.2f}",
            *(_with_interval(one.at_best(number)) for number in NUMBERS),
            _with_interval(one.at_best()),
            short(one.at_best().worst_tenth),
        )
        for one in results
    )


def _counts(results: Sequence[AlgorithmResult]) -> tuple[tuple[str, ...], ...]:
    return tuple(
        (
            one.candidate.name,
            f"{one.kmacs:,.0f}",
            *(_mm(one.position_mm(number)) for number in NUMBERS),
            *(f"{100 * one.exact_count(number):.0f} %" for number in NUMBERS),
        )
        for one in results
    )


def _thresholds(results: Sequence[AlgorithmResult]) -> tuple[tuple[str, ...], ...]:
    """At the chosen parameter."""
    return tuple(
        (
            one.candidate.name,
            *(short(float(one.curve(fixed=False)[THRESHOLDS.index(t)])) for t in SHOWN_AT),
        )
        for one in results
    )


def _explained(results: Sequence[AlgorithmResult]) -> list[AlgorithmResult]:
    wanted = ("Gauss-Newton (Tikhonov)", "NOSER", "plain FISTA 30, non-negative",
        "plain FISTA 300, non-negative",
              "plain FISTA 3000, non-negative", "eitskin 60, solver's image")  # fmt: skip
    return [one for one in results if one.candidate.name in wanted]


def _why(results: Sequence[AlgorithmResult]) -> tuple[tuple[str, ...], ...]:
    kept = _explained(results)
    rows = {
        f"fixed parameter, t = {FIXED_THRESHOLD:g}": [one.at_fixed() for one in kept],
        "the same, t chosen on tuning scenes": [one.at_fixed(t=one.fixed_t) for one in kept],
        "parameter and t chosen on tuning scenes": [one.at_best() for one in kept],
        "the same, cells show the nearest pixel": [one.at_best(lookup="nearest") for one in kept],
        "the same (bilinear), each test image at its own best t": [
            one.at_each_own() for one in kept
        ],
        f"the three scenes of the picture, fixed parameter, t = {FIXED_THRESHOLD:g}": [
            summarise(column(one.shown_fixed[metrics.LOOKUP], FIXED_THRESHOLD)) for one in kept
        ],
        "the three scenes, each image at its own best t": [
            summarise(one.shown[metrics.LOOKUP].max(axis=1)) for one in kept
        ],
    }  # fmt: skip
    return tuple(
        (what, *(short(summary.mean) for summary in summaries)) for what, summaries in rows.items()
    )


def _conditions(field: Field) -> str:
    (seed, test), (tuning_seed, tuning) = field.seed_and_count(TEST), field.seed_and_count(TUNING)
    return (
        f"{test} scenes for each of 1, 2 and 3 touches, seed {seed}, {SNR_DB:g} dB,"
        f" {AS_EVERYWHERE}; {metrics.LOOKUP} lookup. Parameters and thresholds were chosen on"
        f" {tuning} scenes of each kind of seed {tuning_seed}. The models have no `[uncertainty]`."
        " Intervals are 95 % bootstrap intervals of the mean."
    )


def _verdict(results: Sequence[AlgorithmResult]) -> str:
    by_name = {one.candidate.name: one for one in results}
    claimed_low = [one for one in results if one.candidate.claimed == (0.4, 0.5)]
    low = min(one.low_t_range[0] for one in claimed_low)
    high = max(one.low_t_range[1] for one in claimed_low)
    best = ", ".join(f"{one.candidate.name} {short(one.at_best().mean)}" for one in claimed_low)
    fista = [by_name[f"plain FISTA {k}, non-negative"] for k in (30, 300, 3000)]
    fixed = " / ".join(short(one.at_fixed().mean) for one in fista)
    chosen = " / ".join(short(one.at_best().mean) for one in fista)
    own = by_name["eitskin 60, solver's image"]
    times = fista[-1].kmacs / own.kmacs
    return (
        f"At t = {FIXED_THRESHOLD:g} Gauss-Newton, conjugate gradient and NOSER have an MIoU of"
        f" {short(low)} to {short(high)}, whatever their parameter (the paper: 0.4 to 0.5). With"
        f" the parameter and the t that are best for each, they have: {best}. Plain non-negative"
        f" FISTA has {fixed} at t = {FIXED_THRESHOLD:g} after 30 / 300 / 3,000 iterations, and"
        f" {chosen} with its best parameter and t (the paper: 0.84). The image of eitskin's solver"
        f" has {short(own.at_best().mean)}, and the image that eitskin shows has"
        f" {short(by_name['eitskin 60, image shown'].at_best().mean)}. eitskin takes"
        f" {own.kmacs:,.0f} thousand multiply-accumulates per frame; 3,000 plain iterations take"
        f" {times:,.0f} times as many."
    )


def _parameter(one: AlgorithmResult, value: float) -> str:
    return f"{one.candidate.parameter} {value:g}" if one.candidate.parameter else ""


def _claimed(one: AlgorithmResult) -> str:
    if one.candidate.claimed is None:
        return ""
    low, high = one.candidate.claimed
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _with_interval(of: Summary) -> str:
    return f"{short(of.mean)} [{short(of.low)}, {short(of.high)}]"


def _mm(value: float) -> str:
    return "none found" if value != value else f"{value:.1f} mm"


def short(value: float) -> str:
    """Three digits without the 0 before the point."""
    return f"{value:.3f}".removeprefix("0")
