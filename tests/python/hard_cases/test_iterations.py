"""From iteration to iteration, and float32 beside float64: bounds that follow from convexity."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from made_models import lipschitz_of
from random_problems import RandomProblem, asked, gaussian, optimum_of, smooth, whitened
from soundness import Judged, U, check_sound

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin_emulator.core_steps import Step
from everywhere import on_host
from margins import Margins

CASE, WIDTHS_CASE = "problem/iterations", "problem/float32-against-float64"
COUNTS = (*range(1, 16), 20, 25, 30, 40, 60, 100)
PROBLEMS = {"gaussian": gaussian(21), "smooth": smooth(22), "whitened": whitened(23)}
SHARE = 0.03


@cache
def optimum(name: str, sign: str) -> Judged:
    return optimum_of(PROBLEMS[name], sign, SHARE)


def allowance(best: Judged, k: int) -> float:
    """Return the bound of FISTA's objective above the optimum after k iterations from zero with
    inexact gradients (Schmidt, Le Roux and Bach, NIPS 2011, proposition 2): 2 L (|x*| + 2 A)^2 / (k
    + 1)^2, with A = sum_i i e_i / L. e_i is the gradient's error by rounding, for a residual of at
    most 3 |y| and columns whose norm is sqrt(L): it contains the rounding of the residual and that
    of its products."""
    rank, n = best.s.shape
    lipschitz, size = lipschitz_of(best.s), float(np.linalg.norm(best.y))
    error = np.sqrt(lipschitz) * (n + 2 * rank + 4) * U * 3 * size
    reach = float(np.linalg.norm(best.x)) + 2 * error / lipschitz * k * (k + 1) / 2
    return 2 * lipschitz * reach**2 / (k + 1) ** 2


def check_rate(margins: Margins, name: str, best: Judged, k: int, point: Judged) -> None:
    half = 0.5 * float(best.y @ best.y)
    lacks = max(0.0, point.objective - best.objective) / half
    bound = (allowance(best, k) + best.gap + point.objective_rounding) / half
    what = f"objective above the optimum after k iterations of {name}"
    margins.everywhere(CASE, what, lacks, bound, "|y|^2/2")


@pytest.mark.parametrize("solver", SOLVERS)
def test_iterations(same_everywhere, margins, solver):
    """The active set never raises the objective except by rounding. FISTA may
    ripple; it stays within its rate, and so does the working set, whose columns left out are looked
    after."""
    steps: list[Step] = []
    what = list(product(PROBLEMS, SIGNS, COUNTS))
    for name, sign, k in what:
        problem = PROBLEMS[name]
        options = problem.options(solver=solver, sign=sign, iterations=k, lambda_rel=SHARE)
        steps += asked(problem, options)
    _, outcomes = same_everywhere.steps(steps)
    before: tuple[str, str, Judged] | None = None
    for (name, sign, k), one in zip(what, outcomes, strict=True):
        point = PROBLEMS[name].judged(sign, one)
        check_sound(margins, CASE, point, one)
        if solver in ("fista", "working-set"):
            check_rate(margins, solver, optimum(name, sign), k, point)
        elif before is not None and before[:2] == (name, sign):
            half = point.at_zero().objective
            rise = max(0.0, point.objective - before[2].objective) / half
            slack = (point.objective_rounding + before[2].objective_rounding) / half
            what_rose = f"objective risen by an iteration of {solver}"
            margins.everywhere(CASE, what_rose, rise, slack, "|y|^2/2")
        before = (name, sign, point)


def precise(problem: RandomProblem, solver: str, sign: str) -> list[Step]:
    """To a gap of 1e-5 |y|^2/2."""
    options = problem.options(
        solver=solver, sign=sign, iterations=100_000, gap_rel=1e-5, lambda_rel=SHARE
    )
    return asked(problem, options)


@pytest.mark.parametrize("same_everywhere", ["float32"], indirect=True)
@pytest.mark.parametrize("solver", SOLVERS)
def test_float32_against_float64(same_everywhere, margins, solver):
    """Both to a gap of 1e-5 |y|^2/2. The objective is strongly convex in S x: f(x) - f* >= |S (x -
    x*)|^2 / 2 at the optimum x*, so a gap g leaves S x within sqrt(2 g) of the optimum's, and two
    results within the sum. On the columns where either is not zero x itself differs by at most that
    over their least singular value, where they are independent.
    """
    what = list(product(PROBLEMS, SIGNS))
    steps = [step for name, sign in what for step in precise(PROBLEMS[name], solver, sign)]
    _, outcomes = same_everywhere.steps(steps)
    compared, within = 0, margins.of(WIDTHS_CASE)
    for (name, sign), one in zip(what, outcomes, strict=True):
        problem = PROBLEMS[name]
        _, (in_float64,) = on_host(precise(problem, solver, sign), "float64")
        narrow, wide = (problem.judged(sign, each) for each in (one, in_float64))
        check_sound(margins, WIDTHS_CASE, narrow, one)
        half, size = narrow.at_zero().objective, float(np.linalg.norm(problem.y))
        bound = 1e-5 + narrow.gap_rounding / half
        within("gap reached", narrow.gap / half, bound, "|y|^2/2")
        margins.record(
            WIDTHS_CASE, "gap reached", "host f64", wide.gap / half, 1e-5 * (1 + 1e-6), "|y|^2/2"
        )
        moved_lambda = abs(narrow.lam - wide.lam) * np.abs(wide.x).sum()
        room = sum(np.sqrt(2 * each) for each in (narrow.gap, wide.gap, moved_lambda))
        apart = float(np.linalg.norm(problem.s @ (narrow.x - wide.x)))
        within("S x, float32 from float64", apart / size, room / size, "|y|")
        support = (narrow.x != 0) | (wide.x != 0)
        columns = problem.s[:, support]
        least = float(np.linalg.svd(columns, compute_uv=False)[-1]) if support.any() else 1.0
        if least > 0 and np.count_nonzero(support) <= problem.s.shape[0]:
            longest = float(np.linalg.norm(wide.x))
            moved = float(np.linalg.norm(narrow.x - wide.x))
            within("x, float32 from float64", moved / longest, room / least / longest, "|x|")
            compared += 1
    assert compared >= 2
