"""Stored matrices at the limits of their types: what is lost follows from the step of the
quantiser."""

import numpy as np
import pytest
from made_models import made_model
from random_problems import RandomProblem, asked, gaussian, rounded, smooth, with_data
from soundness import check_sound, judged, objective_of

from eitskin.core.options_table import SOLVERS
from eitskin.errors import UsageError
from eitskin.model.storage import STORAGES, store
from everywhere import on_host

CASE = "problem/quantised"
HALF_STEP = {"i8": 0.5 / 127, "i16": 0.5 / 32767}  # of a column's greatest number


def ranged(low: float, high: float) -> RandomProblem:
    """Rows from 1 down to ``low`` within each column, columns from ``high`` down to 1 /
    ``high``."""
    s = gaussian(41).s * np.geomspace(1, low, 20)[:, None] * np.geomspace(high, 1 / high, 64)
    return with_data(s, 42)


PROBLEMS = {
    "gaussian": gaussian(43),
    "smooth": smooth(44),
    "wide columns": ranged(1e-4, 1.0),
    "long and short columns": ranged(1.0, 100.0),
    "at the end of f16": RandomProblem(
        rounded(s := gaussian(45).s * 65000 / np.abs(gaussian(45).s).max()), rounded(s[:, 3])
    ),
    "in the denormals of f16": RandomProblem(rounded(s := gaussian(46).s * 1e-5), rounded(s[:, 3])),
}


def entry_errors(s: np.ndarray, storage: str) -> np.ndarray:
    """The most that each number of S (r, n) may be off: half a step; for f16 2^-11 of it, or half
    of 2^-24; and the rounding of the scale to float32."""
    if storage in HALF_STEP:
        return np.broadcast_to(
            HALF_STEP[storage] * np.abs(s).max(axis=0), s.shape
        ) + 2.0**-24 * np.abs(s)
    return np.maximum(2.0**-11 * np.abs(s), 2.0**-25) if storage == "f16" else np.zeros_like(s)


@pytest.mark.parametrize("solver", SOLVERS)
def test_quantised(same_everywhere, margins, solver):
    """With S' = S + E stored and e(x) = sum_j |x_j| |E_j|, |y - S x| and |y - S' x| differ by at
    most e(x). So x', within a gap g of the optimum of S', has f(x') <= f* + g + |r'| e(x') +
    e(x')^2 / 2 + |r*| e(x*) + e(x*)^2 / 2 in the problem of S, and by strong convexity |S (x' -
    x*)| <= sqrt(2 (f(x') - f*)). E is bounded by the step, before anything is measured.
    """
    steps, what, within = [], [], margins.of(CASE)
    for name, problem in PROBLEMS.items():
        lam = 0.1 * problem.lambda_max("both")
        options = problem.options(
            solver=solver, sign="both", iterations=3000, gap_rel=1e-5, lambda_abs=lam,
            lambda_rel=0.0,
        )  # fmt: skip
        best = problem.judged("both", on_host(asked(problem, options), "float64")[1][0])
        for storage in STORAGES:
            steps += asked(problem, options, storage=storage)
            what.append((name, storage, problem, best))
    _, outcomes = same_everywhere.steps(steps)
    for (name, storage, problem, best), one in zip(what, outcomes, strict=True):
        stored = made_model(problem.s, storage=storage).sensitivity
        allowed = entry_errors(problem.s, storage)
        assert (np.abs(stored - problem.s) <= allowed * (1 + 1e-6)).all(), (name, storage)
        point = judged(stored, problem.y, "both", one)
        check_sound(margins, CASE, point, one)
        sizes = np.linalg.norm(allowed, axis=0)
        room = point.gap + best.gap + point.objective_rounding
        for each in (point, best):
            error = float(np.abs(each.x) @ sizes)
            room += float(np.linalg.norm(each.residual)) * error + 0.5 * error**2
        lacks = max(0.0, objective_of(problem.s, problem.y, point.x, best.lam) - best.objective)
        half, size = best.at_zero().objective, float(np.linalg.norm(problem.y))
        within(f"objective above that of f32, {storage}", lacks / half, room / half, "|y|^2/2")
        moved = float(np.linalg.norm(problem.s @ (point.x - best.x)))
        bound = np.sqrt(2 * (room + best.gap)) / size
        within(f"S x from that of f32, {storage}", moved / size, bound, "|y|")


@pytest.mark.parametrize("storage", STORAGES)
def test_what_does_not_fit_is_refused(storage):
    """Beyond the type's greatest number; and a column too small for a step is silent, not
    rubbish."""
    for value in (1e39, np.inf, np.nan, *((65520.0,) if storage == "f16" else ())):
        with pytest.raises(UsageError) as error:
            store(np.full((3, 4), value), storage)
        assert "\n" not in str(error.value)
    tiny = store(np.full((3, 4), 1e-44), storage).decode(3)
    assert (np.abs(tiny) <= 2e-44).all()
    greatest = 6.5e4 if storage == "f16" else 3e38
    assert np.isfinite(store(np.full((3, 4), greatest), storage).decode(3)).all()
