"""The tracker in streams of moving fingers: a finger keeps its id, none is reported that is not
there, time and what went before change nothing. tests/c/test_tracking.c has its single steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.core.results import Options
from eitskin.model.options import default_options, tracking
from eitskin.scene.random_touches import TouchScene, TouchSet
from eitskin.scene.random_touches import TrueTouch as Put
from eitskin.scene.simulate import Measurement, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

FRAMES = 24


@cache
def stream() -> tuple[np.ndarray, np.ndarray]:
    """Untouched frames and a stream at 40 dB: a finger that stays, one that moves and is lifted,
    one that comes."""
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
    return made.untouched_v, made.frames_v


def options(**changes: object) -> Options:
    return replace(tracking(default_options(prebuilt()[0])), **changes)


def reported(chosen: Options) -> list[tuple[Touch, ...]]:
    """Of each frame, by the C core in double."""
    untouched_v, frames_v = stream()
    made = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1], options=chosen)
    made.tare(untouched_v)
    return [made.reconstruct(frame).touches for frame in frames_v]


WAYS = [
    {},
    {"track_confirm": 3, "track_hold": 0},
    {"track_smooth": 0.0},
    {"track_confirm": 0, "track_hold": 0, "track_smooth": 0.0},
    {"track_hold": 5, "follow_mm": 8.0},
]


def fingers(k: int) -> dict[str, tuple[float, float]]:
    """Where each finger of ``stream`` is in frame k, by name."""
    there = {"stays": (-40.0, 10.0)}
    if k < 16:
        there["leaves"] = (-10.0 + 3 * k, -45.0)
    if k >= 8:
        there["comes"] = (30.0, 60.0 - k)
    return there


@pytest.mark.parametrize("changes", WAYS, ids=str)
def test_a_finger_keeps_its_id(changes):
    """From its first report to its last, within 6 mm, the strongest first, and no id for two; a
    finger is reported once it was found as often as asked, and not after the hold."""
    chosen = options(**changes)
    owner: dict[int, str] = {}
    first: dict[str, int] = {}
    for k, touches in enumerate(reported(chosen)):
        strengths = [touch.strength_s_per_m_mm2 for touch in touches]
        assert strengths == sorted(strengths, reverse=True)
        assert len({touch.id for touch in touches}) == len(touches)
        lately = {**fingers(max(0, k - chosen.track_hold)), **fingers(k)}
        for touch in touches:
            near = min(lately, key=lambda n: np.hypot(*np.subtract(lately[n], place(touch))))
            assert np.hypot(*np.subtract(lately[near], place(touch))) < 6 + 3 * chosen.track_hold
            assert owner.setdefault(touch.id, near) == near
            first.setdefault(near, k)
    names = sorted(owner.values())
    assert sorted(set(names)) == ["comes", "leaves", "stays"]
    assert names == sorted(set(names)) or chosen.follow_mm < 10 or not chosen.tracks
    waits = max(0, chosen.track_confirm - 1)
    assert all(
        0 <= first[name] - begins <= waits + 1 for name, begins in (("stays", 0), ("comes", 8))
    )


def place(touch: Touch) -> tuple[float, float]:
    return touch.x_mm, touch.y_mm


def test_what_went_before_changes_nothing():
    """An untouched skin before the stream: no report, then the same ids and places."""
    untouched_v, frames_v = stream()
    made = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1], options=options())
    made.tare(untouched_v)
    assert not any(made.reconstruct(frame).touches for frame in untouched_v[:12])
    after = [made.reconstruct(frame).touches for frame in frames_v]
    assert after == reported(options())


def test_tracking_tells_fewer_false_touches_and_fewer_ids():
    """Of a detection threshold that lets noise pass, and without the test of touches, which does
    not."""
    low = {"detection_factor": 0.7, "touch_test": 0}
    bare = reported(replace(default_options(prebuilt()[0]), **low))
    tracked = reported(replace(options(), **low))
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
    untouched_v, frames_v = stream()
    made = [Reconstructor(prebuilt()[0], blob=prebuilt()[1]) for _ in range(2)]
    for one in made:
        one.tare(untouched_v)
    for frame in frames_v:
        made[1].forget()
        followed, fresh = (one.reconstruct(frame).touches for one in made)
        alike = [[replace(touch, id=0) for touch in some] for some in (followed, fresh)]
        assert alike[0] == alike[1]
