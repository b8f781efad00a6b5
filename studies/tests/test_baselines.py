"""Baselines against closed forms solved densely, and FISTA against another solver's optimum."""

import numpy as np
import pytest

from eitskin.errors import FrameError, UsageError
from eitskin_studies.compare import baselines

GENERATOR = np.random.default_rng(11)
J = GENERATOR.normal(size=(20, 35)) @ np.diag(np.geomspace(1, 0.05, 35))
DV = GENERATOR.normal(size=(4, 20))


def test_back_projection_divides_by_the_sensitivity():
    image = baselines.back_projection(J).reconstruct(DV)
    expected = [[J[:, j] @ dv / np.abs(J[:, j]).sum() for j in range(35)] for dv in DV]
    assert image == pytest.approx(np.array(expected))
    matched = [[float(J[:, j] @ dv / np.sqrt(J[:, j] @ J[:, j])) for j in range(35)] for dv in DV]
    assert baselines.back_projection(J, 2).reconstruct(DV) == pytest.approx(np.array(matched))
    blind = J.copy()
    blind[:, 3] = 0
    assert (baselines.back_projection(blind).reconstruct(DV)[:, 3] == 0).all()


@pytest.mark.parametrize("strength", [1e-4, 1e-2, 1.0])
def test_gauss_newton_solves_the_normal_equations(strength):
    a = strength * np.linalg.eigvalsh(J.T @ J).max()
    expected = np.linalg.solve(J.T @ J + a * np.eye(35), J.T @ DV.T).T
    found = baselines.gauss_newton(J, strength).reconstruct(DV)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("exponent", [0.5, 1.0])
def test_noser_solves_the_weighted_normal_equations(exponent):
    prior = np.diag(J.T @ J) ** exponent
    a = 0.01 * np.linalg.eigvalsh(J.T @ J).max()
    expected = np.linalg.solve(J.T @ J + a * np.diag(prior / prior.mean()), J.T @ DV.T).T
    found = baselines.noser(J, 0.01, exponent).reconstruct(DV)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-10)
    scaled = 1e6 * baselines.noser(J * 1e6, 0.01, exponent).reconstruct(DV)  # free of units
    assert scaled == pytest.approx(found, rel=1e-7, abs=1e-10)


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_conjugate_gradient_minimises_over_the_krylov_space(steps):
    """After k steps CGLS has the least |J x - dv| over span{(J'J)^i J'dv, i < k}."""
    image = baselines.ConjugateGradient(J, steps).reconstruct(DV)
    for dv, x in zip(DV, image, strict=True):
        basis = [J.T @ dv]
        for _ in range(steps - 1):
            basis.append(J.T @ (J @ basis[-1]))
        space, _ = np.linalg.qr(np.array(basis).T)
        best = space @ np.linalg.lstsq(J @ space, dv, rcond=None)[0]
        assert x == pytest.approx(best, abs=1e-7)


def test_conjugate_gradient_ends_at_the_solution_and_stays():
    tall = J[:, :8]
    exact = np.linalg.lstsq(tall, DV.T, rcond=None)[0].T
    for steps in (8, 40):
        found = baselines.ConjugateGradient(tall, steps).reconstruct(DV)
        assert found == pytest.approx(exact, abs=1e-8)
    assert (baselines.ConjugateGradient(J, 5).reconstruct(np.zeros((1, 20))) == 0).all()


@pytest.mark.parametrize("signed", [False, True])
def test_fista_reaches_the_optimum_of_another_solver(signed):
    from sklearn import linear_model

    method = baselines.PlainFista(J, 6000, 0.1, signed)
    images, lambdas = method.reconstruct(DV), method.lambdas(DV)
    for dv, x, lam in zip(DV, images, lambdas, strict=True):
        lasso = linear_model.Lasso(
            alpha=lam / 20, fit_intercept=False, positive=not signed, tol=1e-12, max_iter=10**6
        )
        best = lasso.fit(J, dv).coef_

        mine, its = (
            0.5 * float(((J @ z - dv) ** 2).sum()) + lam * float(np.abs(z).sum()) for z in (x, best)
        )
        assert mine == pytest.approx(its, rel=1e-8)
        assert x == pytest.approx(best, abs=1e-4)
        assert 0 < np.count_nonzero(best) < 20


def test_fista_optimality_and_lambda_max():
    method = baselines.PlainFista(J, 8000, 0.3)
    x = method.reconstruct(DV)
    slope = (DV - x @ J.T) @ J
    lam = method.lambdas(DV)[:, None]
    assert (x >= 0).all()
    assert (slope <= lam * (1 + 1e-5)).all()
    assert np.abs((slope - lam) * (x > 1e-9)).max() < 1e-5 * lam.max()
    almost = baselines.PlainFista(J, 200, 0.9999)
    assert all(np.count_nonzero(row) <= 1 for row in almost.reconstruct(DV))


def test_fista_iterations_follow_the_paper():
    """Two iterations written out: x1 from 0; momentum (t1 - 1) / t2 is 0 at first, (t2 - 1) / t3
    then."""
    dv = DV[:1]
    step, lam = 1 / np.linalg.norm(J, 2) ** 2, baselines.PlainFista(J, 1, 0.1).lambdas(dv)[0]

    def prox(y: np.ndarray) -> np.ndarray:
        return np.maximum(y - step * ((y @ J.T - dv) @ J) - step * lam, 0)

    x1 = prox(np.zeros((1, 35)))
    x2 = prox(x1)
    t2 = (1 + 5**0.5) / 2
    t3 = (1 + (1 + 4 * t2**2) ** 0.5) / 2
    x3 = prox(x2 + (t2 - 1) / t3 * (x2 - x1))
    for k, x in enumerate((x1, x2, x3), start=1):
        assert baselines.PlainFista(J, k, 0.1).reconstruct(dv) == pytest.approx(x, abs=1e-13)


@pytest.mark.parametrize(
    "method",
    [
        baselines.back_projection(J),
        baselines.gauss_newton(J, 0.1),
        baselines.noser(J, 0.1),
        baselines.ConjugateGradient(J, 4),
        baselines.PlainFista(J, 30, 0.05),
        baselines.PlainFista(J, 5, 0.1, True),
    ],
    ids=lambda method: method.name,
)
def test_nothing_gives_nothing_and_many_frames_are_as_one_by_one(method):
    assert (method.reconstruct(np.zeros(20)) == np.zeros((1, 35))).all()
    each = np.concatenate([method.reconstruct(dv) for dv in DV])
    assert method.reconstruct(DV) == pytest.approx(each, abs=1e-12)


def test_bad_frames_and_parameters_are_refused():
    method = baselines.gauss_newton(J, 0.1)
    with pytest.raises(FrameError, match="20 rows"):
        method.reconstruct(np.zeros((2, 19)))
    broken = DV.copy()
    broken[2, 0] = np.inf
    with pytest.raises(FrameError, match="frame 2"):
        method.reconstruct(broken)
    with pytest.raises(UsageError, match="above 0"):
        baselines.gauss_newton(J, 0.0)
    with pytest.raises(UsageError, match="ratio"):
        baselines.PlainFista(J, 10, 1.5)
    blind = J.copy()
    blind[:, 3] = 0
    with pytest.raises(UsageError, match="pixel 3"):
        baselines.noser(blind, 0.1)


def test_total_variation_of_a_step_brings_both_levels_together():
    """Without a forward model, the edges of a step between two halves of k x k pixels cost k times
    its height, so that each half moves by weight k / (k k / 2)."""
    k, weight = 6, 0.05
    number = np.arange(k * k).reshape(k, k)
    step = np.where(np.arange(k) < k // 2, 0.3, 1.0) * np.ones((k, 1))
    method = baselines.TotalVariation(
        np.eye(k * k), baselines.neighbours(number), weight, iterations=2000
    )
    (image,) = method.reconstruct(step.reshape(1, -1))
    moved = 2 * weight / k
    expected = np.where(step > 0.5, 1.0 - moved, 0.3 + moved)
    assert image.reshape(k, k) == pytest.approx(expected, abs=1e-6)
    assert (method.reconstruct(-step.reshape(1, -1)) == 0).all()


def test_edges_are_between_kept_pixels_and_weights_are_above_0():
    edges = baselines.neighbours(np.array([[0, 1], [-1, 2]])).toarray()
    assert edges.tolist() == [[-1, 1, 0], [0, -1, 1]]
    with pytest.raises(UsageError, match="weight above 0"):
        baselines.TotalVariation(np.eye(3), edges, 0.0)
