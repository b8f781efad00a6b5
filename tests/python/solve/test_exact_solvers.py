"""Active set and coordinate descent against another implementation, in both widths; the limit of
multiply-accumulates."""

import warnings

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import SOLVERS
from eitskin.errors import UsageError
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.benchmarks.solve_problems import Problems, bench_options, make_problems
from eitskin_studies.harness.bare_core import bare_solve
from small_models import prebuilt, session, small_blob, small_model


@pytest.fixture(scope="module")
def problems() -> Problems:
    """Twenty random scenes at 60 dB, the prebuilt model."""
    model, blob = prebuilt()
    return make_problems("rank 64", model, blob, session())


def solved(problems: Problems, width: str, **options: object) -> list[tuple[np.ndarray, str]]:
    engine, found = CoreEngine(problems.blob, width), []
    for k in range(len(problems)):
        engine.set_options(
            bench_options(problems.model, lambda_abs=float(problems.lam[k]), **options)
        )
        bare_solve(engine, problems.y[k])()
        found.append((engine.coefficients(), engine.last_info().stop))
    return found


def test_the_optimum_is_scikit_learns(problems):
    """Objectives agree to what scikit-learn's own gap leaves open."""
    from sklearn import linear_model

    s = np.asfortranarray(problems.s)
    for k in range(0, len(problems), 4):
        lasso = linear_model.Lasso(
            alpha=problems.lam[k] / len(s),
            positive=True,
            fit_intercept=False,
            tol=1e-10,
            max_iter=1_000_000,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            x = lasso.fit(s, problems.y[k]).coef_
        assert -1e-12 <= problems.suboptimality(k, x) <= 1e-8


@pytest.mark.parametrize(("width", "bound"), [("float32", 1e-6), ("float64", 1e-12)])
def test_the_active_set_finds_it(problems, width, bound):
    for k, (x, stop) in enumerate(solved(problems, width, solver="active-set")):
        assert stop == "optimum"
        assert (x >= 0).all() and -1e-12 <= problems.suboptimality(k, x) <= bound
        assert np.count_nonzero(x) < 40


@pytest.mark.parametrize(("width", "bound"), [("float32", 1e-4), ("float64", 1e-4)])
def test_coordinate_descent_comes_near(problems, width, bound):
    for k, (x, _) in enumerate(solved(problems, width, solver="coordinate", iterations=5000)):
        assert (x >= 0).all() and -1e-12 <= problems.suboptimality(k, x) <= bound


@pytest.mark.parametrize("solver", SOLVERS)
def test_more_macs_give_a_lower_objective(problems, solver):
    """On the mean over the scenes; every limit holds."""
    engine, means = CoreEngine(problems.blob), []
    for limit in (1, 60_000, 120_000, 300_000, 1_000_000, 4_000_000):
        values = []
        for k in range(len(problems)):
            engine.set_options(
                bench_options(
                    problems.model,
                    lambda_abs=float(problems.lam[k]),
                    solver=solver,
                    iterations=200,
                    mac_limit=limit,
                )
            )
            bare_solve(engine, problems.y[k])()
            info = engine.last_info()
            assert info.macs <= limit
            values.append(problems.suboptimality(k, engine.coefficients()))
        means.append(float(np.mean(values)))
    assert means[0] == means[1] > 5 and means[-1] < 0.05 * means[0]
    assert (np.diff(means[2:]) <= 1e-6).all()


def test_the_reference_counts_no_macs():
    reconstructor = Reconstructor(small_model(), engine="numpy", blob=small_blob())
    with pytest.raises(UsageError, match="counts no multiply-accumulates"):
        reconstructor.with_options(mac_limit=5)
