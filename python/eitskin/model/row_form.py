"""The whitening of a model, row by row (section WHIT of a .eitm file). The core needs it to whiten
again for fewer rows or more noise, and to find data outside the model's range.

The numbers are calculated in float32 from the stored P and S, in the order of the rows, so every
core, on a board or a host, uses the same numbers.
"""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import FORM_MAX_NORM, FORM_TOLERANCE, FORM_WEIGHT_TOLERANCE
from eitskin.errors import ModelError
from eitskin.model.storage import StoredMatrix, stride_for

Float32s = npt.NDArray[np.float32]

ORTHOGONAL = 1e-5  # greatest cosine between two rows of P that count as orthogonal
HEAD = struct.Struct("<3f4x")
HUGE = float(np.float32(1e30))  # as the C core compares
TINY = float(np.finfo(np.float32).tiny)


@dataclass(frozen=True, eq=False)
class RowForm:
    """The factors of P = diag(w) U' and S = diag(s w) V' with w = (s^2 + mu s_1^2)^-1/2.

    ``mu`` is the regularisation, ``s1`` is s_1 in the units of 1 / P, and ``s1_square`` is |S_1|^2.
    By row, (r,) float32: ``scale`` is 1 / (w_i s_1), ``strength`` is (s_i / s_1)^2, ``energy`` is
    |P_i|^2, ``square`` is s_i^2.
    """

    mu: float
    s1: float
    s1_square: float
    scale: Float32s
    strength: Float32s
    energy: Float32s
    square: Float32s

    def encode(self) -> bytes:
        rows = np.zeros((4, stride_for(len(self.scale))), dtype="<f4")
        rows[:, : len(self.scale)] = self.scale, self.strength, self.energy, self.square
        return HEAD.pack(self.mu, self.s1, self.s1_square) + rows.tobytes()

    def fits(self, projection: Float32s) -> bool:
        """Return whether a reader accepts this form for P = ``projection`` (r, k): each number is
        within its range, and the numbers of a row agree."""
        wide = [v.astype(np.float64) for v in (self.scale, self.strength, self.energy, self.square)]
        scale, strength, energy, square = wide
        s1, sums = self.s1**2, np.sum(projection.astype(np.float64) ** 2, axis=1)
        return bool(
            0 <= self.mu <= HUGE
            and 1e-15 <= self.s1 <= 1e15
            and TINY <= self.s1_square <= FORM_MAX_NORM
            and all(np.isfinite(row).all() and (row >= 0).all() for row in wide)
            and min(scale.min(), energy.min()) >= TINY
            and max(scale.max(), energy.max()) <= HUGE
            and _near(sums, energy, FORM_TOLERANCE)
            and _near(scale**2 * s1 * energy, 1, FORM_TOLERANCE)
            and _near((square + self.mu * s1) * energy, 1, FORM_WEIGHT_TOLERANCE)
            and (np.abs(strength * s1 - square) <= FORM_TOLERANCE * s1).all()
            and _near(square.max(), s1, FORM_TOLERANCE)
        )


def _near(values: npt.ArrayLike, wanted: npt.ArrayLike, tolerance: float) -> bool:
    wanted = np.asarray(wanted)
    return bool((np.abs(values - wanted) <= tolerance * wanted).all())


def decode_row_form(content: bytes, projection: Float32s, where: str) -> RowForm:
    """Return the form in section WHIT of a model with P = ``projection`` (r, k)."""
    rank = len(projection)
    stride = stride_for(rank)
    if len(content) != HEAD.size + 16 * stride:
        raise ModelError(
            f"{where}: holds section 'WHIT' of {len(content)} bytes instead of"
            f" {HEAD.size + 16 * stride}; build the model again"
        )
    rows = np.frombuffer(content, dtype="<f4", offset=HEAD.size).reshape(4, stride)[:, :rank]
    form = RowForm(*HEAD.unpack_from(content), *rows)
    if not form.fits(projection):
        raise ModelError(
            f"{where}: holds a section 'WHIT' that does not fit section 'REDU'; build the model"
            " again"
        )
    return form


def row_form(projection: Float32s, stored: StoredMatrix) -> RowForm | None:
    """Return the form of P (r, k) and of S as stored, or None if they do not have this form."""
    wide = projection.astype(np.float64)
    lengths = np.linalg.norm(wide, axis=1)
    if not lengths.min() > 0:
        return None
    rows = wide / lengths[:, None]
    if np.abs(rows @ rows.T - np.eye(len(rows))).max() > ORTHOGONAL:
        return None
    with np.errstate(all="ignore"):
        form = _taken_apart(projection, stored)
    return form if form is not None and form.fits(projection) else None


def _taken_apart(projection: Float32s, stored: StoredMatrix) -> RowForm | None:
    """Calculate the factors, in float32 throughout; return None unless |S_i|^2 + mu s_1^2 w_i^2 is
    1."""
    one, greatest = np.float32(1), np.abs(projection).max()
    energy = _sums_of_squares(projection)
    w2, s2 = (_sums_of_squares(rows) for rows in (projection / greatest, _decoded(stored, energy)))
    weakest, strongest = int(np.argmax(w2)), int(np.argmax(s2 / w2))
    per_square = (one - s2[weakest]) / w2[weakest]  # mu s_1^2
    top, top_w2 = s2[strongest], w2[strongest]
    fused = (np.float64(per_square) * w2 + s2).astype(np.float32)
    if not (np.abs(fused - one) <= FORM_WEIGHT_TOLERANCE).all():
        return None
    return RowForm(
        mu=float(per_square * top_w2 / top) if per_square > 0 else 0.0,
        s1=float(np.sqrt(top / top_w2) / greatest),
        s1_square=float(top),
        scale=np.sqrt(top_w2 / w2) / np.sqrt(top),
        strength=s2 / w2 * (top_w2 / top),
        energy=energy,
        square=s2 / energy,
    )


def _decoded(stored: StoredMatrix, rows: Float32s) -> Float32s:
    """Return S (r, n) as float32 arithmetic reads it, with as many rows as ``rows``."""
    columns = stored.columns[:, : len(rows)].astype(np.float32)
    return np.asarray((columns if stored.scale is None else stored.scale[:, None] * columns).T)


def _sums_of_squares(rows: Float32s) -> Float32s:
    """Return the sum of squares of each row, by fused multiply-adds in float32, one column after
    another."""
    sums = np.zeros(len(rows), dtype=np.float32)
    for column in rows.astype(np.float64).T:
        sums = (column * column + sums).astype(np.float32)
    return sums
