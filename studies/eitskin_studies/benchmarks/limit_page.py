"""Write what ``eitskin bench limit`` prints and fills into its page; failures come first."""

import math
from collections.abc import Sequence

from eitskin_studies.benchmarks.limit import PATTERNS, LimitResult, Row
from eitskin_studies.benchmarks.limit_scenes import SETS
from eitskin_studies.experiments.multitouch.counts import Share
from eitskin_studies.harness.sections import Filling, Tabular, text_table

MAX_RATIO, MIN_EXACT = 1.5, 0.95
HEAD = (
    "touches found",
    "exact",
    "error, mm: median / p95",
    "bound, mm: median / p95",
    "ratio",
    "90 % ellipses cover",
    "radius off, mm: median / size (bound)",
)
FIRST = {
    "touches": "touches",
    "place": "distance from the rim",
    "contrast": "contrast",
    "snr": "SNR",
    "pattern": "drive pattern, noise",
}
NONE = "-"


def as_text(result: LimitResult) -> str:
    """For a terminal."""
    parts = [_conditions(result), "what fails", text_table(*_fails(result))]
    for name in FIRST:
        if result.table(name):
            parts += [f"by {FIRST[name]}", text_table(*_table(result, name))]
    return "\n\n".join([*parts, text_table(*_cost(result))])


def for_page(result: LimitResult, command: str) -> Filling:
    """Texts and tables of the page's marks."""
    texts = {
        "conditions": _conditions(result),
        "command": f"Made by `{command}`.",
        "sets": "\n".join(f"- {name}: {SETS[name].text}" for name in result.settings.sets),
    }
    tables = {name: _table(result, name) for name in FIRST if result.table(name)}
    return texts, {"fails": _fails(result), **tables, "cost": _cost(result)}


def failures(row: Row) -> list[str]:
    """Return why a line fails, in words."""
    words = []
    if not math.isfinite(row.median_mm):
        return ["no touch was found"]
    if row.ratio > MAX_RATIO:
        words.append(f"error {row.ratio:.1f} times the bound")
    if row.exact is not None and row.exact.mean < MIN_EXACT:
        words.append(f"{_percent(row.exact)} counted exactly")
    if row.covered.count and not row.covered.low <= 0.9 <= row.covered.high:
        words.append(f"ellipses cover {_percent(row.covered)}")
    return words


def _conditions(result: LimitResult) -> str:
    how = result.settings
    return (
        f"Model: {result.model}; the core in float32 with default options. Seed {how.seed},"
        f" {how.scenes} scenes per set. Frames are exact (boundary integrals). Each scene has its"
        " own contacts, whose impedances are spread by 20 %, its own tare of 64 frames, and a"
        " converter of 12 bits, or of 16 bits from 70 dB on, over 1.25 times the greatest untouched"
        " voltage."
        " The SNR refers to the rms of the untouched frame. Found touches are paired with true ones"
        " within 10 mm; *exact* scenes have no touch without a partner. Errors and bounds are those"
        " of the same touches, those with a partner. The bound knows the model, the tare and the"
        " noise with the converter's steps; its priors have the deviations .3 of the radius's"
        " logarithm, .17 of the amplitude (.28 for insulating touches), .15 of each component of"
        f" the shape and .12 of each contact's logarithm. Commit {result.commit}."
    )


def _fails(result: LimitResult) -> Tabular:
    """The lines that fail, the worst ratio first."""
    failing = [(row, words) for row in result.rows if (words := failures(row))]
    failing.sort(key=lambda one: -one[0].ratio if math.isfinite(one[0].ratio) else -math.inf)
    rows = [(f"{FIRST[row.table]}: {row.name}", "; ".join(words)) for row, words in failing]
    return ("line", "what fails"), rows or [("none", NONE)]


def _table(result: LimitResult, name: str) -> Tabular:
    rows = result.table(name)
    return (FIRST[name], *HEAD), [(row.name, *_cells(row)) for row in rows]


def _cells(row: Row) -> Sequence[str]:
    bold = "**" if row.ratio > MAX_RATIO else ""
    radius = f"{_mm(row.radius_bias_mm, True)} / {_mm(row.radius_error_mm)}"
    return (
        f"{row.found.hits} of {row.touches}",
        NONE if row.exact is None else _percent(row.exact),
        f"{_mm(row.median_mm)} / {_mm(row.p95_mm)}",
        f"{_mm(row.bound_mm)} / {_mm(row.bound_p95_mm)}",
        f"{bold}{row.ratio:.2f}{bold}" if math.isfinite(row.ratio) else NONE,
        _percent(row.covered) if row.covered.count else NONE,
        f"{radius} ({_mm(row.radius_bound_mm)})" if math.isfinite(row.radius_bias_mm) else NONE,
    )


def _cost(result: LimitResult) -> Tabular:
    """Multiply-accumulates of the touches of each set and noise."""
    first = PATTERNS[0]
    rows = [
        (f"{FIRST[row.table]}: {row.name}", _kilo(row.macs_mean), _kilo(row.macs_worst))
        for row in result.rows
        if row.macs_mean is not None and row.macs_worst is not None
        if row.table in ("touches", "snr") or not row.name.startswith(first)
    ]
    return ("touches of a frame", "kMAC, mean", "kMAC, worst"), rows


def _mm(value: float, signed: bool = False) -> str:
    if not math.isfinite(value):
        return NONE
    text = f"{value:+.3f}" if signed else f"{value:.3f}"
    return text.replace("0.", ".", 1) if abs(value) < 1 else text[:-1]


def _kilo(macs: float) -> str:
    return f"{macs / 1e3:.0f}"


def _percent(one: Share) -> str:
    return f"{100 * one.mean:.0f} % ({100 * one.low:.0f} to {100 * one.high:.0f})"
