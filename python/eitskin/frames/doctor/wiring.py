"""Electrodes that are dead or joined: every such hypothesis predicts a frame, and the best one is named.

Joined electrodes: the transfer matrix with the wire in it. A dead electrode: nearly all channels that drive by it, or
that measure by it, stand out, and all channels without it are as if nothing had happened.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.frames.doctor.case import Case, numbers
from eitskin.frames.doctor.gain import channel_gains, outliers
from eitskin.frames.doctor.misfit import Joined, best_joined, misfit
from eitskin.frames.doctor.report import FAULT, Finding, Outcome
from eitskin.frames.orders import touching

LEAST_OUTLIERS = 4
BETTER_TIMES = 2.0
GOOD = 0.2
PREFER_JOINED = 1.25
MOSTLY = 0.8
LOST = 0.2
MOST_FAULTS = 4


@dataclass(frozen=True)
class Dead:
    """``electrode`` taken for dead, and the misfit that the channels without it are left with."""

    electrode: int
    misfit: float


def check_wiring(case: Case) -> tuple[Case, Outcome]:
    """Name faults while one explains the channels that stand out: dead electrodes, or one short circuit.

    Nothing more is sought once a short circuit is found: its frame is known only roughly.
    """
    findings: list[Finding] = []
    while len(findings) < MOST_FAULTS and np.count_nonzero(outliers(case)) >= LEAST_OUTLIERS:
        before = misfit(case, case.trusted, case.magnitude)
        enough = min(GOOD, before / BETTER_TIMES)
        joined, dead = best_joined(case, case.magnitude), _best_dead(case)
        if dead is not None and PREFER_JOINED * dead.misfit < joined.misfit:
            if dead.misfit > enough:
                break
            case, finding = _without(case, dead, before)
            findings.append(finding)
            continue
        if joined.misfit <= enough:
            case, finding = _with_joined(case, joined, before)
            findings.append(finding)
        break
    return case, Outcome(tuple(findings))


def check_lost(case: Case) -> Outcome:
    """Electrodes that drive in the quiet frames, but no longer in some of the others."""
    gain, strong = channel_gains(case)
    usable = strong & (np.abs(gain) > LOST)
    findings = []
    for electrode in sorted(set(case.rows[:, :2].ravel().tolist())):
        using = (case.rows[:, :2] == electrode).any(axis=1) & usable
        if using.sum() < LEAST_OUTLIERS or not len(case.frames.voltage_v):
            continue
        driven = np.where(np.isfinite(case.frames.voltage_v[:, using]), case.frames.voltage_v[:, using], np.inf)
        left = np.median(np.abs(driven / case.reference[using]), axis=1)
        frames = np.flatnonzero(left < LOST)
        if len(frames):
            findings.append(
                Finding(
                    "electrode-lost",
                    FAULT,
                    f"electrode {electrode} (from 0) stops driving in {len(frames)} frame(s), "
                    f"first {case.frames.frame_name[frames[0]]!r}",
                    {"electrode": electrode, "frames": numbers(frames), "left": round(float(left[frames].max()), 4)},
                    f"--drop-electrodes {electrode}",
                )
            )
    return Outcome(tuple(findings))


def _best_dead(case: Case) -> Dead | None:
    found = []
    for electrode in sorted(set(case.rows.ravel().tolist())):
        if _sides_off(case, electrode):
            others = case.trusted & ~touching(case.rows, [electrode])
            found.append(Dead(electrode, misfit(case, others, case.magnitude)))
    return min(found, key=lambda dead: dead.misfit, default=None)


def _sides_off(case: Case, electrode: int) -> dict[str, float]:
    """Of "driving" and "measuring" those by which nearly all channels of ``electrode`` stand out, with their gain."""
    off, (gain, _) = outliers(case), channel_gains(case)
    sides = {}
    for name, columns in (("driving", [0, 1]), ("measuring", [2, 3])):
        using = (case.rows[:, columns] == electrode).any(axis=1) & case.trusted
        if using.any() and off[using].mean() >= MOSTLY:
            sides[name] = round(float(np.median(np.abs(gain[using]))), 4)
    return sides


def _without(case: Case, dead: Dead, before: float) -> tuple[Case, Finding]:
    sides = _sides_off(case, dead.electrode)
    evidence: dict[str, Any] = {"electrode": dead.electrode}
    evidence |= {f"{name}_gain": gain for name, gain in sides.items()}
    evidence |= {"misfit": round(dead.misfit, 4), "misfit_without": round(before, 4)}
    text = (
        f"electrode {dead.electrode} (from 0) is dead, {' and '.join(sides)}: mend its contact or wire, or leave it out"
    )
    finding = Finding("dead-electrode", FAULT, text, evidence, f"--drop-electrodes {dead.electrode}")
    return replace(case, trusted=case.trusted & ~touching(case.rows, [dead.electrode])), finding


def _with_joined(case: Case, joined: Joined, before: float) -> tuple[Case, Finding]:
    i, j = joined.pair
    text = f"electrodes {i} and {j} (from 0) are joined by a short circuit: part them; no import option can undo this"
    evidence = {"electrodes": [i, j], "misfit": round(joined.misfit, 4), "misfit_without": round(before, 4)}
    trusted = case.trusted & ~touching(case.rows, [i, j])
    bridged = replace(case, transfer_ohm=joined.transfer_ohm, trusted=trusted)
    return bridged, Finding("shorted-electrodes", FAULT, text, evidence)
