"""The fast path on rows in time: touches that land, move and lift within a scan are reported soon,
where they are, and no others."""

from functools import partial

import numpy as np
import pytest

import scans_in_time
from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore
from eitskin.errors import FrameError
from eitskin.model.prebuilt import load_prebuilt
from scans_in_time import SCENES, Outcome, Player, Scene, States, fault, press

SEED, ELEMENTS = 5, 3500


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    model = load_prebuilt()[0]
    counts = {"presses": 2, "pairs": 1, "swipes": 1}
    return {kind: States(model, kind, n, SEED, ELEMENTS) for kind, n in counts.items()}


def played(scene: Scene, states: States, k: int, snr_db: float = 60.0) -> Outcome:
    return scans_in_time.played(scene, states, k, Player(*load_prebuilt()), SEED, snr_db)


BOUNDS = {  # of the first report: ms after contact, and mm from where the finger is then
    "sudden press": (6, 3),
    "press in 60 ms": (10, 5),
    "two at once": (25, 5),
    "one after another": (8, 4),
    "and slowly": (15, 6),
    "swipe": (6, 4),
    "glitches": (40, 5),
    "open electrode": (100, 10),
    "noisy electrode": (100, 5),
    "drift": (40, 5),
}


@pytest.mark.parametrize("name", SCENES)
def test_touches_are_reported_soon_where_they_are_and_no_others(solved, name):
    (kind, scene), (soon_ms, near_mm) = SCENES[name], BOUNDS[name]
    for k in range(len(solved[kind].places)):
        outcome = played(scene, solved[kind], k)
        assert outcome.false == 0
        for first, errors in zip(outcome.first, outcome.errors, strict=True):
            assert first is not None
            assert 1e3 * first[0] < soon_ms and first[1] < near_mm
            assert np.median(errors) < 1.5


def test_untouched_frames_keep_their_bits_and_hold_no_touch(solved):
    untouched = partial(fault, spoil=scans_in_time.nothing, pressed=False)
    outcome = played(untouched, solved["presses"], 0)
    assert outcome.false == 0 and not any(outcome.reported)
    assert outcome.frames["same"] == outcome.frames["explained"] == outcome.frames["frames"] > 10


def test_a_press_that_lands_in_a_scan_spoils_only_that_frame(solved):
    outcome = played(partial(press, rise_s=0.0), solved["presses"], 0)
    unexplained = outcome.frames["frames"] - outcome.frames["explained"]
    assert 1 <= unexplained <= 3 and outcome.frames["named"] == 0


def test_light_touches_come_from_whole_frames(solved):
    sudden = partial(press, rise_s=0.0)
    outcomes = [played(sudden, solved["presses"], k, 40.0) for k in range(2)]
    assert all(one.first[0] is not None and one.false == 0 for one in outcomes)


def test_what_is_not_a_drive_is_refused():
    engine = CoreEngine(load_prebuilt()[1])
    fast = FastCore(engine)
    with pytest.raises(FrameError, match="no reference"):
        fast.begin()
    noise = 1e-6 * np.random.default_rng(1).standard_normal((8, engine.n_rows))
    engine.set_reference(load_prebuilt()[0].golden.reference_v + noise)
    fast.begin()
    for call in (
        lambda: fast.drive(0, np.zeros(12), 0.0),
        lambda: fast.drive(16, np.zeros(13), 0.0),
        lambda: fast.aligned(np.zeros(7)),
    ):
        with pytest.raises(FrameError, match="fast path"):
            call()
