"""Matrices whose columns do not determine the coefficients: duplicates, opposites, zeros, low
ranks; and whitened ones."""

from itertools import product

import numpy as np
import pytest
from random_problems import RandomProblem, asked, gaussian, rounded, smooth, whitened, with_data
from soundness import check_sound

from eitskin.core.options_table import SIGNS, SOLVERS


def repeated(times: int, turn: float = 1.0, nudge: float = 0.0) -> RandomProblem:
    """Return a problem whose directions are repeated in ``times`` neighbouring columns. Every
    second column is multiplied by ``turn``, and gets noise of ``nudge``."""
    base, rng = gaussian(2, columns=64 // times).s, np.random.default_rng(3)
    s = np.repeat(base, times, axis=1)
    s[:, 1::2] = turn * s[:, 1::2] + nudge * rng.standard_normal(s[:, 1::2].shape)
    return with_data(s, 4)


def of_rank(rank: int) -> RandomProblem:
    """64 columns of 20 rows within so many directions."""
    rng = np.random.default_rng(7)
    return with_data(rng.standard_normal((20, rank)) @ rng.standard_normal((rank, 64)) / 8, 8)


STEEP = gaussian(10).s * 10.0 ** np.linspace(-6, 6, 64)


PROBLEMS = {
    "problem/duplicate-columns": {
        "twice": repeated(2),
        "four times": repeated(4),
        "all the same": repeated(64),
        "opposite": repeated(2, -1.0),
        "all but the same": repeated(2, nudge=1e-7),
        "all but opposite": repeated(2, -1.0, 1e-7),
    },
    "problem/zero-columns": {
        "every third": with_data(np.where(np.arange(64) % 3 == 0, 0.0, gaussian(5).s), 6),
        "all": RandomProblem(np.zeros((20, 64)), gaussian(9).y),
    },
    "problem/low-rank": {
        **{str(rank): of_rank(rank) for rank in (1, 2, 7)},
        "falling by 0.5": smooth(11, decay=0.5),
    },
    "problem/whitened": {"orthonormal rows": whitened(12)},
    "problem/steep-columns": {
        "1e-6 to 1e6": RandomProblem(
            rounded(STEEP), rounded(STEEP @ np.eye(64)[40] + 0.1 * STEEP[:, 50])
        )
    },
}


@pytest.mark.parametrize("solver", SOLVERS)
def test_columns(same_everywhere, margins, solver):
    """Whatever the columns, the result is sound (soundness.check_sound); a zero column stays at
    zero; where the data have fewer directions than there are columns, the active set's support is
    no larger than they are."""
    steps, what = [], []
    for case, problems in PROBLEMS.items():
        for name, problem in problems.items():
            lipschitz = None if problem.s.any() else 1.0
            for sign, share in product(SIGNS, (0.003, 0.3)):
                options = problem.options(
                    solver=solver, sign=sign, iterations=150, lambda_rel=share
                )
                steps += asked(problem, options, lipschitz=lipschitz)
                what.append((case, name, problem, sign))
    _, outcomes = same_everywhere.steps(steps)
    for (case, name, problem, sign), one in zip(what, outcomes, strict=True):
        check_sound(margins, case, problem.judged(sign, one), one)
        silent = ~problem.s.any(axis=0)
        moved = np.count_nonzero(one.coefficients[silent])
        if silent.any():
            margins.everywhere(case, "zero columns that moved", moved, 0, "pixels")
        if solver == "active-set" and one.info.stop == "optimum":
            rank = np.linalg.matrix_rank(problem.s, tol=1e-4)
            assert one.info.nonzeros <= rank or case == "problem/steep-columns", name
