"""Dead or joined electrodes: each hypothesis predicts a frame, and the best one is reported.

For joined electrodes the wire is added to the transfer matrix. An electrode is dead if nearly all
rows that drive with it, or nearly all that measure with it, stand out or are silent, while all rows
without it are unaffected. Up to four are looked for at once, because each hides the others.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.frames.doctor.case import Case, numbers
from eitskin.frames.doctor.gain import outliers, row_gains
from eitskin.frames.doctor.misfit import Joined, best_joined, misfit
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding
from eitskin.frames.orders import touching

MIN_OUTLIERS = 4
BETTER_TIMES = 2.0
GOOD = 0.2
PREFER_JOINED = 1.25
MOSTLY = 0.8
LOST = 0.2
SILENT = 0.1
MAX_SETS = 600
MAX_FAULTS = 4


@dataclass(frozen=True)
class Dead:
    """Electrodes assumed dead, and the misfit and number of the rows without them."""

    electrodes: tuple[int, ...]
    misfit: float
    rows_left: int


def check_wiring(case: Case) -> tuple[Case, CheckOutcome]:
    """Report faults as long as one explains the rows that stand out: dead electrodes, or one short
    circuit.

    The search ends once a short circuit is found, because its frame is predicted only roughly.
    """
    findings: list[Finding] = []
    while len(findings) < MAX_FAULTS and (
        np.count_nonzero(outliers(case)) >= MIN_OUTLIERS or _suspects(case)
    ):
        before = misfit(case, case.trusted, case.magnitude)
        enough = min(GOOD, before / BETTER_TIMES)
        joined, dead = best_joined(case, case.magnitude), _best_dead(case)
        if dead is not None and PREFER_JOINED * dead.misfit < joined.misfit:
            if dead.misfit > enough:
                break
            case, found = _without(case, dead, before)
            findings.extend(found)
            continue
        if joined.misfit <= enough:
            case, finding = _with_joined(case, joined, before)
            findings.append(finding)
        break
    return case, CheckOutcome(tuple(findings))


def check_lost(case: Case) -> CheckOutcome:
    """Report electrodes that drive in the untouched frames but stop driving in some of the
    others."""
    gain, strong = row_gains(case)
    usable = strong & (np.abs(gain) > LOST)
    findings = []
    for electrode in sorted(set(case.rows[:, :2].ravel().tolist())):
        using = (case.rows[:, :2] == electrode).any(axis=1) & usable
        if using.sum() < MIN_OUTLIERS or not len(case.frames.voltage_v):
            continue
        driven = case.frames.voltage_v[:, using]
        driven = np.where(np.isfinite(driven), driven, np.inf)
        left = np.median(np.abs(driven / case.reference[using]), axis=1)
        frames = np.flatnonzero(left < LOST)
        if len(frames):
            text = (
                f"electrode {electrode} (from 0) stops driving in {len(frames)} frame(s), first"
                f" {case.frames.frame_name[frames[0]]!r}"
            )
            evidence = {"electrode": electrode, "frames": numbers(frames)}
            evidence |= {"left": round(float(left[frames].max()), 4)}
            remedy = f"--drop-electrodes {electrode}"
            findings.append(Finding("electrode-lost", FAULT, text, evidence, remedy))
    return CheckOutcome(tuple(findings))


def _best_dead(case: Case) -> Dead | None:
    """Return the smallest set of suspects without which the other rows are well explained.

    A larger set must be BETTER_TIMES better. Sets of one size that are about as good differ where a
    neighbour of two dead electrodes is suspected too; the set that leaves most rows is taken.
    """
    suspects, best = _suspects(case), None
    for size in range(1, min(len(suspects), MAX_FAULTS) + 1):
        if comb(len(suspects), size) > MAX_SETS:
            break
        sets = [_dead(case, electrodes) for electrodes in combinations(suspects, size)]
        limit = BETTER_TIMES * min(dead.misfit for dead in sets)
        alike = [dead for dead in sets if dead.misfit <= limit]
        found = max(alike, key=lambda dead: (dead.rows_left, -dead.misfit))
        if best is None or found.misfit * BETTER_TIMES < best.misfit:
            best = found
    return best


def _dead(case: Case, electrodes: tuple[int, ...]) -> Dead:
    others = case.trusted & ~touching(case.rows, electrodes)
    off = misfit(case, others, case.magnitude) if others.any() else 1.0
    return Dead(electrodes, off, int(np.count_nonzero(others)))


def _suspects(case: Case) -> list[int]:
    return [e for e in sorted(set(case.rows.ravel().tolist())) if _sides_off(case, e)]


def _sides_off(case: Case, electrode: int) -> dict[str, float]:
    """Return which of "driving" and "measuring" are affected, with the gain: those in which nearly
    all rows of ``electrode`` stand out.

    They stand out from similar rows; or, if too many of those are dead, by being nearly silent.
    """
    off, (gain, _), strength = outliers(case), row_gains(case), _strength(case)
    sides = {}
    for name, columns in (("driving", [0, 1]), ("measuring", [2, 3])):
        using = (case.rows[:, columns] == electrode).any(axis=1) & case.trusted
        if not using.any():
            continue
        silent = float(np.median(strength[using]))
        if silent < SILENT:
            sides[name] = round(silent, 4)
        elif off[using].mean() >= MOSTLY:
            sides[name] = round(float(np.median(np.abs(gain[using]))), 4)
    return sides


def _strength(case: Case) -> FloatArray:
    """Return |reference| per |prediction| (m,), relative to its upper quartile, which is robust
    while fewer than half of the rows are dead."""
    size = np.abs(case.predicted)
    ratio = np.divide(np.abs(case.reference), size, out=np.ones_like(size), where=size > 0)
    usual = float(np.quantile(ratio[case.trusted], 0.75)) if case.trusted.any() else 0.0
    return ratio / usual if usual > 0 else np.ones_like(ratio)


def _without(case: Case, dead: Dead, before: float) -> tuple[Case, list[Finding]]:
    findings = []
    for electrode in dead.electrodes:
        sides = _sides_off(case, electrode)
        evidence: dict[str, Any] = {"electrode": electrode}
        evidence |= {f"{name}_gain": gain for name, gain in sides.items()}
        evidence |= {"misfit": round(dead.misfit, 4), "misfit_without": round(before, 4)}
        text = (
            f"electrode {electrode} (from 0) is dead, {' and '.join(sides)}: repair its contact, or"
            " leave it out"
        )
        remedy = f"--drop-electrodes {electrode}"
        findings.append(Finding("dead-electrode", FAULT, text, evidence, remedy))
    return replace(case, trusted=case.trusted & ~touching(case.rows, dead.electrodes)), findings


def _with_joined(case: Case, joined: Joined, before: float) -> tuple[Case, Finding]:
    i, j = joined.pair
    text = (
        f"electrodes {i} and {j} (from 0) are joined by a short circuit: separate them; no import"
        " option can undo this"
    )
    evidence = {
        "electrodes": [i, j],
        "misfit": round(joined.misfit, 4),
        "misfit_without": round(before, 4),
    }
    trusted = case.trusted & ~touching(case.rows, [i, j])
    bridged = replace(case, transfer_ohm=joined.transfer_ohm, trusted=trusted)
    return bridged, Finding("shorted-electrodes", FAULT, text, evidence)
