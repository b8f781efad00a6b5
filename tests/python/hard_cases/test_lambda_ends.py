"""Lambda at its ends: 0, a hair below lambda_max, at it, a hair above it, and far beyond."""

import numpy as np
import pytest
from made_models import made_blob, plain_options
from random_problems import RANK, gaussian
from soundness import check_sound, judged

from eitskin.core.options_table import SIGNS, SOLVERS
from eitskin_studies.harness.emulated_steps import Choose, Load, Solve, Step

CASE = "problem/lambda-ends"
EPSILON = 2.0**-23


def at_the_ends(top: np.float32) -> dict[str, float]:
    """Lambdas by name; a hair is one unit in the last place."""
    return {
        "zero": 0.0,
        "below": float(np.nextafter(top, np.float32(0))),
        "at": float(top),
        "above": float(np.nextafter(top, np.float32(1e9))),
        "beyond": 100 * float(top),
    }


@pytest.mark.parametrize("solver", SOLVERS)
def test_lambda_ends(same_everywhere, margins, solver):
    """Zero from lambda_max on. What "at" means is the core's own sum of ``RANK`` products, read
    back from a first solve."""
    problem = gaussian(1)
    s, y, blob = problem.s, problem.y, made_blob(problem.s)
    ask = [Choose(plain_options(s, solver=solver, sign=sign)) for sign in SIGNS]
    _, first = same_everywhere.steps(
        [step for choice in ask for step in (Load(blob), choice, Solve(y[None]))]
    )
    steps: list[Step] = []
    what: list[tuple[str, str]] = []
    for sign, one in zip(SIGNS, first, strict=True):
        assert abs(one.info.lambda_max / problem.lambda_max(sign) - 1) < RANK * EPSILON
        for name, value in at_the_ends(np.float32(one.info.lambda_max)).items():
            chosen = plain_options(
                s, solver=solver, sign=sign, iterations=200, lambda_abs=value, lambda_rel=0.0
            )
            steps += [Load(blob), Choose(chosen), Solve(y[None])]
            what.append((sign, name))
    _, outcomes = same_everywhere.steps(steps)
    for (sign, name), one in zip(what, outcomes, strict=True):
        check_sound(margins, CASE, judged(s, y, sign, one), one)
        if name in ("at", "above", "beyond"):
            assert one.info.stop == "zero" and one.info.gap == 0 and one.touches == ()
            margins.everywhere(
                CASE, "non-zeros from lambda_max on", np.count_nonzero(one.image), 0, "pixels"
            )
        else:
            assert one.info.stop != "zero"
