"""Find saturated rows (many readings exactly at the greatest value) and stuck rows (untouched
frames that never change)."""

from dataclasses import replace

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.frames.doctor.case import Case, numbers
from eitskin.frames.doctor.remedy import row_remedy
from eitskin.frames.doctor.report import FAULT, CheckOutcome, Finding

MIN_TIES = 4
TIES_PER_USUAL = 4.0
SAME = 1e-9
MIN_UNTOUCHED = 4


def check_clipping(case: Case) -> tuple[Case, CheckOutcome]:
    """Name rows that stand at a rail, in untouched or other frames, and rows that are stuck."""
    frames = np.vstack([case.frames.reference_voltage_v, case.frames.voltage_v])
    railed = at_rail(np.where(np.isfinite(frames), frames, 0.0))
    untouched = len(case.frames.reference_voltage_v)
    findings, trusted = [], case.trusted
    rows = np.flatnonzero(railed.any(axis=0))
    if len(rows):
        names = [case.frames.frame_name[k] for k in np.flatnonzero(railed[untouched:].any(axis=1))]
        levels = sorted({float(value) for value in frames[railed]})
        text = f"{len(rows)} row(s) stand at a rail: lower the gain or the current"
        one_rail = levels[-1] - levels[0] < 1e-6
        evidence = {
            "channels": numbers(rows),
            "rail_v": levels[:1] if one_rail else [levels[0], levels[-1]],
            "readings": int(railed.sum()),
            "in_quiet_frames": int(railed[:untouched].sum()),
            "frames": names,
        }
        remedy = row_remedy(case, rows)
        findings.append(Finding("saturated", FAULT, text, evidence, remedy))
        trusted = trusted & ~railed[:untouched].any(axis=0)
    stuck = _stuck(case.frames.reference_voltage_v) & ~railed.any(axis=0)
    if stuck.any():
        found = numbers(np.flatnonzero(stuck))
        text = (
            f"{len(found)} row(s) read exactly the same in all {untouched} untouched frames"
            " while others vary"
        )
        remedy = row_remedy(case, found)
        findings.append(Finding("stuck", FAULT, text, {"channels": found}, remedy))
        trusted = trusted & ~stuck
    return replace(case, trusted=trusted), CheckOutcome(tuple(findings))


def at_rail(frames: FloatArray) -> BoolArray:
    """Return which readings (f, m) stand exactly at the greatest or the least value, if far more
    readings do so than at any other value.

    A rail is a value in the outer half of the range of magnitudes that is shared by at least
    MIN_TIES readings, and by TIES_PER_USUAL times as many readings as an average value in that
    half. Equal readings in a frame without noise, or with coarse digits, do not count as a rail.
    """
    found = np.zeros(frames.shape, dtype=bool)
    top = float(np.abs(frames).max(initial=0.0))
    if top == 0:
        return found
    for side in (1.0, -1.0):
        values = side * frames
        limit = float(values.max())
        if limit < top / 2:
            continue
        hits = values >= limit - SAME * top
        rest = values[(values > top / 2) & ~hits]
        different = len(np.unique(np.round(rest / (SAME * top))))
        usual = rest.size / different if rest.size else 1.0
        rows = int(hits.any(axis=0).sum())
        if hits.sum() >= max(MIN_TIES, TIES_PER_USUAL * usual) and (
            rest.size or rows < frames.shape[1]
        ):
            found |= hits
    return found


def _stuck(untouched: FloatArray) -> BoolArray:
    """Return the rows (m,) that do not change over at least MIN_UNTOUCHED untouched frames,
    provided that most rows do change."""
    if len(untouched) < MIN_UNTOUCHED:
        return np.zeros(untouched.shape[1], dtype=bool)
    still = np.ptp(np.nan_to_num(untouched), axis=0) == 0
    return still if still.mean() < 0.5 else np.zeros_like(still)
