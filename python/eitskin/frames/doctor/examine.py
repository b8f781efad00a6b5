"""The examination: it runs the checks in order. Each check uses only rows that the earlier checks
still trust."""

from dataclasses import replace

import numpy as np

from eitskin.frames.doctor.case import Case
from eitskin.frames.doctor.clipping import check_clipping
from eitskin.frames.doctor.finite import check_finite
from eitskin.frames.doctor.gain import check_gain, check_level, check_resemblance, check_unit
from eitskin.frames.doctor.noise import check_noise
from eitskin.frames.doctor.numbering import check_numbering
from eitskin.frames.doctor.order import check_flips, check_frames, check_sign, choose_order
from eitskin.frames.doctor.orientation import check_orientation
from eitskin.frames.doctor.pattern import check_pattern
from eitskin.frames.doctor.reciprocity import check_reciprocity
from eitskin.frames.doctor.remedy import combined_remedy, names_numbers
from eitskin.frames.doctor.report import CheckOutcome, DoctorReport
from eitskin.frames.doctor.subject import Subject
from eitskin.frames.doctor.swaps import check_swaps
from eitskin.frames.doctor.wiring import check_lost, check_wiring
from eitskin.frames.frames import Frames
from eitskin.frames.homogeneous import homogeneous

RENUMBER_FIRST = (
    "how to repair findings that name an electrode or a row: renumber by import first, then"
    " examine again"
)


def examine(subject: Subject) -> DoctorReport:
    """Return what is wrong with ``subject``, with evidence and remedies;
    docs/guide/import-and-doctor.md describes every check."""
    return examine_case(subject)[0]


def examine_case(subject: Subject) -> tuple[DoctorReport, Case]:
    """Return the report of ``examine``, and the case as the checks left it, for the picture."""
    cases: list[Case] = []
    finite = CheckOutcome()
    for reading in subject.readings:
        case, outcome = check_finite(_case(reading.frames, subject))
        finite = finite if cases else outcome
        cases.append(case)
    outcomes = [finite]
    if finite.findings and finite.findings[-1].name == "no-signal":
        return _report(subject, cases[0], outcomes), cases[0]
    chosen = choose_order(subject.readings, tuple(cases), subject)
    if any(finding.name == "differences" for finding in chosen.outcome.findings):
        outcomes.append(chosen.outcome)
        return _report(subject, chosen.case, outcomes), chosen.case
    pattern = check_pattern(cases[0], chosen)
    if pattern.findings:
        outcomes += [pattern, check_noise(cases[0])]
        return _report(subject, cases[0], outcomes), cases[0]
    case, numbering = check_numbering(chosen.case)
    case, swaps = check_swaps(case)
    outcomes += [chosen.outcome, replace(numbering, inconclusive=()), swaps, check_frames(case)]
    case, sign = check_sign(case)
    case, clipping = check_clipping(case)
    case, wiring = check_wiring(case)
    if case.joined:
        text = "gains, single rows and numbering: separate the joined electrodes first"
        outcomes += [sign, clipping, wiring, check_reciprocity(case), check_noise(case)]
        outcomes.append(CheckOutcome(inconclusive=(text,)))
        return _report(subject, case, outcomes), case
    resemblance = check_resemblance(case)
    if resemblance.findings:
        outcomes += [clipping, resemblance, check_reciprocity(case), check_noise(case)]
        return _report(subject, case, outcomes), case
    case, flips = check_flips(case)
    lost = check_lost(case)
    case, gain = check_gain(case)
    outcomes += [sign, clipping, wiring, lost, flips, gain, resemblance]
    outcomes += [check_reciprocity(case), check_noise(case)]
    outcomes.append(check_orientation(case, numbering.inconclusive))
    outcomes.append(check_level(case) if subject.stand_in else check_unit(case, subject.unit_known))
    return _report(subject, case, outcomes), case


def _case(frames: Frames, subject: Subject) -> Case:
    rows = np.asarray(frames.protocol.drive_measure, dtype=np.int64)
    prediction = subject.stand_in or homogeneous(subject.skin, frames.protocol.n_electrodes)
    trusted = np.ones(len(rows), dtype=bool)
    return Case(frames, subject.skin, prediction, prediction.transfer_ohm, rows, trusted)


def _report(subject: Subject, case: Case, outcomes: list[CheckOutcome]) -> DoctorReport:
    findings = tuple(finding for outcome in outcomes for finding in outcome.findings)
    inconclusive = (
        *subject.remarks,
        *(text for outcome in outcomes for text in outcome.inconclusive),
    )
    if any(finding.name == "numbering" for finding in findings):
        if any(names_numbers(finding.repair) for finding in findings):
            inconclusive = (*inconclusive, RENUMBER_FIRST)
        findings = tuple(replace(f, repair="") if names_numbers(f.repair) else f for f in findings)
    frames = case.frames
    described = (
        f"{frames.n_frames} frame(s) of {len(case.rows)} rows,"
        f" {len(frames.reference_voltage_v)} untouched, {frames.protocol.n_electrodes} electrodes;"
        f" compared with {case.prediction.source}"
    )
    measured: dict[str, object] = {}
    for outcome in outcomes:
        measured |= outcome.measured
    return DoctorReport(
        source=subject.source,
        subject=described,
        findings=findings,
        inconclusive=inconclusive,
        measured=measured,
        repair=combined_remedy(case, (finding.repair for finding in findings if finding.repair)),
    )
