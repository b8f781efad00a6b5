"""A reference is not taken while something lands, moves or lifts on the skin; noise, drift of the
gain and single bad readings do not prevent it."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.core.results import Options
from eitskin.errors import FrameError
from eitskin.model.options import default_options
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

COUNTS = (4, 5, 16, 64)


def untouched(count: int, snr_db: float, seed: int) -> FloatArray:
    golden = prebuilt()[0].golden
    v0 = np.asarray(golden.reference_v, dtype=np.float64)
    sigma = np.sqrt(np.mean(v0**2)) * 10 ** (-snr_db / 20)
    noise = np.random.default_rng([seed, count]).standard_normal((count, len(v0)))
    return np.asarray(v0 + sigma * noise)


def change() -> FloatArray:
    """Return the change that the touches of the model's golden frame cause."""
    golden = prebuilt()[0].golden
    return np.asarray(golden.frame_v, dtype=np.float64) - np.asarray(golden.reference_v)


def skin(engine: str = "c", options: Options | None = None) -> Reconstructor:
    return Reconstructor(prebuilt()[0], engine=engine, options=options)


PRESENCE = {
    "lands": lambda t: t >= 0.5,
    "lifts": lambda t: t < 0.5,
    "taps": lambda t: (t >= 0.25) & (t < 0.75),
    "is pressed harder and harder": lambda t: t,
}


@pytest.mark.parametrize("engine", ["c", "c64"])
@pytest.mark.parametrize("how", PRESENCE)
def test_a_touch_that_changes_while_the_reference_is_taken(how, engine):
    one = skin(engine)
    for snr_db in (40, 60, 80):
        for count in COUNTS:
            there = np.asarray(PRESENCE[how](np.arange(count) / count), dtype=np.float64)
            frames = untouched(count, snr_db, 1) + 0.5 * there[:, None] * change()
            with pytest.raises(FrameError, match="leave the skin untouched"):
                one.tare(frames)


def test_healthy_tares_are_taken():
    """By noise of 40 to 80 dB, a gain that drifts by 1 %, a converter of 12 bits."""
    one = skin()
    for seed in range(25):
        for snr_db in (40, 60, 80):
            for count in COUNTS:
                frames = untouched(count, snr_db, seed)
                one.tare(frames)
                one.tare(frames * (1 + 0.01 * np.linspace(0, 1, count)[:, None]))
                step = np.abs(frames).max() / 2048
                one.tare(np.round(frames / step) * step)


def test_a_bad_reading_is_no_touch():
    one = skin()
    for row in range(0, 208, 13):
        frames = untouched(16, 60, row)
        frames[5, row] += 0.3 * np.abs(frames).max()
        one.tare(frames)


def test_who_leaves_stale_references_out_takes_any():
    model = prebuilt()[0]
    off = default_options(model)
    frames = untouched(16, 60, 2)
    frames[8:] += change()
    with pytest.raises(FrameError):
        skin().tare(frames)
    skin(options=replace(off, diagnostics=off.diagnostics & ~64)).tare(frames)


def test_half_scans_are_not_examined():
    """A copied row shows nothing of its own."""
    fold = prebuilt()[0].fold
    frames = untouched(16, 60, 3)
    frames[8:] += change()
    frames[:, fold.second] = fold.sign * frames[:, fold.first]
    skin().tare(frames)
