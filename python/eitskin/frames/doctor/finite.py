"""Check that all voltages are finite numbers, and that there is a signal."""

from dataclasses import replace

import numpy as np

from eitskin.frames.doctor.case import Case, numbers, rms
from eitskin.frames.doctor.remedy import row_remedy
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding


def check_finite(case: Case) -> tuple[Case, CheckOutcome]:
    """Report NaN and Inf by row and frame, and a reference that is zero everywhere; affected rows
    lose their trust."""
    untouched, frames = case.frames.reference_voltage_v, case.frames.voltage_v
    bad_untouched, bad = ~np.isfinite(untouched), ~np.isfinite(frames)
    rows = np.flatnonzero(bad_untouched.any(axis=0) | bad.any(axis=0))
    findings = []
    if len(rows):
        names = [case.frames.frame_name[k] for k in np.flatnonzero(bad.any(axis=1))]
        count = int(bad_untouched.sum() + bad.sum())
        text = f"{count} voltages are NaN or Inf, in {len(rows)} row(s)"
        evidence = {
            "channels": numbers(rows),
            "frames": names,
            "quiet_frames": numbers(np.flatnonzero(bad_untouched.any(axis=1))),
        }
        few = len(rows) <= len(case.rows) // 4
        remedy = row_remedy(case, rows) if few else ""
        findings.append(Finding("not-finite", FAULT, text, evidence, remedy))
    trusted = case.trusted & ~bad_untouched.any(axis=0)
    if rms(case.reference[trusted]) == 0:
        text = "the reference frame is zero everywhere: no current, or a wrong array"
        changed = rms(np.where(np.isfinite(frames), frames, 0.0).ravel()) > 0
        if changed:
            text += "; if the frames are differences from a reference already, say --differences"
            text += " and --skin FILE, and name no reference"
        findings.append(Finding("no-signal", FAULT, text))
    return replace(case, trusted=trusted), CheckOutcome(tuple(findings))
