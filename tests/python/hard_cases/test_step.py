"""A model that states too small a Lipschitz constant makes FISTA's step too long: the guard halves
it, or gives zero and says so."""

from itertools import product

import numpy as np
import pytest
from made_models import lipschitz_of
from random_problems import asked, gaussian, optimum_of, smooth, whitened
from soundness import check_sound

from eitskin.core.options_table import SIGNS, SOLVERS

CASE = "problem/step-too-long"
MAX_HALVINGS = 8
FACTORS = (0.1, 1.0, 2.0, 10.0, 100.0, 1e3, 1e6, 1e20)
PROBLEMS = {"gaussian": gaussian(31), "smooth": smooth(32), "whitened": whitened(33)}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("iterations", [3, 300])
def test_step_too_long(same_everywhere, margins, solver, iterations):
    """If the step is up to 2^8 times too long, most of 300 iterations remain after its halvings,
    and the objective falls by at least 99 % of the possible amount. If the step cannot be reduced
    enough, or no time is left, the image is zero and the stop is "diverged". The active set does
    not use the constant for a step."""
    within, steps = margins.of(CASE), []
    what = list(product(PROBLEMS, FACTORS, SIGNS))
    for name, factor, sign in what:
        problem = PROBLEMS[name]
        options = problem.options(solver=solver, sign=sign, iterations=iterations)
        steps += asked(problem, options, lipschitz=lipschitz_of(problem.s) / factor)
    _, outcomes = same_everywhere.steps(steps)
    halved = gave_up = 0
    for (name, factor, sign), one in zip(what, outcomes, strict=True):
        problem = PROBLEMS[name]
        point = problem.judged(sign, one)
        check_sound(margins, CASE, point, one)
        assert one.info.step_halvings <= MAX_HALVINGS
        halved += one.info.step_halvings > 0
        gave_up += one.info.stop == "diverged"
        if one.info.stop == "diverged":
            assert not one.image.any() and factor > 1 and solver in ("fista", "working-set")
        elif iterations == 300:
            best, start = optimum_of(problem, sign), point.at_zero()
            left = max(0.0, point.objective - best.objective) / (start.objective - best.objective)
            within(f"left to do after 300 iterations of {solver}", left, 0.01, "of what there was")
        if solver not in ("fista", "working-set"):
            assert one.info.step_halvings == 0
        elif iterations == 300:
            assert factor > 2**MAX_HALVINGS or one.info.stop != "diverged", (factor, one.info)
            assert factor < 1e6 or one.info.stop == "diverged", (factor, one.info)
        assert one.image.any() or one.info.stop == "diverged", (name, factor, sign)
    if solver in ("fista", "working-set"):
        assert gave_up and (halved or iterations == 3)
    assert not np.isnan([one.info.gap for one in outcomes]).any()
