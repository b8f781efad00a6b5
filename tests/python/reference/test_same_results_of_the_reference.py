"""Numbers of the numpy solver on fixed frames: what each option changes, what each diagnostic
says."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import FrameError
from eitskin.model.build import BuildSettings, make_model
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin_reference.engine import ReferenceEngine
from same_results import check_same
from small_models import prebuilt, sheet_without_mesh

STORE = Path(__file__).with_suffix(".json")
TIMES = ("solve_us", "touch_us")


@cache
def small_of(data_kind: str) -> tuple[Model, FloatArray]:
    """A small model and its linear answer to discs."""
    sheet = sheet_without_mesh()
    settings = BuildSettings(rank=17, data_kind=data_kind)
    return make_model(sheet.skin, sheet.protocol, sheet.linear, settings), sheet.linear.jacobian


@cache
def paper() -> tuple[Model, FloatArray]:
    """The shipped model, and what it says of changes of pixels (m, n)."""
    model = prebuilt()[0]
    p, fold = model.projection.astype(float), model.fold
    folded = (p / (p**2).sum(axis=1, keepdims=True)).T @ model.sensitivity
    rows = np.zeros((model.protocol.n_rows, model.grid.n_pixels))
    weight = model.column_weight.astype(float)
    rows[fold.first] = folded / np.where(weight > 0, weight, np.inf)
    paired = fold.second >= 0
    rows[fold.second[paired]] = fold.sign[paired, None] * rows[fold.first[paired]]
    return model, rows


def frames(of: tuple[Model, FloatArray], seed: int, discs: int, noise: float = 3e-4) -> FloatArray:
    """A reference of 16 frames, then 5 in which discs move."""
    model, answer = of
    draw, centres = np.random.default_rng(seed), model.grid.centres_mm()
    v0 = model.golden.reference_v.astype(float)
    size, expected = np.ptp(centres, axis=0).min(), model.defaults.touch_change_s_per_m
    at = centres[draw.integers(len(centres), size=discs)]
    radius, change = draw.uniform(0.05, 0.1, discs), expected * draw.uniform(0.3, 1.0, discs)
    made = [v0] * 16
    for k in range(5):
        x = np.zeros(len(centres))
        for n in range(discs):
            away = np.linalg.norm(centres - at[n] - 0.01 * k * size, axis=1)
            x += change[n] * np.clip(0.5 + (radius[n] * size - away) / model.grid.pixel_mm, 0, 1)
        made.append(v0 + answer @ x)
    sigma = noise * np.sqrt(np.mean(v0**2))
    return np.array(made) + sigma * draw.normal(size=(len(made), len(v0)))


def columns(rows: list[Any]) -> dict[str, Any]:
    """Of dicts or objects with the same fields, each field's values; numbers as an array."""
    if not rows:
        return {}
    fields = [dict(row) if isinstance(row, dict) else vars(row) for row in rows]
    found = {name: [row[name] for row in fields] for name in fields[0] if name not in TIMES}
    return {
        name: np.array(values, dtype=float) if isinstance(values[0], (bool, int, float)) else values
        for name, values in found.items()
    }


def solved(
    of: tuple[Model, FloatArray],
    given: FloatArray,
    tare: int = 16,
    mask: tuple[int, ...] = (),
    *,
    follow: bool = False,
    **options: Any,
) -> list[Any]:
    """The reference as learned, images, touches, what is said of frames, and errors."""
    engine, usual = ReferenceEngine(of[0]), default_options(of[0])
    engine.set_options(replace(tracking(usual) if follow else usual, **options))
    if mask:
        engine.mask_rows(np.isin(np.arange(of[0].protocol.n_rows), mask))
    learned = engine.set_reference(given[16 - tare : 16])
    results, errors = [], []
    for frame in given[16:]:
        try:
            results.append(engine.reconstruct(frame))
        except FrameError as error:
            errors.append(f"{error}")
    touches = [touch for result in results for touch in result.touches]
    images = np.array([[result.image, result.coefficients] for result in results])
    told = [columns(touches), columns([vars(result.info) for result in results])]
    return [learned, images, len(touches), *told, errors]


def spoilt(given: FloatArray, spoil: Callable[[FloatArray], Any]) -> FloatArray:
    """Frames behind the reference with something wrong."""
    changed = given.copy()
    spoil(changed[16:])
    return changed


ROWS = prebuilt()[0].protocol.drive_measure.astype(np.int64)


def put(rows: Any, value: float) -> Callable[[FloatArray], Any]:
    def spoil(given: FloatArray) -> None:
        given[:, rows] = value * given[:, rows] if np.isfinite(value) else value

    return spoil


USES_5 = (ROWS == 5).any(axis=1)
SPOILT: dict[str, Callable[[FloatArray], Any]] = {
    "an outlier": put([40], 1.4),
    "two outliers": put([40, 90], 0.6),
    "an electrode open": put(USES_5, 1e-3),
    "an electrode noisy": lambda v: v.__imul__(
        np.where(USES_5, np.random.default_rng(4).normal(1, 0.2, v.shape), 1.0)
    ),
    "rows turned": put([3, 70, 120], -1.0),
    "rows missing": put(list(range(0, 60, 3)), np.nan),
    "half missing": put(ROWS[:, 0] < ROWS[:, 2], np.nan),
    "nothing": put(slice(None), 0.0),
    "a larger gain": put(slice(None), 1.03),
    "the other way": lambda v: np.copyto(v, 2 * prebuilt()[0].golden.reference_v.astype(float) - v),
    "drift": lambda v: v.__imul__(1 + 0.01 * np.sin(np.arange(v.shape[1]) / 9)),
}
OPTIONS: dict[str, dict[str, Any]] = {
    "usual": {},
    "fista": {"solver": "fista", "iterations": 30},
    "fista to a gap": {"solver": "fista", "iterations": 2000, "gap_rel": 1e-5, "gap_every": 3},
    "active set": {"solver": "active-set", "iterations": 60},
    "working set": {"solver": "working-set", "iterations": 40},
    "both signs": {"sign": "both", "iterations": 30},
    "decrease": {"sign": "decrease", "iterations": 30},
    "warm": {"warm_start": True},
    "no drift projected": {"project_reference": False},
    "fixed lambda": {"lambda_abs": 1e-4, "solver": "active-set"},
    "no threshold": {"detection_factor": 0.0, "lambda_noise_factor": 0.0},
    "followed": {"follow": True},
    "followed, few sweeps": {"follow": True, "touch_sweeps": 1, "track_confirm": 3},
    "sought": {"touch_seek": True},
    "no fit": {"touch_sweeps": 0},
    "discs alone": {"touch_fit": 0},
    "split and merge": {"touch_fit": 2},
    "second pass": {"second_pass": True},
    "no test": {"touch_test": False, "row_gains": False},
    "few touches": {"max_touches": 1},
    "no regularisation by noise": {"regularisation_noise_factor": 0.0},
    "a floor of noise": {"noise_floor_v": 1e-5},
    "a reference that follows": {"reference_frames": 4},
    "no diagnostics": {"diagnostics": 0},
    "saturation": {"saturation_v": 0.02},
}
CALLS: dict[str, Callable[[], Any]] = {
    **{
        f"small, {name}, {kind}": lambda o=o, kind=kind: solved(
            small_of(kind), frames(small_of(kind), 5, 2), **o
        )
        for name, o in OPTIONS.items()
        for kind in (
            ("difference", "normalised", "log-ratio") if name == "usual" else ("difference",)
        )
    },
    **{
        f"paper, {name}": lambda o=OPTIONS[name]: solved(paper(), frames(paper(), 6, 3)[:18], **o)
        for name in ("usual", "followed", "second pass", "active set", "no test")
    },
    **{
        f"paper, {n} discs": lambda n=n: solved(paper(), frames(paper(), 10 + n, n)[:17])
        for n in (0, 1, 5, 8)
    },
    "paper, light": lambda: solved(paper(), frames(paper(), 30, 2, noise=5e-3)[:18]),
    "paper, noiseless": lambda: solved(paper(), frames(paper(), 31, 1, noise=0.0)[:17]),
    "paper, one reference frame": lambda: solved(paper(), frames(paper(), 32, 2)[:17], tare=1),
    "paper, masked": lambda: solved(paper(), frames(paper(), 33, 2)[:17], mask=(4, 50, 51, 99)),
    **{
        f"paper, {name}": lambda spoil=spoil: solved(
            paper(), spoilt(frames(paper(), 7, 2)[:17], spoil)
        )
        for name, spoil in SPOILT.items()
    },
    "paper, an outlier in the reference": lambda: solved(
        paper(), np.concatenate([1.3 * frames(paper(), 8, 1)[:1], frames(paper(), 8, 1)[1:17]])
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_same_results_of_the_reference(name):
    check_same(STORE, name, CALLS[name])
