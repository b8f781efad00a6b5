"""The optimum: the oracle's solver against scikit-learn's, and what the C core gives judged by the
oracle's duality gap and KKT conditions, which need no other solution."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options, Reconstruction
from eitskin.model.options import default_options
from eitskin.oracle.engine import OracleEngine
from eitskin.oracle.lasso import Lasso, greatest, shrink
from small_models import SIGNS, prebuilt, session, small, small_blob, small_model

WIDTHS = {"float64": 1e-9, "float32": 1e-4}  # rounding of a gap, relative to the objective at zero


def problem(seed: int, sign: str, share: float, *, drift: bool = True) -> Lasso:
    """Return the problem of one small frame, with lambda = ``share`` of lambda_max."""
    oracle = OracleEngine(small_model())
    oracle.set_options(replace(default_options(small_model()), sign=sign, project_reference=drift))
    oracle.set_reference(small().linear.v0_v[None])
    seen = oracle.explain(small().frames(seed, 1, sign)[0])
    return Lasso(seen.s, seen.y, share * greatest(seen.s.T @ seen.y, sign), sign)


def scikit_learns(p: Lasso) -> np.ndarray:
    """Its coordinate descent divides by the number of rows, and so lambda too."""
    from sklearn import linear_model  # takes seconds: not while the tests are collected

    turn = -1.0 if p.sign == "decrease" else 1.0
    solver = linear_model.Lasso(
        alpha=p.lam / len(p.y),
        fit_intercept=False,
        positive=p.sign != "both",
        tol=1e-13,
        max_iter=10**6,
    )
    return np.asarray(turn * solver.fit(turn * p.s, p.y).coef_)


# ---- the oracle by itself ----


@pytest.mark.parametrize("sign", SIGNS)
def test_shrink_minimises_its_objective(sign):
    """argmin over allowed x of (x - v)^2 / 2 + t |x|, by brute force on a fine grid."""
    low, high = {"increase": (0, 4), "decrease": (-4, 0), "both": (-4, 4)}[sign]
    v = np.random.default_rng(41).uniform(-3, 3, 50)
    allowed = np.linspace(low, high, 1000 * (high - low) + 1)
    cost = 0.5 * (allowed - v[:, None]) ** 2 + 0.7 * np.abs(allowed)
    assert shrink(v, 0.7, sign) == pytest.approx(allowed[cost.argmin(axis=1)], abs=1e-3)


@pytest.mark.parametrize("drift", [True, False], ids=["project", "keep"])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("sign", SIGNS)
def test_the_active_set_ends_at_the_optimum_of_scikit_learn(sign, share, drift):
    for seed in range(3):
        p = problem(seed, sign, share, drift=drift)
        ours, theirs, scale = p.optimum(), scikit_learns(p), 0.5 * float(p.y @ p.y)
        assert p.gap(ours) <= 1e-11 * scale and p.violation(ours) <= 1e-9 * p.lam
        assert p.objective(ours) <= p.objective(theirs) + 1e-12 * scale
        apart = np.linalg.norm(p.s @ (ours - theirs))  # |S x - S x*|^2 / 2 <= f(x) - f*
        assert apart <= np.sqrt(2 * max(0.0, p.gap(theirs))) + 1e-6 * np.linalg.norm(p.y)


@pytest.mark.parametrize("sign", SIGNS)
def test_the_gap_bounds_what_is_lacking_and_fista_closes_it(sign):
    p, gaps = problem(5, sign, 0.03), []
    best = p.objective(p.optimum())
    for iterations in (1, 10, 100, 1000):
        x, done = p.fista(iterations, small_model().lipschitz)
        assert done == iterations
        assert p.gap(x) >= p.objective(x) - best - 1e-12 * best
        gaps.append(p.gap(x))
    assert gaps[-1] < 1e-3 * gaps[0]
    x, done = p.fista(10**5, small_model().lipschitz, gap=1e-8 * best, every=10)
    assert done % 10 == 0 and p.gap(x) <= 1e-8 * best


def test_violations_are_found():
    """Each of the three conditions is violated alone by one point, and this is found."""
    p = problem(2, "increase", 0.1)
    best = p.optimum()
    on = int(np.argmax(best))
    assert p.violation(best) < 1e-9 * p.lam
    assert p.violation(best * (np.arange(len(best)) != on)) > 0.1 * p.lam
    assert p.violation(1.2 * best) > 0.1 * p.lam
    wrong = best.copy()
    wrong[on] = -1.0
    assert p.violation(wrong) >= 1.0


def test_lambda_max_is_the_least_lambda_whose_optimum_is_zero():
    p = problem(2, "increase", 1.0)
    for share, zero in ((1.0001, True), (0.9999, False)):
        assert (not replace(p, lam=share * p.lam).optimum().any()) == zero


# ---- the C core's solvers ----


def solved(width: str, sign: str, **options: object) -> tuple[Lasso, Reconstruction]:
    """Return the oracle's problem with the core's lambda, and the core's result for a small
    frame."""
    own = {"detection_factor": 0.0, "iterations": 100_000, "lambda_rel": 0.03, "sign": sign}
    chosen: Options = replace(default_options(small_model()), **(own | options))
    frame = small().frames(5, 1, sign)[0].astype(np.float32).astype(float)
    v0 = small().linear.v0_v.astype(np.float32).astype(float)
    oracle, core = OracleEngine(small_model()), CoreEngine(small_blob(), width)
    for engine in (oracle, core):
        engine.set_options(chosen)
        engine.set_reference(v0[None])
    result, seen = core.reconstruct(frame, touches=False), oracle.explain(frame)
    return Lasso(seen.s, seen.y, result.info.lambda_, sign), result


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("sign", SIGNS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_core_is_as_near_to_the_optimum_as_it_says(solver, sign, width):
    """By the oracle's gap of its coefficients: at most the core's own, which is at most what was
    asked for; and the coefficients keep the sign rule."""
    rounding = WIDTHS[width]
    asked = max(1e-6, rounding)
    p, result = solved(width, sign, solver=solver, gap_rel=asked)
    x, scale = result.coefficients.astype(float), 0.5 * float(p.y @ p.y)
    assert result.info.stop == "gap" and result.info.gap_rel <= asked
    assert p.gap(x) <= result.info.gap * 1.01 + rounding * scale
    assert result.info.gap <= p.gap(x) * 1.01 + rounding * scale
    lacks = p.objective(x) - p.objective(p.optimum())
    assert -rounding * scale <= lacks <= result.info.gap + rounding * scale
    if sign != "both":
        assert (x * (1 if sign == "increase" else -1) >= 0).all()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("sign", SIGNS)
def test_the_active_set_ends_where_no_condition_is_violated(sign, width):
    p, result = solved(width, sign, solver="active-set", iterations=1000)
    x = result.coefficients.astype(float)
    assert result.info.stop == "optimum"
    assert p.violation(x) <= (1e-9 if width == "float64" else 2e-3) * p.lam
    assert p.gap(x) <= (1e-10 if width == "float64" else 1e-4) * 0.5 * float(p.y @ p.y)


@pytest.mark.parametrize("iterations", [1, 2, 5, 10, 30, 60, 100, 300])
@pytest.mark.parametrize("solver", ["fista", "working-set"])
def test_the_cores_gap_is_that_of_the_definition_all_the_way(solver, iterations):
    p, result = solved("float64", "both", solver=solver, iterations=iterations)
    x = result.coefficients.astype(float)
    assert result.info.iterations == iterations
    assert result.info.gap == pytest.approx(p.gap(x), rel=1e-6)
    assert result.info.residual == pytest.approx(np.linalg.norm(p.residual(x)), rel=1e-9)
    assert result.info.data_norm == pytest.approx(np.linalg.norm(p.y), rel=1e-12)


def test_what_the_working_set_costs():
    """FISTA with a limit on the columns that it looks at, the solver by default, beside FISTA after
    60 iterations each, on 40 frames of one to three touches: the objective is at most .1 % of its
    value at zero above FISTA's; the image differs by up to .5 % of the peak in half of the frames,
    by more than 6 % in at most one of ten, by 15 % in none."""
    model, blob = prebuilt()
    results = []
    for solver in ("fista", "working-set"):
        core = CoreEngine(blob, "float64")
        core.set_options(replace(default_options(model), solver=solver))
        core.set_reference(session(scenes=40).untouched_v)
        frames = session(scenes=40).frames_v
        results.append([core.reconstruct(frame, touches=False) for frame in frames])
    images, above = [], []
    for every, some in zip(*results, strict=True):
        images.append(
            np.abs(every.solver_image - some.solver_image).max() / np.abs(every.solver_image).max()
        )
        costs = [
            r.info.residual**2 / 2 + r.info.lambda_ * np.abs(r.coefficients).sum()
            for r in (every, some)
        ]
        above.append((costs[1] - costs[0]) / (every.info.data_norm**2 / 2))
    assert max(above) < 1e-3
    assert np.quantile(images, 0.5) < 0.005 and np.quantile(images, 0.9) < 0.06
    assert max(images) < 0.15
