"""Both solvers run to a small gap against scikit-learn's coordinate descent: one optimum, and the
gap bounds the error."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options
from eitskin.model.options import default_options
from eitskin.solve.reconstructor import Reconstructor
from eitskin_reference.fista import fista
from eitskin_reference.frame_stage import orthonormal
from eitskin_reference.problem import check_gap, greatest
from small_models import prebuilt, session, small, small_model

GAP_REL = 1e-6


def objective(s: np.ndarray, y: np.ndarray, x: np.ndarray, lam: float) -> float:
    residual = y - s @ x
    return 0.5 * float(residual @ residual) + lam * float(np.abs(x).sum())


def lasso(s: np.ndarray, y: np.ndarray, lam: float, sign: str) -> np.ndarray:
    """The optimum by another solver; it divides the misfit by the number of rows, so lambda too."""
    from sklearn import linear_model

    turn = -1.0 if sign == "decrease" else 1.0
    solver = linear_model.Lasso(
        alpha=lam / len(y), fit_intercept=False, positive=sign != "both", tol=1e-13, max_iter=10**6
    )
    return np.asarray(turn * solver.fit(turn * s, y).coef_)


def options(sign: str, **changes: object) -> Options:
    own = {"iterations": 100_000, "gap_rel": GAP_REL, "detection_factor": 0.0}
    return replace(default_options(small_model()), sign=sign, **(own | changes))


def problem(
    seed: int, sign: str, share: float, drift: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """S, y and basis of one small frame, and a lambda that is ``share`` of lambda_max."""
    model, s = small_model(), small()
    chosen = options(sign, project_reference=drift)
    engine = Reconstructor(model, engine="numpy", options=chosen)._engine
    engine.set_reference(s.linear.v0_v[None])
    y, basis, _ = engine.frame_stage(s.frames(seed, 1, sign)[0])
    return model.sensitivity, y, basis, share * greatest(model.sensitivity.T @ y, sign)


@pytest.mark.parametrize("drift", [True, False], ids=["project", "keep"])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("sign", ["increase", "decrease", "both"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_same_optimum(solver, sign, share, drift):
    """Objectives agree within the gap, predictions S x to its square root."""
    for seed in range(3):
        s, y, basis, lam = problem(seed, sign, share, drift)
        projected = s - basis.T @ (basis @ s)
        best = lasso(projected, y, lam, sign)
        result = fista(s, y, lam, small_model().lipschitz, options(sign, solver=solver), basis)
        assert result.stop == "gap" and result.step_halvings == 0
        scale = 0.5 * float(y @ y)
        values = [objective(projected, y, x, lam) for x in (result.x, best)]
        assert -1e-10 * scale <= values[0] - values[1] <= result.certificate.gap <= GAP_REL * scale
        # strong convexity in S x: |S x - S x*|^2 / 2 <= f(x) - f*
        apart = np.linalg.norm(projected @ (result.x - best))
        assert apart <= np.sqrt(2 * result.certificate.gap) * (1 + 1e-6)
        assert apart < 2e-3 * np.linalg.norm(y)
        if sign != "both":
            assert (np.sign(result.x) * (1 if sign == "increase" else -1) >= 0).all()


@pytest.mark.parametrize("sign", ["increase", "both"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_gap_bounds_the_error_all_the_way(solver, sign):
    """At every number of iterations the reported gap is at least what the objective lacks, and
    shrinks over the run."""
    s, y, basis, lam = problem(5, sign, 0.03, True)
    projected = s - basis.T @ (basis @ s)
    best = objective(projected, y, lasso(projected, y, lam, sign), lam)
    gaps = []
    for iterations in (1, 2, 5, 10, 30, 60, 100, 300, 1000):
        run = options(sign, solver=solver, iterations=iterations, gap_rel=0.0)
        result = fista(s, y, lam, small_model().lipschitz, run, basis)
        assert result.iterations == iterations
        lacks = objective(projected, y, result.x, lam) - best
        assert result.certificate.gap >= lacks - 1e-12 * best
        gaps.append(result.certificate.gap)
    # the working set's gap counts what the columns outside would do at the next look
    assert gaps[-1] < (1e-3 if solver == "fista" else 1e-2) * gaps[0]
    assert gaps[5] < (0.05 if solver == "fista" else 0.25) * gaps[0]


def test_the_gap_is_that_of_the_dual_point():
    """The sum of terms that are not negative equals primal minus dual objective at the scaled
    residual."""
    s, y, basis, lam = problem(6, "both", 0.1, False)
    basis = np.zeros((0, len(y)))
    x = np.random.default_rng(2).normal(size=s.shape[1]) * 1e-3
    gap, value, residual = check_gap(s, y, x, s @ x, lam, "both", basis)
    r = y - s @ x
    left = y - min(1.0, lam / np.abs(s.T @ r).max()) * r
    primal = objective(s, y, x, lam)
    assert gap == pytest.approx(primal - 0.5 * (y @ y - left @ left), rel=1e-9)
    assert value == pytest.approx(primal)
    assert residual == pytest.approx(np.linalg.norm(r))


@pytest.mark.parametrize("width", ["float64", "float32"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_core_stops_at_the_gap(solver, width):
    """C run to a gap on simulated frames: its coefficients are as near to the optimum as it
    says."""
    model, blob = prebuilt()
    gap_rel = 1e-6 if width == "float64" else 1e-4
    engine = CoreEngine(blob, width)
    own = {"solver": solver, "iterations": 100_000, "gap_rel": gap_rel}
    engine.set_options(replace(default_options(model), project_reference=False, **own))
    frames = session().as_frames()
    engine.set_reference(frames.reference_voltage_v)
    for frame in frames.voltage_v[:5]:
        result = engine.reconstruct(frame, touches=False)
        assert result.info.stop == "gap" and result.info.gap_rel <= gap_rel
        s, lam = model.sensitivity, result.info.lambda_
        y = engine.reduced_data()[: model.rank].astype(np.float64)
        best = objective(s, y, lasso(s, y, lam, "increase"), lam)
        above = objective(s, y, result.coefficients.astype(np.float64), lam) - best
        rounding = 1e-12 if width == "float64" else 1e-6
        assert -rounding * best <= above <= result.info.gap * (1 + 1e-3) + rounding * best
        start = 0.5 * result.info.data_norm**2
        assert result.info.gap == pytest.approx(result.info.gap_rel * start, rel=1e-3)


def test_orthonormal_basis():
    generator = np.random.default_rng(4)
    a, b = generator.normal(size=(2, 20))
    basis = orthonormal([a, 2 * a, b, a - b, np.zeros(20)], 20)
    assert basis.shape == (2, 20)
    assert basis @ basis.T == pytest.approx(np.eye(2), abs=1e-14)
    for v in (a, b):
        assert v - basis.T @ (basis @ v) == pytest.approx(0, abs=1e-13)
