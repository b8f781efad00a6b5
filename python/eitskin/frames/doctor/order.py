"""The order and the sign of the rows. Each hypothesis is compared with the homogeneous frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.doctor.case import SAME, Case, cosine, numbers, rms
from eitskin.frames.doctor.meaning import (
    constant_in,
    differences_outcome,
    offset_outcome,
    without_constant,
)
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.doctor.subject import AS_GIVEN, POTENTIALS_ORDERS, Reading, Subject
from eitskin.frames.doctor.swaps import likeness

BETTER_BY = 0.1
LIKELY = 0.9
OPPOSITE_PER_RMS = 0.03
MIXED_SHARE = 0.1
UNLIKE = 0.5


@dataclass(frozen=True, eq=False)
class OrderChoice:
    """The reading whose magnitudes follow the prediction best, its case, its correlation
    ``likeness``, and the outcome for the report."""

    best: int
    case: Case
    outcome: CheckOutcome
    likeness: float = 1.0


def choose_order(
    readings: Sequence[Reading], cases: tuple[Case, ...], subject: Subject
) -> OrderChoice:
    """Compare one case per reading, by the correlation of |reference| with |homogeneous
    prediction|.

    If no reading reaches LIKELY, a constant in all numbers, frames that are differences, exchanged
    wires or a dead electrode may hide the right one, and are tried in this order. A reading other
    than the given one is reported if its correlation is at least LIKELY and better by more than
    BETTER_BY.
    """
    names = tuple(reading.name for reading in readings)
    own = names.index(subject.given) if subject.given in names else -1
    size = np.abs(cases[0].predicted)
    if own >= 0 and np.ptp(size) <= SAME * size.max():
        return OrderChoice(
            own,
            cases[own],
            CheckOutcome(
                inconclusive=("the channel order: the protocol makes all channels alike",)
            ),
        )
    reached = [likeness(case, allow_fault=False) for case in cases]
    offset: CheckOutcome | None = None
    constants = [
        constant_in(case, reading.sign) for case, reading in zip(cases, readings, strict=True)
    ]
    found = int(np.argmax([one.correlation for one in constants]))
    if (max(reached) < LIKELY and constants[found].convincing) or constants[found].surely:
        cases = tuple(
            without_constant(case, one) for case, one in zip(cases, constants, strict=True)
        )
        offset = offset_outcome(constants[found], subject)
        reached = [one.correlation for one in constants]
    elif max(reached) < LIKELY:
        if (differences := differences_outcome(cases, names)) is not None:
            best, outcome = differences
            return OrderChoice(best, cases[best], _joined(outcome, readings[best]))
        reached = [likeness(case, allow_fault=True) for case in cases]
    best = int(np.argmax(reached))
    evidence: dict[str, Any] = {
        name: round(value, 4) for name, value in zip(names, reached, strict=True)
    }
    measured: dict[str, Any] = {"order_correlation": evidence}
    findings = () if offset is None else offset.findings
    if own >= 0 and (best == own or reached[best] < max(reached[own] + BETTER_BY, LIKELY)):
        outcome = CheckOutcome(findings, measured=measured)
        return OrderChoice(own, cases[own], outcome, max(reached))
    why = "by their number" if own < 0 else "by correlation with the homogeneous frame"
    named = "the order given" if subject.given == AS_GIVEN else f"{subject.given}"
    reading = readings[best]
    if reading.name in POTENTIALS_ORDERS:
        kind, text = (
            "potentials",
            (
                f"{why} the channels are the potentials of single electrodes against ground, not"
                " voltages between two"
            ),
        )
    else:
        kind, text = "order", f"{why} the channels stand in {reading.name} order, not in {named}"
    finding = Finding(kind, FAULT, text, {"correlation": evidence}, reading.repair)
    outcome = CheckOutcome((finding, *findings), measured=measured)
    return OrderChoice(best, cases[best], outcome, max(reached))


def _joined(outcome: CheckOutcome, reading: Reading) -> CheckOutcome:
    """Return the outcome with the options of ``reading`` in its repair."""
    finding = outcome.findings[0]
    repair = f"{reading.repair} {finding.repair}".strip()
    return replace(outcome, findings=(replace(finding, repair=repair),))


def check_frames(case: Case) -> CheckOutcome:
    """Report frames that are not a small change of the reference: another quantity (imaginary
    parts, times) or another unit."""
    reference = case.reference[case.trusted]
    frames = _finite_frames(case)[:, case.trusted]
    likeness = np.array([cosine(frame, reference) for frame in frames])
    odd = np.flatnonzero(likeness < UNLIKE)
    if not len(odd):
        return CheckOutcome()
    names = [case.frames.frame_name[k] for k in odd]
    finding = Finding(
        "frames-unlike-the-reference",
        FAULT,
        f"{len(odd)} frame(s) do not resemble the reference, first {names[0]!r}: imaginary parts"
        " or another quantity among the columns? Choose with --columns and --complex-part, or"
        " --voltage",
        {"frames": names, "cosine": [round(float(v), 4) for v in likeness[odd]]},
    )
    return CheckOutcome((finding,))


def check_sign(case: Case) -> tuple[Case, CheckOutcome]:
    """Report reversed polarity, or magnitudes without sign; the case is returned with its signs
    repaired.

    If the homogeneous frame has both signs, data with only one sign are magnitudes. If it has only
    one sign (adjacent patterns), data of the other sign are either reversed or magnitudes, and only
    a row that crosses zero decides.
    """
    measured, predicted = case.reference[case.trusted], case.predicted[case.trusted]
    level = rms(measured)
    if level == 0:
        return case, CheckOutcome()
    limit = OPPOSITE_PER_RMS * level
    energy = float((predicted**2).sum())
    positive_share = float((predicted[predicted > 0] ** 2).sum()) / max(energy, 1e-300)
    mixed = MIXED_SHARE < positive_share < 1 - MIXED_SHARE
    frames = _finite_frames(case)[:, case.trusted]
    alike = [frame for frame in frames if cosine(frame, measured) >= UNLIKE]
    everything = np.concatenate([measured, *alike])
    some_negative = bool((everything < -limit).any())
    evidence: dict[str, Any] = {
        "cosine_with_prediction": round(cosine(measured, predicted), 4),
        "least_v": float(np.min(everything)),
        "greatest_v": float(np.max(everything)),
    }
    if mixed and not (measured < -limit).any():
        text = (
            "all voltages are above 0 where the homogeneous frame has both signs: these are"
            " magnitudes"
        )
        finding = Finding("magnitude", FAULT, text, evidence, "--sign magnitude")
        return signed_as_predicted(case), CheckOutcome((finding,))
    if cosine(measured, predicted) < 0:
        if some_negative or mixed:
            text = "every row has the opposite sign: V+ and V- (or I+ and I-) are exchanged"
            finding = Finding("reversed", FAULT, text, evidence, "--sign reversed")
        else:
            text = (
                "all voltages are above 0 where the homogeneous frame is below 0: reversed polarity"
                " or magnitudes; no row crosses 0, so they cannot be distinguished, and both"
                " options repair it alike"
            )
            finding = Finding("reversed-or-magnitude", FAULT, text, evidence, "--sign reversed")
        return _times(case, -1.0), CheckOutcome((finding,))
    if not mixed and positive_share > 0.5 and not some_negative:
        text = "whether these are magnitudes: the homogeneous frame is above 0 everywhere, too"
        return case, CheckOutcome(inconclusive=(text,))
    return case, CheckOutcome()


def check_flips(case: Case) -> tuple[Case, CheckOutcome]:
    """Report single rows with the wrong sign, among those whose prediction is above a fifth of its
    rms."""
    predicted, expected = case.predicted, case.expected()
    ratio = np.divide(case.reference, expected, out=np.ones_like(expected), where=expected != 0)
    wrong = case.trusted & (np.abs(predicted) > 0.2 * rms(predicted)) & (ratio < -0.5)
    rows = numbers(np.flatnonzero(wrong))
    if not rows or case.magnitude:
        return case, CheckOutcome()
    drives = _whole_pairs(case, wrong, (0, 1)) | _whole_pairs(case, wrong, (2, 3))
    about = f"; all of {', '.join(sorted(drives))}" if drives else ""
    finding = Finding(
        "flipped-channels",
        FAULT,
        f"{len(rows)} row(s) have the wrong sign{about}",
        {"channels": rows, "ratio_to_expected": round(float(np.median(ratio[rows])), 3)},
        f"--flip-channels {','.join(map(str, rows))}",
    )
    return _times(case, np.where(wrong, -1.0, 1.0)), CheckOutcome((finding,))


def _finite_frames(case: Case) -> FloatArray:
    return np.where(np.isfinite(case.frames.voltage_v), case.frames.voltage_v, 0.0)


def _whole_pairs(case: Case, wrong: np.ndarray[Any, Any], columns: tuple[int, int]) -> set[str]:
    """Return the names of drive (or measuring) pairs of which nearly all trusted rows are
    ``wrong``."""
    what = "drive" if columns[0] == 0 else "measuring pair"
    pairs = case.rows[:, columns]
    found = set()
    for pair in np.unique(pairs[wrong], axis=0):
        using = (pairs == pair).all(axis=1) & case.trusted
        if wrong[using].mean() > 0.8 and using.sum() > 2:
            found.add(f"{what} {pair.tolist()}")
    return found


def _times(case: Case, sign: FloatArray | float, magnitude: bool = False) -> Case:
    """Return ``case`` with its voltages, or their magnitudes, multiplied by ``sign`` (m,)."""
    untouched, voltage = case.frames.reference_voltage_v, case.frames.voltage_v
    if magnitude:
        untouched, voltage = np.abs(untouched), np.abs(voltage)
    frames = replace(case.frames, voltage_v=voltage * sign, reference_voltage_v=untouched * sign)
    return replace(case, frames=frames, magnitude=case.magnitude or magnitude)


def signed_as_predicted(case: Case) -> Case:
    """Return the case with the magnitudes of its voltages and the signs of the prediction."""
    return _times(case, np.where(case.predicted < 0, -1.0, 1.0), magnitude=True)
