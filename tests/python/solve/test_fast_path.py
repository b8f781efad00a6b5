"""The fast path on rows in time: the same decisions in both widths, and ids that are given once.
acceptance/test_scans_in_time.py has what it reports of touches, tests/c/test_fast.c its steps."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import FastCore, FastTouch
from eitskin.core.results import Reconstruction
from eitskin.model.eitm import encode_model
from eitskin.model.prebuilt import load_prebuilt
from scans_in_time import SCENES, Player, States, played, press

SEED, ELEMENTS = 5, 3500


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    counts = {"presses": 2, "pairs": 1, "swipes": 1}
    model = load_prebuilt()[0]
    return {kind: States(model, kind, n, SEED, ELEMENTS) for kind, n in counts.items()}


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
