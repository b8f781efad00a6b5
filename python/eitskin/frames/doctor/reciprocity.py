"""Reciprocity: if the drive and the measuring pair are exchanged, the voltage must stay the same,
whatever is inside the skin."""

from collections.abc import Iterable

import numpy as np

from eitskin.frames.doctor.case import Case, rms, short_list
from eitskin.frames.doctor.gain import row_gains
from eitskin.frames.doctor.remedy import row_remedy
from eitskin.frames.doctor.report import FAULT, NOTE, CheckOutcome, Finding

PAIR_FLOOR_PER_RMS = 0.1
PAIR_OFF = 0.25
PAIR_TIMES_USUAL = 6.0
RMS_NOTE = 0.05
RMS_FAULT = 0.08
MEDIAN_NOTE = 0.03
MIN_PAIRS = 8
WORST = 5


def check_reciprocity(case: Case) -> CheckOutcome:
    """Report the reciprocity error of each pair, |Vi - s Vj| / max(mean(|Vi|, |Vj|), 0.1 rms), and
    of all, rms(Vi - s Vj) / rms(V).

    In a bad pair the row whose gain is further from 1 is named as wrong.
    """
    pairs = case.frames.protocol.reciprocal_pairs()
    both = (
        (pairs.second >= 0) & case.trusted[pairs.first] & case.trusted[np.maximum(pairs.second, 0)]
    )
    first, second, sign = pairs.first[both], pairs.second[both], pairs.sign[both]
    if not len(first):
        text = "reciprocity: the protocol has no two rows of one voltage"
        return CheckOutcome(inconclusive=(text,))
    reference = case.reference
    level = rms(reference[case.trusted])
    if level == 0:
        return CheckOutcome()
    difference = reference[first] - sign * reference[second]
    size = (np.abs(reference[first]) + np.abs(reference[second])) / 2
    error = np.abs(difference) / np.maximum(size, PAIR_FLOOR_PER_RMS * level)
    overall, usual = rms(difference) / level, float(np.median(error))
    order = np.argsort(-error, kind="stable")
    gain = np.abs(row_gains(case)[0] - 1)

    def errors(pairs: Iterable[int]) -> dict[str, float]:
        return {f"{first[k]}/{second[k]}": round(float(error[k]), 4) for k in pairs}

    measured = {
        "reciprocity_rms": round(overall, 4),
        "reciprocity_median": round(usual, 4),
        "reciprocity_worst": round(float(error[order[0]]), 4),
    }
    bad = [k for k in order if error[k] > max(PAIR_OFF, PAIR_TIMES_USUAL * usual)]
    findings = []
    evidence: dict[str, object]
    if bad:
        off = [int(first[k] if gain[first[k]] > gain[second[k]] else second[k]) for k in bad]
        text = (
            f"{len(bad)} pair(s) of rows that must agree do not; off in each is row"
            f" {short_list(off)}"
        )
        evidence = {"errors": errors(bad), "off": off, "median_of_all": round(usual, 4)}
        remedy = row_remedy(case, off)
        findings.append(Finding("reciprocity-pairs", FAULT, text, evidence, remedy))
    fault = overall >= RMS_FAULT
    if fault or (overall >= RMS_NOTE and usual >= MEDIAN_NOTE and len(first) >= MIN_PAIRS):
        text = f"reciprocal rows differ by {100 * overall:.1f} % of the rms voltage"
        text += "; measured at different times, gains or currents" if fault else ""
        evidence = {"rms": round(overall, 4), "median": round(usual, 4)}
        evidence["worst_pairs"] = errors(order[:WORST])
        evidence |= {"note_from": RMS_NOTE, "fault_from": RMS_FAULT}
        findings.append(Finding("reciprocity", FAULT if fault else NOTE, text, evidence))
    return CheckOutcome(tuple(findings), measured=measured)
