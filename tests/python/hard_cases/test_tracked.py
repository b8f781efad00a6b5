"""Touches followed in time where frames are bad: noise that flickers, fingers that lift, frames
that are missing."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.results import Options, Reconstruction
from eitskin.errors import FrameError
from eitskin.model.options import default_options, tracking
from eitskin.solve.reconstructor import Reconstructor
from small_models import small, small_blob, small_model

NOISE = 1e-3
FLICKER, LIFT, MISSING = "time/tracked-flicker", "time/tracked-lift", "time/tracked-missing"


def options(**changes: object) -> Options:
    """Return the options of streams, without diagnostics: the linear answers of these frames are
    not a sheet's."""
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


def core(chosen: Options) -> Reconstructor:
    made = Reconstructor(small_model(), blob=small_blob(), options=chosen)
    made.tare(small().untouched(131, 32, NOISE))
    return made


def test_noise_that_flickers(margins):
    """Untouched frames at half of the gate: many of them have a touch by themselves, and each that
    comes is another; in a stream a touch has to come twice to one place."""
    low, untouched = options(detection_factor=0.6), frames_of([None] * 40, 0, 132)
    alone = sum(len(core(low).reconstruct(frame).touches) for frame in untouched)
    tracked = sum(len(one.touches) for one in core(low).stream(untouched))
    assert alone >= 10
    what = "touches reported in 40 untouched frames"
    margins.record(FLICKER, what, "host f32", tracked, alone / 5, "touches")


def test_a_finger_that_lifts(margins):
    """A clear touch that is lifted is not reported in the next frame. A touch that comes to its
    place later has another id."""
    place = (10.0, 15.0)
    path = [place] * 8 + [None] * 5 + [place] * 3 + [None] + [place] * 2
    outcomes = [*core(options()).stream(frames_of(path, 1.0, 133))]
    seen = [tuple(touch.id for touch in one.touches) for one in outcomes]
    assert seen[0] and seen[:8] == [seen[0]] * 8
    ghosts = sum(touch.id == seen[0][0] for one in outcomes[8:] for touch in one.touches)
    what = "frames with a touch that was lifted"
    margins.record(LIFT, what, "host f32", ghosts, 0, "frames")
    # a missed frame between does not make another
    assert seen[13] == seen[15] == seen[17] and seen[13] > seen[0]
    assert seen[16] == ()


def test_frames_that_are_missing(margins):
    """A moving finger; frames that the core refuses in between, or that never came: it keeps its
    id, and stays a number."""
    path: list[tuple[float, float] | None] = [(-30.0 + 2.5 * k, 5.0) for k in range(24)]
    frames, lost = frames_of(path, 1.0, 134), (6, 7, 13)
    left = [one for k, one in enumerate(path) if k not in lost]
    switched, off = 0, 0.0
    for refuses in (True, False):
        skin, good = core(options()), list[Reconstruction]()
        for k, frame in enumerate(frames):
            if k not in lost:
                good.append(skin.follow(frame))
            elif refuses:
                with pytest.raises(FrameError):
                    skin.follow(np.full_like(frame, np.nan))
        assert all(len(one.touches) == 1 for one in good)
        switched += len({one.touches[0].id for one in good}) - 1
        for one, place in zip(good[3:], left[3:], strict=True):
            (touch,) = one.touches
            off = max(off, float(np.hypot(*np.subtract((touch.x_mm, touch.y_mm), place))))
    margins.record(MISSING, "ids a finger changes", "host f32", switched, 0, "ids")
    margins.record(MISSING, "off its place, at most", "host f32", off, 6.0, "mm")
