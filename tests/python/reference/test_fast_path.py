"""The fast path on rows in time, C against numpy; acceptance/test_scans_in_time.py has what it
reports of touches."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import AlignedFrame, FastCore, FastTouch
from eitskin.core.results import Info, Reconstruction
from eitskin.errors import UsageError
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin_reference.fast.path import FastPath
from eitskin_reference.row_gains import row_gains
from scans_in_time import SCENES, Player, States, played, press

SEED, ELEMENTS = 5, 3500


@cache
def uncorrected() -> Model:
    """The prebuilt model, whose fast path reports where its own skin has touches, as the twin does:
    tests/c/test_fast.c has what the reference makes of places."""
    model = load_prebuilt()[0]
    assert model.model_errors is not None
    return replace(model, model_errors=replace(model.model_errors, places=None))


@pytest.fixture(scope="module")
def solved() -> dict[str, States]:
    counts = {"presses": 2, "pairs": 1, "swipes": 1}
    return {kind: States(uncorrected(), kind, n, SEED, ELEMENTS) for kind, n in counts.items()}


class Twins(Player):
    """C and numpy side by side."""

    def tare(self, v0: np.ndarray, sigma: float, rng: np.random.Generator) -> None:
        super().tare(v0, sigma, rng)
        lib, ffi, _, context = self.engine.handles
        learned = ffi.new("eits_reference_info *")
        lib.eits_get_reference(context, learned)
        v0 = np.array(ffi.unpack(learned.v0, len(v0)))
        gains = row_gains(self.model, np.isfinite(v0), learned.gain * v0)[0]
        self.path, self.off_mm = FastPath(self.model), 0.0
        self.path.tare(v0, learned.noise_v, learned.gain * gains)

    def both(self, c: list[FastTouch], numpy: list[FastTouch]) -> list[FastTouch]:
        if self.engine.dtype == np.float64:
            assert c == numpy
        assert [(one.id, one.confirmed) for one in c] == [(one.id, one.confirmed) for one in numpy]
        for one, other in zip(c, numpy, strict=True):
            off = np.hypot(one.x_mm - other.x_mm, one.y_mm - other.y_mm)
            self.off_mm = max(self.off_mm, float(off))
        return c

    def drive(self, number: int, volts: np.ndarray, time_s: float) -> list[FastTouch]:
        drive = number, volts, time_s
        return self.both(super().drive(*drive), self.path.drive(*drive))

    def aligned(self, frame: np.ndarray) -> AlignedFrame:
        c, numpy = super().aligned(frame), self.path.aligned(frame)
        assert (c.explained, c.trusted) == (numpy.explained, numpy.trusted)
        assert self.engine.dtype == np.float32 or c.volts.tobytes() == numpy.volts.tobytes()
        return c

    def named(self, found: Info) -> Info:
        c = super().named(found)
        assert c.diagnostics == self.path.named(found.diagnostics)
        return c

    def confirm(self, found: Reconstruction) -> list[FastTouch]:
        info = found.info
        named = (*info.open_electrodes, *info.bridged_electrodes, *info.noisy_electrodes)
        return self.both(super().confirm(found), self.path.confirm(found.touches, named))


@pytest.mark.parametrize("name", [*SCENES, "light press"])
def test_numpy_has_the_cores_bits_in_double_and_its_decisions_in_single_width(solved, name):
    """In single width places are within .1 mm, with faults that frames have yet to name 1 mm."""
    kind, scene = SCENES.get(name, ("presses", partial(press, rise_s=0.0)))
    for width in ("float64", "float32"):
        twins = Twins(uncorrected(), encode_model(uncorrected()), width)
        played(scene, solved[kind], 0, twins, SEED, 60.0 if name in SCENES else 40.0)
        assert twins.off_mm < (1 if "electrode" in name else 0.1)


def test_a_model_without_fields_has_no_fast_path():
    model = replace(load_prebuilt()[0], fields=None)
    with pytest.raises(UsageError, match="no fields"):
        FastPath(model)
    with pytest.raises(UsageError, match="no fields"):
        FastCore(CoreEngine(encode_model(model)))
