"""The experiment on touches in time: its streams, its counting, and that it goes on where it was
stopped."""

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import tracking
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.tracking import measured, streams
from eitskin_studies.experiments.tracking.counted import TrackCount, count_stream, total
from eitskin_studies.experiments.tracking.streams import (
    FRAMES,
    GAP_MM,
    RATE_HZ,
    TouchStream,
    passing_streams,
    random_streams,
)
from study_pages import fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.fixture
def small(tmp_path, monkeypatch) -> Workspace:
    """Coarse meshes, one SNR, one speed."""
    monkeypatch.setattr(measured, "ELEMENTS", 1500)
    monkeypatch.setattr(streams.TouchStream.scene, "__defaults__", (1500,))
    monkeypatch.setattr(tracking, "SNRS_DB", (40,))
    monkeypatch.setattr(tracking, "SPEEDS_MM_S", (0, 50))
    return workspace(tmp_path / "out", 0.05)


def test_the_whole_and_again(small, tmp_path):
    outcome = tracking.run(small)
    assert {table.name for table in outcome.tables} == {"tracking", "parts", "choices", "passing"}
    assert len(outcome.tables[1].rows) == 8
    fills_its_page(outcome, "tracking", tmp_path)
    goes_on(lambda: tracking.run(workspace(small.folder, 0.05)), outcome)


def test_streams_are_those_of_their_seed_and_fingers_stay_apart():
    outline = paper_skin().outline
    drawn = random_streams(outline, 3, "test", 200, 6)
    again = random_streams(outline, 3, "test", 200, 2)
    assert [one.facts() for one in drawn[:2]] == [one.facts() for one in again]
    assert drawn[0].facts() != random_streams(outline, 4, "test", 200, 1)[0].facts()
    for one in drawn:
        for frame in range(FRAMES):
            _, places, radii = one.true_mm(frame)
            assert (np.hypot(*places.T) + radii <= 97.0 - 3.99).all()
            for k, (place, radius) in enumerate(zip(places, radii, strict=True)):
                for other, further in zip(places[:k], radii[:k], strict=True):
                    assert np.hypot(*(place - other)) - radius - further >= GAP_MM - 1e-9
        for finger in one.samples:
            both = finger.there[1:] & finger.there[:-1]
            step = np.hypot(np.diff(finger.x_mm), np.diff(finger.y_mm))[both]
            assert (step <= 200 / RATE_HZ + 1e-9).all() and np.median(step) > 0.9 * 200 / RATE_HZ
            there = finger.contrast[finger.there]
            assert there.max() > 1.1 * there[0] > 1  # it lands lightly


def test_fingers_that_pass_come_near():
    for one in passing_streams(1, 50, 3):
        nearest = min(
            np.hypot(*np.diff(one.true_mm(k)[1], axis=0)[0]) - one.true_mm(k)[2].sum()
            for k in range(FRAMES)
        )
        assert 4.9 < nearest < 6.0


def finger(start: int, end: int, x_mm: float) -> TouchTrack:
    return TouchTrack((Keyframe(start / RATE_HZ, x_mm, 0, 8), Keyframe(end / RATE_HZ, x_mm, 0, 8)))


def at(number: int, x_mm: float) -> Touch:
    return Touch(number, x_mm, 0.0, 8.0, 1.0, 0.5)


def test_what_is_counted():
    """Two fingers, at 0 mm in frames 2 to 9 and at 60 mm in frames 4 to 9; twelve frames are
    reported."""
    stream = TouchStream("two", 0, (finger(2, 9, 0.0), finger(4, 9, 60.0)))
    reported: list[tuple[Touch, ...]] = [()] * 12
    reported[1] = (at(1, 0.0),)  # false: nobody is there yet
    for k in range(3, 10):
        reported[k] = (at(2, 1.0),)
    reported[6] = (at(3, 1.0),)  # a switch there, and one back
    reported[5] += (at(9, -80.0),)
    reported[10] = (at(2, 1.0),)  # a ghost
    reported[8] += (at(4, 60.0),)
    count = count_stream(stream, reported, 120)
    found = count.frames, count.true, count.missed, count.false_touches, count.switches
    assert found == (12, 14, 6, 3, 2)
    assert count.exact == 4  # frames 0, 3, 8, 11
    assert (count.late, count.ghost, count.fingers, count.never) == ([1, 4], [1, 0], 2, 0)
    assert count.mota == pytest.approx(1 - 11 / 14) and sorted(count.errors_mm) == [0.0] + 7 * [1.0]
    both = total([count, count])
    assert (both.frames, both.macs, len(both.errors_mm)) == (24, 240, 16)
    assert count_stream(stream, [()] * 12, 0).never == 2 and TrackCount(**count.as_dict()) == count


def test_an_id_that_goes_on_as_another_finger_is_no_ghost():
    stream = TouchStream("handed on", 0, (finger(0, 4, 0.0), finger(5, 9, 20.0)))
    reported = [(at(1, 0.0),)] * 5 + [(at(1, 20.0),)] * 5
    assert count_stream(stream, reported, 0).ghost == [0, 0]


def test_the_best_pairs_may_not_be_the_nearest():
    distance = np.array([[1.0, 3.0], [2.0, 9.0]])
    assert measured.best_pairs(distance, 10.0) == [(0, 1), (1, 0)]
    assert measured.nearest_pairs(distance, 10.0) == [(0, 0), (1, 1)]
    assert measured.best_pairs(distance, 2.5) == [(0, 0)]
    assert measured.best_pairs(np.zeros((0, 2)), 1.0) == []
