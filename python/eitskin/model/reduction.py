"""The reduction of a Jacobian: it is folded by reciprocity, its columns are scaled, its rows are
whitened, and it is truncated to a rank.

With A = J D, D = diag(|j_k|^-p), and its singular value decomposition A = U diag(s) V':

    P = diag((s_i^2 + mu s_1^2)^-1/2) U'                  whitens the data: y = P d
    S = P A = diag(s_i / sqrt(s_i^2 + mu s_1^2)) V'       the stored matrix

The greatest eigenvalue of S S' is 1 / (1 + mu). So |P d - S g|^2 is the misfit of J D g in a metric
that gives weak directions equal weight down to the regularisation mu, and a first-order solver with
step 1 needs few iterations. This is Tikhonov-regularised whitening, a preconditioner on the data
side.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.skin.protocol import Reciprocity

DEFAULT_REGULARISATION = 1e-2
DEFAULT_COLUMN_POWER = 0.5
MAX_REGULARISATION = 1e6


@dataclass(frozen=True, eq=False)
class Reduction:
    """The reduction of a folded Jacobian (k, n) to rank r.

    ``projection`` is P (r, k), ``sensitivity`` is S (r, n), ``column_weight`` is the diagonal of D
    (n,) in S/m per coefficient, and ``singular_values`` are all those of A, descending.
    """

    projection: FloatArray
    sensitivity: FloatArray
    column_weight: FloatArray
    singular_values: FloatArray


def fold_rows(values: npt.ArrayLike, fold: Reciprocity) -> FloatArray:
    """Return the mean of each row and its reciprocal row, with its sign: (m, ...) becomes (k,
    ...)."""
    rows = np.asarray(values, dtype=np.float64)
    sign = fold.sign.reshape(-1, *[1] * (rows.ndim - 1))
    paired = (fold.second >= 0).reshape(sign.shape)
    return np.where(paired, 0.5 * (rows[fold.first] + sign * rows[fold.second]), rows[fold.first])


def reduce_jacobian(
    jacobian: npt.ArrayLike,
    rank: int,
    *,
    regularisation: float = DEFAULT_REGULARISATION,
    column_power: float = DEFAULT_COLUMN_POWER,
) -> Reduction:
    """Reduce a folded Jacobian (k, n) to ``rank`` rows. ``regularisation`` is mu and
    ``column_power`` is p, both without unit.

    Raises:
        UsageError: the Jacobian is zero or not finite, or an argument is out of range.
    """
    j = np.asarray(jacobian, dtype=np.float64)
    if j.ndim != 2 or not np.isfinite(j).all():
        raise UsageError(
            "reduction: the Jacobian must be a finite matrix; check the skin's conductivity and"
            " mesh"
        )
    if not 1 <= rank <= min(j.shape):
        raise UsageError(f"reduction: rank = {rank} is out of range; use 1 to {min(j.shape)}")
    if not (0 <= regularisation <= MAX_REGULARISATION and 0 <= column_power <= 1):
        raise UsageError(
            f"reduction: the regularisation must be within 0 to {MAX_REGULARISATION:g} and the"
            " column power within 0 to 1"
        )
    norm = np.linalg.norm(j, axis=0)
    if not norm.max() > 0:
        raise UsageError("reduction: the Jacobian is zero; no pixel would be seen")
    # a pixel without any sensitivity gets a finite weight; its coefficient stays zero anyway
    weight = np.maximum(norm, 1e-6 * norm.max()) ** -column_power
    u, s, vt = np.linalg.svd(j * weight, full_matrices=False)
    denominator = np.sqrt(s[:rank] ** 2 + regularisation * s[0] ** 2)
    if not denominator.min() > 0:
        raise UsageError(
            f"reduction: rank = {rank} exceeds the rank of the Jacobian, and the regularisation is"
            " 0; lower the rank or raise the regularisation"
        )
    return Reduction(
        projection=u[:, :rank].T / denominator[:, None],
        sensitivity=(s[:rank] / denominator)[:, None] * vt[:rank],
        column_weight=weight,
        singular_values=s,
    )


def spectral_norm_squared(sensitivity: npt.ArrayLike) -> float:
    """Return the greatest eigenvalue of S S' for S (r, n): the Lipschitz constant of the
    gradient."""
    s = np.asarray(sensitivity, dtype=np.float64)
    return float(np.linalg.eigvalsh(s @ s.T)[-1])


def noise_gain(projection: npt.ArrayLike, sensitivity: npt.ArrayLike) -> float:
    """Return the greatest standard deviation over pixels of S' P n for unit white noise n on the
    folded rows, with P (r, k) and S (r, n)."""
    through = np.asarray(projection, dtype=np.float64).T @ np.asarray(sensitivity, dtype=np.float64)
    return float(np.linalg.norm(through, axis=0).max())
