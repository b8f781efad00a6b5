"""How the image changes as frames get worse: with noise, with rows left out, with coarser
numbers."""

from dataclasses import replace
from functools import cache

import numpy as np

from eitskin.model.options import default_options
from eitskin_studies.harness.emulated_steps import Choose, Load, Mask, Play, Step, TareStep
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


@cache
def clean_frames() -> np.ndarray:
    """(COUNT, m) V without noise."""
    return small().frames(81, COUNT, noise=0.0)


@cache
def order_of_loss() -> np.ndarray:
    """Rows in the order in which they are lost: each level's are among the next one's."""
    return np.random.default_rng(82).permutation(small().protocol.n_rows)


def steps_of(kind: str, level: float) -> list[Step]:
    """Tare on quiet frames that are as bad as the frames, then the frames."""
    s, frames = small(), clean_frames()
    rng, v0 = np.random.default_rng(83), s.linear.v0_v
    sigma = (level if kind == "noise" else 0.0) * float(np.sqrt(np.mean(v0**2)))
    noise = rng.standard_normal(frames.shape)
    quiet = s.quiet(84, 32, 0.0) + sigma * rng.standard_normal((32, len(v0)))
    frames = frames + sigma * noise
    if kind == "bits":
        step = 2 * 1.25 * float(np.abs(v0).max()) / 2**level
        frames, quiet = np.round(frames / step) * step, np.round(quiet / step) * step
    masked = np.zeros(len(v0), dtype=bool)
    masked[order_of_loss()[: int(level) if kind == "rows left out" else 0]] = True
    options = replace(
        default_options(small_model()), diagnostics=0
    )  # linear answers are no sheet's, and rows would be left out
    return [Load(small_blob()), Choose(options), Mask(masked), TareStep(quiet), Play(frames)]


def all_steps() -> list[Step]:
    """Every kind at every level."""
    return [
        step
        for kind, levels in LEVELS.items()
        for level in levels
        for step in steps_of(kind, level)
    ]


def errors_of(outcomes: list[Outcome]) -> dict[str, list[float]]:
    """By kind and level: |image - image at the first level| / |that|, mean over the frames."""
    images = np.array([one.image.astype(np.float64) for one in outcomes]).reshape(
        -1, COUNT, len(outcomes[0].image)
    )
    errors: dict[str, list[float]] = {}
    place = 0
    for kind, levels in LEVELS.items():
        first = images[place]
        of_kind = images[place : place + len(levels)]
        off = np.linalg.norm(of_kind - first, axis=2) / np.linalg.norm(first, axis=1)
        errors[kind] = [float(value) for value in off.mean(axis=1)]
        place += len(levels)
    return errors
