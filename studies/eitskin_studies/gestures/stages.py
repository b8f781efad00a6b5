"""At which stage a gesture failed: what its fingers' touches lacked, or else the recogniser."""

from collections.abc import Sequence

import numpy as np

from eitskin_studies.gestures.drawn import DrawnGesture, Finger
from eitskin_studies.gestures.simulated import RATE_HZ, TouchedFrame

NEAR_MM = 20.0  # a touch within this distance of a finger may be the finger's
LATE_S = 0.085  # a finger that is first found later than this was found late
GAP_FRAMES = 3  # a finger that so many frames in a row lack was lost
VAGUE_MM = 4.0  # a finger with a larger median error of its place was found at uncertain places

# the first of these that applies
STAGES = (
    "a finger is never found",
    f"a finger is found more than {1e3 * LATE_S:.0f} ms after its contact",
    f"a finger is lost for {GAP_FRAMES} frames or more",
    "a finger gets another id",
    "a false touch beside the fingers",
    f"places are uncertain: median error above {VAGUE_MM:g} mm",
    "the touches are right, the recogniser is not",
)


def failed_stage(one: DrawnGesture, frames: Sequence[TouchedFrame]) -> str:
    """Return the stage at which ``one``, which was not reported rightly, failed."""
    found = [_found(finger, frames) for finger in one.fingers]
    if any(not any(row) for row, _, _ in found):
        return STAGES[0]
    first_s = [row.index(True) / RATE_HZ + 1 / RATE_HZ for row, _, _ in found]
    applies = (
        max(first_s) > LATE_S,
        any(_longest_gap(row) >= GAP_FRAMES for row, _, _ in found),
        any(len(ids) > 1 for _, ids, _ in found),
        any(len(f.touches) > len(one.fingers) for f in frames if _shows(f, one)),
        max(float(np.median(errors)) for _, _, errors in found) > VAGUE_MM,
    )
    return STAGES[1 + applies.index(True)] if any(applies) else STAGES[-1]


def _end_s(frame: TouchedFrame) -> float:
    return frame.time_us * 1e-6 + 1 / RATE_HZ


def _shows(frame: TouchedFrame, one: DrawnGesture) -> bool:
    last_s = max(float(finger.at_s[-1]) for finger in one.fingers)
    return one.start_s <= _end_s(frame) <= last_s + 1 / RATE_HZ


def _found(
    finger: Finger, frames: Sequence[TouchedFrame]
) -> tuple[list[bool], set[int], list[float]]:
    """Return for each frame that lies within the contact whether it shows the finger, and the ids
    and errors (mm) of the touches that show it."""
    shown, ids, errors = [], set(), []
    for frame in frames:
        end_s = _end_s(frame)
        if not finger.at_s[0] + 1 / RATE_HZ <= end_s <= finger.at_s[-1]:
            continue
        middle_s = end_s - 0.5 / RATE_HZ
        x_mm, y_mm = (np.interp(middle_s, finger.at_s, finger.xy_mm[:, axis]) for axis in (0, 1))
        near = [(float(np.hypot(t.x_mm - x_mm, t.y_mm - y_mm)), t.id) for t in frame.touches]
        error_mm, touch_id = min(near, default=(np.inf, 0))
        shown.append(error_mm < NEAR_MM)
        if shown[-1]:
            ids.add(touch_id)
            errors.append(error_mm)
    return shown, ids, errors


def _longest_gap(shown: list[bool]) -> int:
    """Return the greatest number of consecutive frames without the finger after the first with
    it."""
    longest = gap = 0
    for one in shown[shown.index(True) :]:
        gap = 0 if one else gap + 1
        longest = max(longest, gap)
    return longest
