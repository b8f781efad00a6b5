"""Touches followed in time: the C core's against the numpy reference's, in streams of moving
fingers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin.model.options import default_options, tracking
from eitskin.scene.random_touches import TouchScene, TouchSet
from eitskin.scene.random_touches import TrueTouch as Put
from eitskin.scene.simulate import Measurement, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_reference.tracker import Tracker, nearest_pairs
from small_models import prebuilt

FRAMES = 24


@cache
def stream() -> tuple[np.ndarray, np.ndarray]:
    """Quiet frames and a stream at 40 dB: a finger that stays, one that moves and is lifted, one
    that comes."""
    scenes = []
    for k in range(FRAMES):
        touches = [Put(-40.0, 10.0, 9.0, 5.0)]
        if k < 16:
            touches.append(Put(-10.0 + 3 * k, -45.0, 8.0, 4.0))
        if k >= 8:
            touches.append(Put(30.0, 60.0 - k, 9.0, 6.0))
        scenes.append(TouchScene(str(k), tuple(touches)))
    drawn = TouchSet("stream", 5, tuple(scenes))
    made = simulate(paper_skin(), adjacent(16), drawn, measurement=Measurement(snr_db=40.0))
    return made.quiet_v, made.frames_v


def options(**changes: object) -> Options:
    return replace(tracking(default_options(prebuilt()[0])), **changes)


def told(chosen: Options) -> list[tuple[Touch, ...]]:
    """Of each frame, by the C core in double."""
    quiet_v, frames_v = stream()
    made = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1], options=chosen)
    made.tare(quiet_v)
    return [made.reconstruct(frame).touches for frame in frames_v]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"track_confirm": 3, "track_hold": 0},
        {"track_smooth": 0.0},
        {"track_confirm": 0, "track_hold": 0, "track_smooth": 0.0},
        {"track_hold": 5, "follow_mm": 8.0},
    ],
    ids=str,
)
def test_the_core_follows_as_the_reference_does(changes):
    """What the core finds in each frame, followed by numpy, is what the core tells: ids, places,
    sizes, order, held ones."""
    quiet_v, frames_v = stream()
    chosen = options(**changes)
    bare = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1])
    plain = default_options(prebuilt()[0])
    bare.set_options(replace(plain, detection_factor=chosen.detection_factor))
    bare.tare(quiet_v)
    tracker, most = Tracker(prebuilt()[0].grid), 0
    for frame, expected in zip(frames_v, told(chosen), strict=True):
        result = bare.reconstruct(frame)
        seen = result.info.lambda_max, result.info.lambda_noise
        mine = tracker.step(result.touches, chosen, *seen)
        assert [touch.id for touch in mine] == [touch.id for touch in expected]
        for field in ("x_mm", "y_mm", "radius_mm", "strength_s_per_m_mm2", "explained"):
            known = [getattr(touch, field) for touch in expected]
            found = [getattr(touch, field) for touch in mine]
            assert found == pytest.approx(known, rel=1e-9, abs=1e-9), field
        most = max(most, *(touch.id for touch in expected), 0)
    assert most >= 3


def test_tracking_tells_fewer_false_touches_and_fewer_ids():
    """Of a detection threshold that lets noise pass, and without the test of touches, which does
    not."""
    low = {"detection_factor": 0.7, "touch_test": 0}
    bare = told(replace(default_options(prebuilt()[0]), **low))
    tracked = told(replace(options(), **low))
    ids = [len({touch.id for touches in some for touch in touches}) for some in (bare, tracked)]
    assert 3 <= ids[1] < ids[0]
    assert sum(map(len, tracked)) < sum(map(len, bare))


def test_what_a_board_sets_is_what_python_sets():
    """eits_options_track and ``tracking``: the same float32 numbers."""
    engine = CoreEngine(prebuilt()[1])
    ffi, lib = engine._ffi, engine._lib
    there = ffi.new("eits_options *")
    usual = default_options(prebuilt()[0])
    there.detection_factor = usual.detection_factor
    assert lib.eits_options_track(there) == 0
    here = tracking(usual)
    assert np.float32(here.detection_factor) == np.float32(there.detection_factor)
    assert np.float32(here.track_smooth) == np.float32(there.track_smooth)
    assert (here.track_confirm, here.track_hold) == (there.track_confirm, there.track_hold)
    assert here.tracks and not usual.tracks


def test_each_frame_by_itself_is_as_it_was():
    """Off by default: touches and places are those of a core that forgets before every frame."""
    quiet_v, frames_v = stream()
    made = [Reconstructor(prebuilt()[0], blob=prebuilt()[1]) for _ in range(2)]
    for one in made:
        one.tare(quiet_v)
    for frame in frames_v:
        made[1].forget()
        followed, fresh = (one.reconstruct(frame).touches for one in made)
        alike = [[replace(touch, id=0) for touch in some] for some in (followed, fresh)]
        assert alike[0] == alike[1]


def test_touches_stay_on_the_skin():
    """A finger that leaves at 20 mm a frame and is waited for does not go on beyond the rim."""
    grid: Grid = prebuilt()[0].grid
    tracker, chosen = Tracker(grid), options(track_hold=50)
    for k in range(5):
        touch = Touch(0, 20.0 * k - 20, 0.0, 8.0, 1.0, 0.5)
        tracker.step([touch], chosen, 10.0 if k < 4 else 1.2, 1.0)
    places = [tracker.step([], chosen, 0.0, 1.0) for _ in range(30)]
    assert all(len(one) == 1 and one[0].explained == 0 for one in places)
    assert 80 < places[-1][0].x_mm < 97 + 2 * grid.pixel_mm


def test_pairs_are_the_nearest_first():
    distance = np.array([[3.0, 1.0], [2.0, 1.5]])
    assert nearest_pairs(distance, 10.0) == [(0, 1), (1, 0)]
    assert nearest_pairs(distance, 1.2) == [(0, 1)]
    assert nearest_pairs(np.zeros((0, 2)), 1.0) == []
