"""How the image changes as frames get worse: with noise, with rows left out, with coarser
numbers."""

from dataclasses import replace

import numpy as np

from eitskin.model.options import default_options
from eitskin_emulator.core_steps import Choose, Load, Mask, Play, Step, TareStep
from everywhere import Outcome
from small_models import small, small_blob, small_model

COUNT = 12
NOISE = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2)  # of rms(V0)
ROWS_OUT = (0, 4, 8, 16, 32, 64)  # of 208
BITS = (24, 14, 13, 12, 11, 10, 9, 8)
LEVELS = {"noise": NOISE, "rows left out": ROWS_OUT, "bits": BITS}
UNITS = {
    "noise": "noise, share of rms(V0)",
    "rows left out": "rows left out, of 208",
    "bits": "bits of the converter",
}


def steps_of(kind: str, level: float) -> list[Step]:
    """Tare on untouched frames that are as bad as the frames, then the frames; each level's lost
    rows are among the next one's."""
    s, rng = small(), np.random.default_rng(83)
    v0, frames = s.linear.v0_v, s.frames(81, COUNT, noise=0.0)
    sigma = (level if kind == "noise" else 0.0) * float(np.sqrt(np.mean(v0**2)))
    noise = rng.standard_normal(frames.shape)
    untouched = s.untouched(84, 32, 0.0) + sigma * rng.standard_normal((32, len(v0)))
    frames = frames + sigma * noise
    if kind == "bits":
        step = 2 * 1.25 * float(np.abs(v0).max()) / 2**level
        frames, untouched = np.round(frames / step) * step, np.round(untouched / step) * step
    lost = np.random.default_rng(82).permutation(s.protocol.n_rows)
    masked = np.isin(np.arange(len(v0)), lost[: int(level) if kind == "rows left out" else 0])
    # linear answers are no sheet's, and rows would be left out
    options = replace(default_options(small_model()), diagnostics=0)
    return [Load(small_blob()), Choose(options), Mask(masked), TareStep(untouched), Play(frames)]


def all_steps() -> list[Step]:
    return [
        step
        for kind, levels in LEVELS.items()
        for level in levels
        for step in steps_of(kind, level)
    ]


def errors_of(outcomes: list[Outcome]) -> dict[str, list[float]]:
    """By kind and level: |image - image at the first level| / |that|, mean over the frames."""
    images = np.array([one.image.astype(np.float64) for one in outcomes])
    images = images.reshape(-1, COUNT, images.shape[-1])
    errors: dict[str, list[float]] = {}
    place = 0
    for kind, levels in LEVELS.items():
        first = images[place]
        of_kind = images[place : place + len(levels)]
        off = np.linalg.norm(of_kind - first, axis=2) / np.linalg.norm(first, axis=1)
        errors[kind] = [float(value) for value in off.mean(axis=1)]
        place += len(levels)
    return errors
