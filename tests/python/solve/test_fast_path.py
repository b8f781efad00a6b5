"""The fast path on rows in time: the same decisions in both widths, and ids that are given once.
acceptance/test_scans_in_time.py has what it reports of touches, tests/c/test_fast.c its steps."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore, FastTouch
from eitskin.core.results import Reconstruction
from eitskin.model.eitm import encode_model
from eitskin.model.prebuilt import load_prebuilt
from scans_in_time import SCENES, Player, States, TrueInTime, played, press, scan_of

SEED, ELEMENTS = 5, 3500


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    counts = {"presses": 2, "pairs": 1, "swipes": 1}
    model = load_prebuilt()[0]
    return {kind: States(model, kind, n, SEED, ELEMENTS) for kind, n in counts.items()}


class Recorder(Player):
    """Keeps what is reported after each drive and each frame."""

    def tare(self, v0: np.ndarray, sigma: float, rng: np.random.Generator) -> None:
        super().tare(v0, sigma, rng)
        self.reports: list[list[FastTouch]] = []

    def drive(self, number: int, volts: np.ndarray, time_s: float) -> list[FastTouch]:
        self.reports.append(super().drive(number, volts, time_s))
        return self.reports[-1]

    def confirm(self, found: Reconstruction) -> list[FastTouch]:
        self.reports.append(super().confirm(found))
        return self.reports[-1]


@pytest.mark.parametrize("name", [*SCENES, "light press"])
def test_single_width_decides_as_double_does(solved, name):
    """Places are within .1 mm, with faults that frames have yet to name 1 mm; and an id is never
    given twice, nor taken up again once its touch was gone. Beside an open electrode a frame agrees
    in one width only, so that a touch is confirmed a frame later, which is 17 reports, in the
    other."""
    kind, scene = SCENES.get(name, ("presses", partial(press, rise_s=0.0)))
    wide, narrow = (Recorder(*load_prebuilt(), width) for width in ("float64", "float32"))
    for player in (wide, narrow):
        played(scene, solved[kind], 0, player, SEED, 60.0 if name in SCENES else 40.0)
    assert len(wide.reports) == len(narrow.reports)
    before, gone, unlike = set[int](), set[int](), 0
    for here, there in zip(wide.reports, narrow.reports, strict=True):
        assert [t.id for t in here] == [t.id for t in there]
        unlike += [t.confirmed for t in here] != [t.confirmed for t in there]
        for one, other in zip(here, there, strict=True):
            off = np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm)
            assert off < (1 if "electrode" in name else 0.1)
        now = {t.id for t in here}
        assert len(now) == len(here) and not now & gone
        gone |= before - now
        before = now
    assert unlike <= (17 if name == "open electrode" else 0)


def test_a_model_without_fields_has_no_drives():
    """Its touches are followed from frame to frame (test_tracking.py)."""
    model = replace(load_prebuilt()[0], fields=None)
    assert FastCore(CoreEngine(encode_model(model))).rows == []


def _false(states: States, paths: list[list[tuple[float, ...]]]) -> tuple[int, set[int]]:
    """The false touches and the ids of a scene of ``paths`` of (s, mm, mm, press). A finger has
    lifted when its press falls below a tenth."""
    player, rng = Recorder(*load_prebuilt()), np.random.default_rng(SEED)
    sigma = float(np.sqrt(np.mean(states.v0[0] ** 2))) / 1e3
    player.tare(states.v0[0], sigma, rng)
    scan = scan_of(player.fast, max(path[-1][0] for path in paths) + 0.02)
    volts = states.volts(0, paths, scan.frames)
    truth = []
    for path in paths:
        lifted = [t for t, _, _, level in path[1:] if level < 0.1]
        truth.append(TrueInTime(path[0][0], [*lifted, path[-1][0]][0], _follows(np.array(path))))
    out = player.play(scan, volts + sigma * rng.standard_normal(len(volts)), truth)
    return out.false, {t.id for report in player.reports for t in report}


def _follows(keys: np.ndarray) -> Callable[[float], np.ndarray]:
    return lambda t: np.array([np.interp(t, keys[:, 0], keys[:, i]) for i in (1, 2)])


def test_what_the_skin_keeps_of_a_lifted_touch_is_not_a_new_touch(solved):
    """A tenth of the signal stays and fades in 0.3 s. A finger that lands there afterwards is
    another touch."""
    at = (60.0, 20.0)
    times = (0.05, 0.08, 0.3, 0.33, 0.6, 0.63, 0.75)
    levels = (0.0, 1.0, 1.0, 0.04, 0.0, 1.0, 1.0)
    path = [(t, *at, level) for t, level in zip(times, levels, strict=True)]
    lifted = path[:5]
    assert _false(solved["presses"], [lifted]) == (0, {1})
    assert _false(solved["presses"], [path])[1] == {1, 2}


def test_two_fingers_that_cross_stay_two(solved):
    """They pass each other 21 mm apart at 300 mm/s, the second a tenth of a second later."""
    paths = []
    for late_s, here, there in (
        (0.0, (6.1, 8.5), (-17.9, -46.5)),
        (0.1, (-33.4, -7.0), (21.5, -31.0)),
    ):
        times = (0.07 + late_s, 0.11 + late_s, 0.31 + late_s, 0.35 + late_s)
        places = (here, here, there, there)
        paths.append([(t, *at, 1.0) for t, at in zip(times, places, strict=True)])
    assert _false(solved["presses"], paths) == (0, {1, 2})


def test_a_finger_that_swipes_is_not_left_behind(solved):
    """It stays 40 ms where it lands, then goes off at 1 m/s at once. At most 5 reports, of 6 ms,
    have it elsewhere."""
    times = (0.0569, 0.0969, 0.1846)
    places = ((-39.0, 16.0), (-39.0, 16.0), (35.0, -31.0))
    path = [(t, *at, 1.0) for t, at in zip(times, places, strict=True)]
    false, ids = _false(solved["presses"], [path])
    assert false <= 5 and ids == {1}
