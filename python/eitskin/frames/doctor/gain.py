"""The gain of each row: the reference compared with the homogeneous frame, by row and by pair."""

from dataclasses import replace
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.frames.doctor.case import (
    GROUP,
    SAME,
    Case,
    correlation,
    numbers,
    rms,
    robust_spread,
    short_list,
)
from eitskin.frames.doctor.remedy import row_remedy
from eitskin.frames.doctor.report import FAULT, NOTE, CheckOutcome, Finding

WEAK_PER_RMS = 0.02
OUTLIER = 0.25
OUTLIER_SPREADS = 6.0
SPREAD_NOTE = 0.035
SPREAD_FAULT = 0.08
PAIR_NOTE = 0.06
PAIR_FAULT = 0.15
PAIR_AGREE = 0.75
PAIR_SPREADS = 3.0
MANY = 0.5
FOREIGN_BELOW = 0.9
MIN_ROWS = 8
UNIT_OFF = 30.0
LEVEL_FAULT = 0.1


def row_gains(case: Case) -> tuple[FloatArray, BoolArray]:
    """Return reference over expected (m,), and which rows (m,) are trusted and strong enough for
    this ratio to have a meaning."""
    expected = case.expected()
    strong = case.trusted & (np.abs(expected) > WEAK_PER_RMS * rms(expected))
    return np.divide(case.reference, expected, out=np.ones_like(expected), where=strong), strong


def outliers(case: Case) -> BoolArray:
    """Return the rows (m,) whose gain differs from 1 by more than OUTLIER and more than
    OUTLIER_SPREADS times the usual spread."""
    gain, strong = row_gains(case)
    limit = max(OUTLIER, OUTLIER_SPREADS * robust_spread(gain[strong]))
    return np.asarray(strong & (np.abs(gain - 1) > limit))


def check_resemblance(case: Case) -> CheckOutcome:
    """Check whether the reference resembles a homogeneous skin at all."""
    measured, predicted = case.reference[case.trusted], case.predicted[case.trusted]
    size = np.abs(predicted)
    if size.size < MIN_ROWS or np.ptp(size) <= SAME * size.max():
        return CheckOutcome(
            inconclusive=("whether this is a homogeneous skin: too few rows, or all alike",)
        )
    reached = correlation(np.abs(measured), size)
    summary = {"reference_correlation": round(reached, 4)}
    if reached >= FOREIGN_BELOW or rms(measured) == 0:
        return CheckOutcome(measured=summary)
    finding = Finding(
        "unlike-a-homogeneous-skin",
        FAULT,
        "the reference does not look like a homogeneous skin in any known order: another protocol,"
        " outline or wiring, or the skin was touched; if the source has a table of its rows, import"
        " it with that table; if this finding remains, teach the skin from 20 presses (eitskin"
        " teach record)",
        {"correlation": round(reached, 4), "least": FOREIGN_BELOW},
    )
    return CheckOutcome((finding,), measured=summary)


def check_gain(case: Case) -> tuple[Case, CheckOutcome]:
    """Report single rows with a wrong gain, drive or measuring pairs with a wrong gain, and the
    spread over all rows.

    The gain of a row is its reference over the expected homogeneous value; the spread is 1.4826
    times the median distance from the median.
    """
    gain, strong = row_gains(case)
    if strong.sum() < 4:
        return case, CheckOutcome(inconclusive=("gains: too few rows are left",))
    spread = robust_spread(gain[strong])
    measured = {"gain_spread": round(spread, 4)}
    findings = _pair_findings(case, gain, strong, spread)
    off = outliers(case)
    off_alone = off & ~_of_pairs(case, findings)
    if off_alone.any() and off_alone.sum() < MANY * strong.sum():
        rows = np.flatnonzero(off_alone)
        worst = int(rows[np.argmax(np.abs(gain[rows] - 1))])
        text = f"{len(rows)} row(s) are far off: {short_list(rows)}; worst"
        evidence = {
            "channels": numbers(rows),
            "worst_gain": round(float(gain[worst]), 4),
            "spread": round(spread, 4),
        }
        text, remedy = f"{text} {case.row(worst)}", row_remedy(case, rows)
        findings.append(Finding("channel-gain", FAULT, text, evidence, remedy))
    if spread >= SPREAD_NOTE and strong.sum() >= GROUP:
        fault = spread >= SPREAD_FAULT
        text = (
            f"rows have different gains, spread {100 * spread:.1f} %: normalised differences"
            f" {'are needed' if fault else 'may help'}"
        )
        limits = {"note_from": SPREAD_NOTE, "fault_from": SPREAD_FAULT}
        kind, remedy = (FAULT, "--equalise") if fault else (NOTE, "")
        findings.append(
            Finding("gain-spread", kind, text, {"spread": round(spread, 4)} | limits, remedy)
        )
    outcome = CheckOutcome(tuple(findings), measured=measured)
    return replace(case, trusted=case.trusted & ~off), outcome


def check_unit(case: Case, unit_known: bool) -> CheckOutcome:
    """Check whether the numbers can be volts, if the skin's conductivity and the current are
    known."""
    if case.skin is None:
        return CheckOutcome(
            inconclusive=("the unit. Name the skin with its conductivity (--skin)",)
        )
    strong = case.trusted & (np.abs(case.predicted) > WEAK_PER_RMS * rms(case.predicted))
    if not strong.any():
        return CheckOutcome()
    measured_v, per_a = (
        float(np.median(np.abs(frame[strong]))) for frame in (case.reference, case.predicted)
    )
    if measured_v == 0:
        return CheckOutcome()
    ratio = measured_v / (per_a * case.frames.protocol.current_a)
    measured = {"reference_per_predicted": float(f"{ratio:.4g}")}
    if 1 / UNIT_OFF < ratio < UNIT_OFF:
        return CheckOutcome(measured=measured)
    unit = "the numbers are stated as volts" if unit_known else "the source's unit is not known"
    text = (
        f"the reference is {ratio:.3g} times what skin {case.skin.name!r} gives at "
        f"{case.frames.protocol.current_a:g} A; {unit}: check unit, gain, current and conductivity"
    )
    return CheckOutcome((Finding("unit", NOTE, text, measured, ""),), measured=measured)


def check_level(case: Case) -> CheckOutcome:
    """Check whether the voltages are as high as those of the stand-in for the skin, whose size is
    known. This covers generator, current source and receiver together."""
    strong = row_gains(case)[1]
    if not strong.any():
        return CheckOutcome()
    current_a = case.frames.protocol.current_a
    predicted = case.predicted[strong] * current_a
    level = float(np.median(case.reference[strong] / predicted))
    measured = {"reference_per_predicted": round(level, 4)}
    if abs(level - 1) <= LEVEL_FAULT:
        return CheckOutcome(measured=measured)
    text = (
        f"the voltages are {level:.3g} times those of {case.prediction.source} at {current_a:g} A:"
        " check the generator's amplitude, the current source and the receiver's gain"
    )
    return CheckOutcome((Finding("level", FAULT, text, measured),), measured=measured)


def _pair_findings(case: Case, gain: FloatArray, strong: BoolArray, spread: float) -> list[Finding]:
    """Report drive and measuring pairs whose median gain is wrong while most of their rows agree
    about it."""
    findings = []
    for name, verb, columns in (("drive", "driven by", [0, 1]), ("measure", "measured by", [2, 3])):
        pairs = case.rows[:, columns]
        for pair in np.unique(pairs, axis=0):
            using = (pairs == pair).all(axis=1) & strong
            if using.sum() < 4:
                continue
            middle = float(np.median(gain[using]))
            off = abs(middle - 1)
            if off < PAIR_NOTE or robust_spread(gain[using]) > PAIR_AGREE * off:
                continue
            if off < PAIR_SPREADS * spread / np.sqrt(np.count_nonzero(using)):
                continue
            fault = off >= max(PAIR_FAULT, PAIR_SPREADS * spread)
            kind, remedy = (FAULT, "--equalise") if fault else (NOTE, "")
            rows = numbers(np.flatnonzero(using))
            evidence = {"pair": numbers(pair), "gain": round(middle, 4), "channels": rows}
            text = f"rows {verb} pair {pair.tolist()} read {middle:.3g} times what others read"
            findings.append(Finding(f"{name}-pair-gain", kind, text, evidence, remedy))
    return findings


def _of_pairs(case: Case, findings: list[Finding]) -> BoolArray:
    """Return the rows (m,) that findings about pairs already explain."""
    explained: Any = np.zeros(len(case.rows), dtype=bool)
    for finding in findings:
        explained[finding.evidence["channels"]] = True
    return np.asarray(explained)
