"""Touches followed from frame to frame in streams of moving fingers: a finger keeps its id, and
what went before changes nothing. tests/c/test_fast_report.c has the single steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.core.results import Options
from eitskin.errors import FrameError
from eitskin.model.model import Model
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


def made(chosen: Options, model: Model | None = None, engine: str = "c64") -> Reconstructor:
    """A reconstructor whose reference is that of ``stream``."""
    if model is None:
        made = Reconstructor(prebuilt()[0], engine=engine, blob=prebuilt()[1], options=chosen)
    else:
        made = Reconstructor(model, engine=engine, options=chosen)
    made.tare(stream()[0])
    return made


def reported(chosen: Options, model: Model | None = None) -> list[tuple[Touch, ...]]:
    """Return the touches of each frame, by the C core in double."""
    return [one.touches for one in made(chosen, model).stream(stream()[1])]


def fingers(k: int) -> dict[str, tuple[float, float]]:
    """Return the place of each finger of ``stream`` in frame k, by name."""
    there = {"stays": (-40.0, 10.0)}
    if k < 16:
        there["leaves"] = (-10.0 + 3 * k, -45.0)
    if k >= 8:
        there["comes"] = (30.0, 60.0 - k)
    return there


@pytest.mark.parametrize("fields", [True, False], ids=["fields", "no-fields"])
def test_a_finger_keeps_its_id(fields):
    """From its first report to its last, within 6 mm of its place, the strongest first, and no id
    for two; its second report is confirmed. The same with a model whose drives cannot be
    followed."""
    owner: dict[int, str] = {}
    first: dict[str, int] = {}
    model = None if fields else replace(prebuilt()[0], fields=None)
    for k, touches in enumerate(reported(options(), model)):
        strengths = [touch.strength_s_per_m_mm2 for touch in touches]
        assert strengths == sorted(strengths, reverse=True)
        assert len({touch.id for touch in touches}) == len(touches)
        lately = {**fingers(max(0, k - 2)), **fingers(k)}
        for touch in touches:
            near = min(lately, key=lambda n: np.hypot(*np.subtract(lately[n], place(touch))))
            assert np.hypot(*np.subtract(lately[near], place(touch))) < 12
            assert touch.confirmed or near not in first
            assert owner.setdefault(touch.id, near) == near
            first.setdefault(near, k)
    assert sorted(owner.values()) == ["comes", "leaves", "stays"]
    assert 0 <= first["stays"] <= 1 and 8 <= first["comes"] <= 9


def place(touch: Touch) -> tuple[float, float]:
    return touch.x_mm, touch.y_mm


def test_places_are_those_of_each_frame():
    """A touch that was found is reported as in the frame by itself, except for its id and its
    confirmation."""
    core, alone = made(options()), made(options())
    for frame in stream()[1]:
        shown, found = core.follow(frame), alone.reconstruct(frame)
        bare = [replace(touch, id=0, confirmed=False) for touch in found.touches]
        assert [touch.id for touch in found.touches] == [*range(1, 1 + len(found.touches))]
        for touch in shown.touches:
            assert touch.explained == 0 or replace(touch, id=0, confirmed=False) in bare
        assert shown.info.touches == len(shown.touches)


def test_what_went_before_changes_nothing():
    """An untouched skin before the stream: no report, then the same touches. Forgetting leaves the
    ids counting on."""
    core = made(options())
    assert not any(one.touches for one in core.stream(stream()[0][:12]))
    assert [one.touches for one in core.stream(stream()[1])] == reported(options())
    last = max(touch.id for touch in core.follow(stream()[1][-1]).touches)
    core.forget()
    assert all(touch.id > last for touch in core.follow(stream()[1][-1]).touches)


def test_fewer_false_touches_are_reported():
    """With a detection threshold that lets noise pass, and without the test of touches, which does
    not: noise is not found twice in one place."""
    low = options(detection_factor=0.7, touch_test=0)
    core = made(low)
    bare = [core.reconstruct(frame).touches for frame in stream()[1]]
    assert sum(map(len, reported(low))) < sum(map(len, bare))


def test_what_a_board_sets_is_what_python_sets():
    """eits_options_track and ``tracking``: the same float32 number."""
    engine = CoreEngine(prebuilt()[1])
    ffi, lib = engine._ffi, engine._lib
    there = ffi.new("eits_options *")
    usual = default_options(prebuilt()[0])
    there.detection_factor = usual.detection_factor
    assert lib.eits_options_track(there) == 0
    assert np.float32(tracking(usual).detection_factor) == np.float32(there.detection_factor)


def test_numpy_follows_nothing():
    core = made(default_options(prebuilt()[0]), engine="numpy")
    (one,) = core.stream(stream()[1][-1:])
    assert [touch.id for touch in one.touches] == [*range(1, 1 + len(one.touches))] != []


def test_times_of_rows_follow_touches_through_the_scan():
    """A touch that lands while a frame is scanned: by itself the frame has it elsewhere, or names
    faults; with the times of its rows it is not solved, and no later frame shows the touch anywhere
    else. The ids are those of drives."""
    untouched_v, frames_v = stream()
    before, after = untouched_v[0], frames_v[-1]
    landing = before.copy()
    landing[100:] = after[100:]  # rows are scanned in their order
    times = np.arange(len(landing)) * 1e-4
    core = made(options())
    shown = [
        core.follow(frame, times + 0.0208 * k)
        for k, frame in enumerate([before] * 3 + [landing] + [after] * 6)
    ]
    assert not any(one.touches for one in shown[:3])
    assert shown[3].info.found == ()
    places = [place(touch) for touch in shown[-1].touches]
    assert len(places) == 2 and all(touch.confirmed for touch in shown[-1].touches)
    for one in shown[3:]:
        for touch in one.touches:
            assert min(np.hypot(*np.subtract(place(touch), true)) for true in places) < 6
    assert min(touch.id for touch in shown[-1].touches) < 10


@pytest.mark.parametrize(("x_mm", "y_mm"), [(-28.0, 15.0), (37.0, -10.0), (0.0, 0.0)])
def test_a_palm_that_lands_in_a_scan_is_shown_as_the_frame_has_it(x_mm, y_mm):
    """Drives follow it as a finger first. From frames the tracker learns that it is wide. Before,
    Python did not pass on radii, and frames had the palm up to 8 mm off, as a finger, for good."""
    palm = TouchSet("palm", 5, (TouchScene("0", (Put(x_mm, y_mm, 22.0, 2.0),)),))
    here = simulate(paper_skin(), adjacent(16), palm, measurement=Measurement(snr_db=60.0))
    core = Reconstructor(prebuilt()[0], engine="c64", blob=prebuilt()[1], options=options())
    core.tare(here.untouched_v)
    before, after = here.untouched_v[0], here.frames_v[0]
    landing = np.where(np.arange(len(after)) < 100, before, after)
    times = np.arange(len(landing)) * 1e-4
    frames = [before] * 3 + [landing] + [after] * 11
    shown = [core.follow(one, times + 0.0208 * k).touches for k, one in enumerate(frames)]
    for (touch,) in shown[-4:]:
        assert np.hypot(touch.x_mm - x_mm, touch.y_mm - y_mm) < 1
        assert touch.radius_mm is not None and abs(touch.radius_mm - 22.0) < 1


@pytest.mark.parametrize("fields", [True, False], ids=["one-tare-frame", "no-fields"])
def test_times_of_rows_need_fields_and_noise(fields):
    """Without them frames are followed as they are."""
    frame, times = stream()[1][-1], np.arange(208) * 1e-4
    model = None if fields else replace(prebuilt()[0], fields=None)
    timed, alone = made(options(), model), made(options(), model)
    if fields:
        timed.tare(stream()[0][0])
        alone.tare(stream()[0][0])
    for _ in range(2):
        assert timed.follow(frame, times).touches == alone.follow(frame).touches


def test_wrong_times_of_rows_are_refused():
    with pytest.raises(FrameError, match="frame, times: of shape"):
        made(options()).follow(stream()[1][-1][:-1], np.arange(207))
