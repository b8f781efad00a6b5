"""The reduction, compared with its definition: folds, whitening and the greatest eigenvalue."""

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.model.reduction import fold_rows, noise_gain, reduce_jacobian, spectral_norm_squared
from eitskin.skin.protocol import Reciprocity, adjacent, table
from small_models import small

GENERATOR = np.random.default_rng(21)
J = GENERATOR.normal(size=(12, 30)) @ np.diag(np.geomspace(1, 0.02, 30))


def test_fold_takes_the_mean_with_its_sign_and_leaves_single_rows():
    fold = Reciprocity(np.array([0, 1, 3]), np.array([2, -1, 4]), np.array([-1, 1, 1]))
    values = np.array([[1.0, 10.0], [2.0, 20.0], [-3.0, -30.0], [4.0, 40.0], [6.0, 60.0]])
    assert fold_rows(values, fold).tolist() == [[2.0, 20.0], [2.0, 20.0], [5.0, 50.0]]
    assert fold_rows(values[:, 0], fold).tolist() == [2.0, 2.0, 5.0]


def test_reciprocal_rows_turned_round_have_sign_minus_one():
    protocol = table(8, [[0, 1, 4, 5], [5, 4, 0, 1], [2, 3, 6, 7]])
    fold = protocol.reciprocal_pairs()
    found = fold.first.tolist(), fold.second.tolist(), fold.sign.tolist()
    assert found == ([0, 2], [1, -1], [-1, 1])


def test_fold_of_the_forward_model_changes_nothing():
    """Voltages of the forward model obey reciprocity, so folding keeps either row; adjacent 16
    folds 208 to 104."""
    s = small()
    fold = adjacent(16).reciprocal_pairs()
    folded = fold_rows(s.linear.v0_v, fold)
    assert folded.shape == (104,)
    assert folded == pytest.approx(s.linear.v0_v[fold.first], rel=1e-9)
    first = s.linear.jacobian[fold.first]
    assert fold_rows(s.linear.jacobian, fold) == pytest.approx(first, rel=1e-7, abs=1e-12)


@pytest.mark.parametrize("rank", [1, 5, 12])
@pytest.mark.parametrize("power", [0.0, 0.5, 1.0])
def test_projection_of_the_scaled_jacobian_is_the_sensitivity(rank, power):
    r = reduce_jacobian(J, rank, regularisation=1e-2, column_power=power)
    assert (r.projection.shape, r.sensitivity.shape) == ((rank, 12), (rank, 30))
    assert r.column_weight == pytest.approx(np.linalg.norm(J, axis=0) ** -power)
    assert r.projection @ J @ np.diag(r.column_weight) == pytest.approx(r.sensitivity, abs=1e-12)


@pytest.mark.parametrize("regularisation", [0.0, 1e-3, 1e-2, 0.5])
def test_greatest_eigenvalue_is_known_beforehand(regularisation):
    r = reduce_jacobian(J, 12, regularisation=regularisation)
    expected, s = 1 / (1 + regularisation), r.singular_values
    assert spectral_norm_squared(r.sensitivity) == pytest.approx(expected, rel=1e-12)
    assert np.diag(r.sensitivity @ r.sensitivity.T) == pytest.approx(
        s**2 / (s**2 + regularisation * s[0] ** 2)
    )


def test_truncation_keeps_the_first_directions_of_the_whole():
    whole, cut = reduce_jacobian(J, 12), reduce_jacobian(J, 4)
    assert (cut.projection == whole.projection[:4]).all()
    assert (cut.sensitivity == whole.sensitivity[:4]).all()
    assert len(cut.singular_values) == 12 and (np.diff(cut.singular_values) <= 0).all()


def test_noise_gain_is_the_greatest_deviation_over_pixels():
    r = reduce_jacobian(J, 6)
    noise = GENERATOR.normal(size=(20_000, 12))
    spread = (noise @ r.projection.T @ r.sensitivity).std(axis=0)
    assert noise_gain(r.projection, r.sensitivity) == pytest.approx(spread.max(), rel=0.02)


def test_a_pixel_that_no_row_sees_keeps_a_finite_weight_and_no_sensitivity():
    blind = J.copy()
    blind[:, 7] = 0
    r = reduce_jacobian(blind, 5)
    assert np.isfinite(r.column_weight).all()
    assert np.abs(r.sensitivity[:, 7]).max() < 1e-14


@pytest.mark.parametrize(
    ("jacobian", "rank", "changes", "text"),
    [
        (J, 0, {}, "rank = 0 is out of range; use 1 to 12"),
        (J, 13, {}, "rank = 13 is out of range; use 1 to 12"),
        (J, 5, {"regularisation": -0.1}, "regularisation"),
        (J, 5, {"regularisation": float("nan")}, "regularisation"),
        (J, 5, {"regularisation": float("inf")}, "regularisation"),
        (J, 5, {"column_power": 1.5}, "column power"),
        (np.zeros((4, 6)), 2, {}, "is zero"),
        (np.full((4, 6), np.nan), 2, {}, "finite"),
        (np.ones(4), 1, {}, "finite matrix"),
        (np.eye(4, 6) * [1, 1, 0, 0, 0, 0], 3, {"regularisation": 0.0}, "exceeds"),
    ],
)
def test_refusals(jacobian, rank, changes, text):
    with pytest.raises(UsageError, match=text):
        reduce_jacobian(jacobian, rank, **changes)
