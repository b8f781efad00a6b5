"""From folded data to whitened data, for the rows that a frame has and the noise that it has.

docs/design/oracle.md, "Whitening", has the formulas and their names.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core import constants_table as limits
from eitskin.model.model import Model


@dataclass(frozen=True, eq=False)
class Whitening:
    """The solver minimises |M d - S x|^2. ``data`` is M (r, k), with zero columns for folds that
    are not in use, and ``seen`` is S (r, n).

    ``regularisation`` mu; ``noise_ratio``: how much more white noise on the folds raises max(S'y)
    than with the stored model and all rows. ``ignored`` (r, any number): columns are directions in
    which folds without data would move y; they are projected out.
    """

    data: FloatArray
    seen: FloatArray
    regularisation: float
    noise_ratio: float
    ignored: FloatArray

    @property
    def noise(self) -> float:
        """The root of the mean square that unit white noise on the folds gives S'y, but for the
        number of pixels."""
        return float(np.linalg.norm(self.seen.T @ self.data))


def whitening(model: Model, known: BoolArray, asked: float) -> Whitening:
    """For the folds where ``known`` (k,), and noise that asks for a regularisation of ``asked``."""
    if model.row_form is not None:
        return _of_physics(model, known, min(asked, limits.MAX_REGULARISATION))
    lost = int((~known).sum())
    if model.precision is not None and 0 < lost <= min(model.rank, len(known) - model.rank):
        return _of_teaching(model, known)
    p = model.projection.astype(float)
    return Whitening(p * known, model.sensitivity, 0.0, 1.0, p[:, ~known])


def singular(model: Model) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """U (k, r), s (r,), diag(s) V' (r, n) of the Jacobian that the model was made of, and mu."""
    assert model.row_form is not None
    p, stored = model.projection.astype(float), model.sensitivity
    w = np.linalg.norm(p, axis=1)
    s = np.linalg.norm(stored, axis=1) / w
    return (p / w[:, None]).T, s, stored / w[:, None], model.row_form.mu


def _of_physics(model: Model, known: BoolArray, asked: float) -> Whitening:
    """With J_o the known rows of the Jacobian, the metric of their data is (J_o J_o' + mu s_1^2)^-1
    on the range of J_o, scaled so that the strongest direction keeps its weight."""
    assert model.row_form is not None
    mu = model.row_form.mu
    of_all = max(asked, mu)
    none = np.zeros((model.rank, 0))
    if of_all == mu and known.all():
        return Whitening(model.projection.astype(float), model.sensitivity, mu, 1.0, none)
    stored = float(np.linalg.norm(model.sensitivity.T @ model.projection.astype(float)))
    whole = _root_of_metric(model, np.ones_like(known), of_all, 0.0)
    all_ratio = whole.noise / stored if of_all > mu else 1.0
    if known.all():
        return Whitening(whole.data, whole.seen, of_all, all_ratio, none)
    left = float(known.mean())
    lowered = max(left**limits.REST_POWER, limits.MIN_REGULARISATION_FRACTION) * mu
    raised = max(lowered, left * asked, limits.MIN_REGULARISATION)
    part = _root_of_metric(model, known, raised, limits.LOST * raised)
    ratio = all_ratio * float(part.noise / stored / all_ratio) ** limits.NOISE_POWER
    return Whitening(part.data, part.seen, raised, ratio, none)


def _root_of_metric(model: Model, known: BoolArray, mu: float, lost: float) -> Whitening:
    """``lost``: each singular direction also counts as measured to be zero, with the root of this
    weight: a direction that no row sees stays near zero."""
    u, s, sv, _ = singular(model)
    q, t = np.linalg.qr(np.vstack([u[known], np.sqrt(lost) * np.eye(len(s))]))
    metric = (t * s**2) @ t.T + mu * s.max() ** 2 * np.eye(len(s))
    values, vectors = np.linalg.eigh(metric)
    kept = np.linalg.norm(model.sensitivity[np.argmax(s)]) ** 2 * (1 + mu)
    kept *= 1.0 if known.all() else limits.STEP_MARGIN / (1 + lost)
    root = np.sqrt(kept) * (vectors / np.sqrt(values)) @ vectors.T
    data = np.zeros((len(s), len(known)))
    data[:, known] = root @ q[: known.sum()].T
    return Whitening(data, root @ t @ sv, mu, 1.0, np.zeros((len(s), 0)))


def covariance(model: Model) -> FloatArray:
    """C (k, k) of the folded rows' noise of a taught model, in the unit that makes P C P' = I."""
    count = len(model.fold.first)
    lower = np.zeros((count, count))
    lower[np.tril_indices(count)] = model.precision
    return np.asarray(np.linalg.inv(lower + np.tril(lower, -1).T))


def _of_teaching(model: Model, known: BoolArray) -> Whitening:
    """Noise of covariance C, and answers J = C P' S: the metric of the known rows is (C_oo)^-1 on
    the range of J_o, the generalised least squares of the rows that are left."""
    c, p = covariance(model), model.projection.astype(float)
    answers = (c @ p.T)[known]  # J_o = answers @ S
    values, vectors = np.linalg.eigh(c[np.ix_(known, known)])
    whiten = (vectors / np.sqrt(values)) @ vectors.T
    q, t = np.linalg.qr(whiten @ answers)
    data = np.zeros((model.rank, len(known)))
    data[:, known] = q.T @ whiten
    return Whitening(data, t @ model.sensitivity, 0.0, 1.0, p[:, :0])


def project_out(directions: FloatArray, least: float) -> tuple[FloatArray, int]:
    """Return Q (r, r), which projects out the span of the columns of ``directions`` (r, any), and
    the dimension of that span. A column counts as dependent if at most the fraction ``least`` of
    its square is outside the span of the others."""
    basis = np.zeros((len(directions), 0))
    for one in directions.T:
        left = one - basis @ (basis.T @ one)
        left = left - basis @ (basis.T @ left)
        if basis.shape[1] < len(one) and left @ left > least * (one @ one) > 0:
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
    return np.eye(len(directions)) - basis @ basis.T, basis.shape[1]
