"""Lambda at its ends: 0, a hair below lambda_max, at it, a hair above it, and far beyond."""

import numpy as np
import pytest
from random_problems import RANK, asked, gaussian
from soundness import check_sound

from eitskin.core.options_table import SIGNS, SOLVERS

CASE = "problem/lambda-ends"


@pytest.mark.parametrize("solver", SOLVERS)
def test_lambda_ends(same_everywhere, margins, solver):
    """Zero from lambda_max on. What "at" means is the core's own sum of ``RANK`` products, read
    back from a first solve."""
    problem, within, real = gaussian(1), margins.of(CASE), same_everywhere.real
    ask = [asked(problem, problem.options(solver=solver, sign=sign)) for sign in SIGNS]
    _, first = same_everywhere.steps([step for steps in ask for step in steps])
    steps, what = [], []
    for sign, one in zip(SIGNS, first, strict=True):
        assert abs(one.info.lambda_max / problem.lambda_max(sign) - 1) < RANK * np.finfo(real).eps
        top = real(one.info.lambda_max)
        for name, value in {  # above and below by one unit in the last place
            "zero": 0.0,
            "below": float(np.nextafter(top, real(0))),
            "at": float(top),
            "above": float(np.nextafter(top, real(1e9))),
            "beyond": 100 * float(top),
        }.items():
            chosen = problem.options(
                solver=solver, sign=sign, iterations=200, lambda_abs=value, lambda_rel=0.0
            )
            steps += asked(problem, chosen)
            what.append((sign, name))
    _, outcomes = same_everywhere.steps(steps)
    for (sign, name), one in zip(what, outcomes, strict=True):
        check_sound(margins, CASE, problem.judged(sign, one), one)
        assert (one.info.stop == "zero") == (name in ("at", "above", "beyond"))
        if one.info.stop == "zero":
            assert one.info.gap == 0 and one.touches == ()
            within("non-zeros from lambda_max on", np.count_nonzero(one.image), 0, "pixels")
