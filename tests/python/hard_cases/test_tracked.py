"""Touches followed in time where frames are bad: noise that flickers, fingers that lift, frames
that are missing."""

from dataclasses import replace

import numpy as np

from eitskin.core.results import Options
from eitskin.model.options import default_options, tracking
from eitskin_emulator.core_steps import Choose, Load, Play, Step, TareStep
from small_models import small, small_blob, small_model

NOISE = 1e-3
FLICKER, LIFT, MISSING = "time/tracked-flicker", "time/tracked-lift", "time/tracked-missing"


def options(**changes: object) -> Options:
    """Tracking on; the linear answers of these frames are no sheet's, so that nothing else is
    looked for."""
    return replace(tracking(default_options(small_model())), diagnostics=0, **changes)


def frames_of(places_mm: list[tuple[float, float] | None], share: float, seed: int) -> np.ndarray:
    """A disc of 9 mm at each place, or none, that changes the sheet by ``share`` of itself; with
    noise."""
    s = small()
    frames = s.untouched(seed, len(places_mm), NOISE)
    for frame, place in zip(frames, places_mm, strict=True):
        if place is not None:
            inside = np.linalg.norm(s.linear.grid.centres_mm() - place, axis=1) <= 9
            frame += s.linear.jacobian @ (share * s.skin.conductivity_s_per_m * inside)
    return frames


def head(chosen: Options) -> list[Step]:
    return [Load(small_blob()), Choose(chosen), TareStep(small().untouched(131, 32, NOISE))]


def test_noise_that_flickers(same_everywhere, margins):
    """Untouched frames at half of the gate: without tracking many of them have a touch, and each
    that comes is another; with it a touch has to come twice to one place."""
    low = options(detection_factor=0.6)
    untouched = frames_of([None] * 40, 0, 132)
    off = replace(low, track_confirm=0, track_hold=0, track_smooth=0.0)
    untracked, tracked = (
        sum(len(one.touches) for one in same_everywhere.steps([*head(each), Play(untouched)])[1])
        for each in (off, low)
    )
    assert untracked >= 10
    what = "touches reported in 40 untouched frames"
    margins.everywhere(FLICKER, what, tracked, untracked / 5, "touches")


def test_a_finger_that_lifts(same_everywhere, margins):
    """A clear touch that is lifted is no longer reported from the next frame on, and one that comes
    at its place later is another."""
    place = (10.0, 15.0)
    path = [place] * 8 + [None] * 5 + [place] * 3 + [None] + [place] * 2
    _, outcomes = same_everywhere.steps([*head(options()), Play(frames_of(path, 1.0, 133))])
    seen = [tuple(touch.id for touch in one.touches) for one in outcomes]
    assert seen[0] and seen[:8] == [seen[0]] * 8
    ghosts = sum(touch.id == seen[0][0] for one in outcomes[8:] for touch in one.touches)
    margins.everywhere(LIFT, "frames with a touch that was lifted", ghosts, 0, "frames")
    # a missed frame between does not make another
    assert seen[13] == seen[15] == seen[17] and seen[13] > seen[0]
    assert seen[16] == ()


def test_frames_that_are_missing(same_everywhere, margins):
    """A moving finger; frames that the core refuses in between, or that never came: it keeps its
    id, and stays a number."""
    path: list[tuple[float, float] | None] = [(-30.0 + 2.5 * k, 5.0) for k in range(24)]
    frames = frames_of(path, 1.0, 134)
    refused = frames.copy()
    refused[[6, 7, 13]] = np.nan
    dropped = np.delete(frames, [6, 7, 13], axis=0)
    switched, off = 0, 0.0
    left = [one for k, one in enumerate(path) if k not in (6, 7, 13)]
    for played, true in ((refused, path), (dropped, left)):
        _, outcomes = same_everywhere.steps([*head(options()), Play(played)])
        good = [(one, place) for one, place in zip(outcomes, true, strict=True) if one.status == 0]
        assert len(good) == 21 and all(len(one.touches) == 1 for one, _ in good)
        switched += len({one.touches[0].id for one, _ in good}) - 1
        assert all(one.finite() for one in outcomes)
        for one, (x_mm, y_mm) in good[3:]:
            (touch,) = one.touches
            off = max(off, float(np.hypot(touch.x_mm - x_mm, touch.y_mm - y_mm)))
    margins.everywhere(MISSING, "ids a finger changes", switched, 0, "ids")
    margins.everywhere(MISSING, "off its place, at most", off, 6.0, "mm")
