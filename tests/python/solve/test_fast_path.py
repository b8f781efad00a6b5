"""The fast path on rows in time: touches land, move and lift within a scan, and are reported soon,
where they are, and no others; with the same decisions in both widths."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore, FastTouch
from eitskin.core.results import Reconstruction
from eitskin.errors import FrameError, UsageError
from eitskin.model.eitm import encode_model
from eitskin.model.prebuilt import load_prebuilt
from eitskin_studies.experiments import fast_path
from eitskin_studies.experiments.fast_path.scans import Outcome, Player
from eitskin_studies.experiments.fast_path.states import States, draw_states

SEED, ELEMENTS = 5, 3500


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    model = load_prebuilt()[0]
    return {
        kind: draw_states(model, kind, count, SEED, ELEMENTS)
        for kind, count in (("presses", 2), ("pairs", 1), ("swipes", 1))
    }


class Recorder(Player):
    """What is reported after each drive and each frame."""

    def tare(self, v0: np.ndarray, sigma: float, rng: np.random.Generator) -> None:
        super().tare(v0, sigma, rng)
        self.reports: list[list[FastTouch]] = []

    def drive(self, number: int, volts: np.ndarray, time_s: float) -> list[FastTouch]:
        self.reports.append(super().drive(number, volts, time_s))
        return self.reports[-1]

    def confirm(self, found: Reconstruction) -> list[FastTouch]:
        self.reports.append(super().confirm(found))
        return self.reports[-1]


def played(
    make: Callable[..., Outcome],
    states: States,
    k: int,
    snr_db: float = 60.0,
    player: Player | None = None,
) -> Outcome:
    rng = np.random.default_rng([SEED, k])
    sigma = float(np.sqrt(np.mean(states.v0[k] ** 2))) / 10 ** (snr_db / 20)
    player = player or Player(*load_prebuilt())
    player.tare(states.v0[k], sigma, rng)
    return make(player, states, k, rng, sigma)


SCENES: dict[str, tuple[str, Any, float, float]] = {
    "sudden press": ("presses", partial(fast_path._press, rise_s=0.0), 6, 3),
    "press in 60 ms": ("presses", partial(fast_path._press, rise_s=0.06), 10, 5),
    "two at once": ("pairs", partial(fast_path._pair), 25, 5),
    "one after another": ("pairs", partial(fast_path._pair, later_s=0.03), 8, 4),
    "and slowly": ("pairs", partial(fast_path._pair, rise_s=0.06, later_s=0.06), 15, 6),
    "swipe": ("swipes", partial(fast_path._swipe, speed_mm_per_s=600.0), 6, 4),
    "glitches": ("presses", partial(fast_path._fault, spoil=fast_path._glitches), 40, 5),
    "open electrode": ("presses", partial(fast_path._fault, spoil=fast_path._open), 100, 10),
    "noisy electrode": ("presses", partial(fast_path._fault, spoil=fast_path._noisy), 100, 5),
    "drift": ("presses", partial(fast_path._fault, spoil=fast_path._drift), 40, 5),
}


@pytest.mark.parametrize("name", SCENES)
def test_touches_are_told_soon_where_they_are_and_no_others(solved, name):
    kind, make, soon_ms, near_mm = SCENES[name]
    for k in range(len(solved[kind].places)):
        outcome = played(make, solved[kind], k)
        assert outcome.false == 0
        for first, errors in zip(outcome.first, outcome.errors, strict=True):
            assert first is not None
            assert 1e3 * first[0] < soon_ms and first[1] < near_mm
            assert np.median(errors) < 1.5


@pytest.mark.parametrize("name", [*SCENES, "light press"])
def test_single_width_decides_as_double_does(solved, name):
    """Places are within .1 mm, with faults that frames have yet to name 1 mm; and an id is never
    given twice, nor taken up again once its touch was gone."""
    kind, make = SCENES[name][:2] if name in SCENES else ("presses", SCENES["sudden press"][1])
    wide, narrow = (Recorder(*load_prebuilt(), width) for width in ("float64", "float32"))
    for player in (wide, narrow):
        played(make, solved[kind], 0, 60.0 if name in SCENES else 40.0, player)
    assert len(wide.reports) == len(narrow.reports)
    before, gone = set[int](), set[int]()
    for here, there in zip(wide.reports, narrow.reports, strict=True):
        assert [(t.id, t.confirmed) for t in here] == [(t.id, t.confirmed) for t in there]
        for one, other in zip(here, there, strict=True):
            off = np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm)
            assert off < (1 if "electrode" in name else 0.1)
        now = {t.id for t in here}
        assert len(now) == len(here) and not now & gone
        gone |= before - now
        before = now


def test_quiet_frames_keep_their_bits_and_hold_no_touch(solved):
    quiet = partial(fast_path._fault, spoil=fast_path._nothing, press=False)
    outcome = played(quiet, solved["presses"], 0)
    assert outcome.false == 0 and not any(count for _, count in outcome.told)
    assert outcome.frames["same"] == outcome.frames["explained"] == outcome.frames["frames"] > 10


def test_a_press_that_lands_in_a_scan_spoils_only_that_frame(solved):
    outcome = played(partial(fast_path._press, rise_s=0.0), solved["presses"], 0)
    unexplained = outcome.frames["frames"] - outcome.frames["explained"]
    assert 1 <= unexplained <= 3 and outcome.frames["named"] == 0


def test_light_touches_come_from_whole_frames(solved):
    press = partial(fast_path._press, rise_s=0.0)
    outcomes = [played(press, solved["presses"], k, 40.0) for k in range(2)]
    assert all(one.first[0] is not None and one.false == 0 for one in outcomes)


def test_a_model_without_fields_has_no_fast_path():
    model = replace(load_prebuilt()[0], fields=None)
    with pytest.raises(UsageError, match="no fields"):
        FastCore(CoreEngine(encode_model(model)))


def test_what_is_not_a_drive_is_refused():
    engine = CoreEngine(load_prebuilt()[1])
    fast = FastCore(engine)
    with pytest.raises(FrameError, match="no reference"):
        fast.begin()
    noise = 1e-6 * np.random.default_rng(1).standard_normal((8, engine.n_rows))
    quiet = load_prebuilt()[0].golden.reference_v + noise
    engine.set_reference(quiet)
    fast.begin()
    for call in (
        lambda: fast.drive(0, np.zeros(12), 0.0),
        lambda: fast.drive(16, np.zeros(13), 0.0),
        lambda: fast.aligned(np.zeros(7)),
    ):
        with pytest.raises(FrameError, match="fast path"):
            call()
