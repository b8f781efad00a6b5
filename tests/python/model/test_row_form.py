"""The whitening of a model by rows: the values that are read from P and S are those with which they
were made."""

import numpy as np
import pytest

from eitskin.model.reduction import reduce_jacobian
from eitskin.model.row_form import RowForm, decode_row_form, row_form
from eitskin.model.storage import store

GENERATOR = np.random.default_rng(23)
J = GENERATOR.normal(size=(12, 30)) @ np.diag(np.geomspace(1, 0.1, 30))
RANK, MU = 9, 0.05


def reduced(mu: float = MU) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P (r, m) as float32, S (r, n), and the singular values of the scaled Jacobian."""
    made = reduce_jacobian(J, RANK, regularisation=mu)
    return made.projection.astype(np.float32), made.sensitivity, made.singular_values[:RANK]


def form_of(mu: float = MU, storage: str = "f32") -> RowForm:
    projection, sensitivity, _ = reduced(mu)
    form = row_form(projection, store(sensitivity, storage))
    assert form is not None
    return form


def test_the_numbers_are_those_of_the_definition():
    """P = diag(w) U' and S = diag(s w) V', w = (s^2 + mu s_1^2)^-1/2."""
    projection, sensitivity, s = reduced()
    form, w = form_of(), (s**2 + MU * s[0] ** 2) ** -0.5
    assert form.mu == pytest.approx(MU, rel=1e-4)
    assert form.s1 == pytest.approx(s[0], rel=1e-5)
    assert form.s1_square == pytest.approx((sensitivity[0] ** 2).sum(), rel=1e-5)
    assert form.scale == pytest.approx(1 / (w * s[0]), rel=1e-5)
    assert form.strength == pytest.approx((s / s[0]) ** 2, rel=1e-4)
    assert form.energy == pytest.approx((projection.astype(float) ** 2).sum(axis=1), rel=1e-5)
    assert form.square == pytest.approx(s**2, rel=1e-4)


def test_without_regularisation_mu_is_zero():
    assert form_of(mu=0.0).mu == pytest.approx(0.0, abs=1e-6)


def test_it_is_read_as_written():
    projection, _, _ = reduced()
    form = form_of()
    again = decode_row_form(form.encode(), projection, "made")
    assert again.encode() == form.encode()


def test_rows_that_are_not_orthogonal_have_no_form():
    projection, sensitivity, _ = reduced()
    turned = projection.copy()
    turned[0] += 0.1 * turned[1]
    assert row_form(turned, store(sensitivity, "f32")) is None


def test_rows_of_another_weight_have_no_form():
    projection, sensitivity, _ = reduced()
    assert row_form(projection, store(1.5 * sensitivity, "f32")) is None
