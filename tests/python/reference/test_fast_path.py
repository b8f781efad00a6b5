"""The fast path's numpy reference on rows in time: touches land, move and lift within a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.model.prebuilt import load_prebuilt
from eitskin_studies.experiments import fast_path
from eitskin_studies.experiments.fast_path.scans import Outcome, Player
from eitskin_studies.experiments.fast_path.states import States, draw_states
from eitskin_studies.twins.fast.path import FastPath

SEED, ELEMENTS = 5, 3500


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    model = load_prebuilt()[0]
    return {
        kind: draw_states(model, kind, count, SEED, ELEMENTS)
        for kind, count in (("presses", 2), ("pairs", 1), ("swipes", 1))
    }


def played(make: Callable[..., Outcome], states: States, k: int, snr_db: float = 60.0) -> Outcome:
    rng = np.random.default_rng([SEED, k])
    sigma = float(np.sqrt(np.mean(states.v0[k] ** 2))) / 10 ** (snr_db / 20)
    player = Player(*load_prebuilt())
    player.tare(states.v0[k], sigma, rng)
    return make(player, states, k, rng, sigma)


SCENES: dict[str, tuple[str, Any, float, float]] = {
    "sudden press": ("presses", partial(fast_path._press, rise_s=0.0), 6, 3),
    "press in 60 ms": ("presses", partial(fast_path._press, rise_s=0.06), 20, 5),
    "two at once": ("pairs", partial(fast_path._pair), 25, 5),
    "one after another": ("pairs", partial(fast_path._pair, later_s=0.03), 8, 4),
    "swipe": ("swipes", partial(fast_path._swipe, speed_mm_per_s=600.0), 6, 4),
    "glitches": ("presses", partial(fast_path._fault, spoil=fast_path._glitches), 40, 5),
    "open electrode": ("presses", partial(fast_path._fault, spoil=fast_path._open), 100, 10),
    "noisy electrode": ("presses", partial(fast_path._fault, spoil=fast_path._noisy), 100, 5),
    "drift": ("presses", partial(fast_path._fault, spoil=fast_path._drift), 40, 5),
}


@pytest.mark.parametrize("name", SCENES)
def test_touches_are_told_soon_where_they_are_and_no_others(
    solved: dict[str, States], name: str
) -> None:
    kind, make, soon_ms, near_mm = SCENES[name]
    for k in range(len(solved[kind].places)):
        outcome = played(make, solved[kind], k)
        assert outcome.false == 0
        for first, errors in zip(outcome.first, outcome.errors, strict=True):
            assert first is not None
            assert 1e3 * first[0] < soon_ms and first[1] < near_mm
            assert np.median(errors) < 1.5


def test_quiet_frames_keep_their_bits_and_hold_no_touch(solved: dict[str, States]) -> None:
    quiet = partial(fast_path._fault, spoil=fast_path._nothing, press=False)
    outcome = played(quiet, solved["presses"], 0)
    assert outcome.false == 0 and not any(count for _, count in outcome.told)
    assert outcome.frames["same"] == outcome.frames["explained"] == outcome.frames["frames"] > 10


def test_a_press_that_lands_in_a_scan_spoils_only_that_frame(solved: dict[str, States]) -> None:
    outcome = played(partial(fast_path._press, rise_s=0.0), solved["presses"], 0)
    unexplained = outcome.frames["frames"] - outcome.frames["explained"]
    assert 1 <= unexplained <= 3 and outcome.frames["named"] == 0


def test_light_touches_come_from_whole_frames(solved: dict[str, States]) -> None:
    outcomes = [
        played(partial(fast_path._press, rise_s=0.0), solved["presses"], k, 40.0) for k in range(2)
    ]
    assert all(one.first[0] is not None and one.false == 0 for one in outcomes)


def test_a_model_without_fields_has_no_fast_path() -> None:
    with pytest.raises(UsageError, match="no fields"):
        FastPath(replace(load_prebuilt()[0], fields=None))
