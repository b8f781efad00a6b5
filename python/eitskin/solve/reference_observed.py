"""The numpy reference of csrc/src/observed.c: the reduction that a model would have had without the rows that a frame lacks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

ORTHOGONAL = 1e-5
FORM = 0.01
LEAST_FLOOR_SHARE, LEAST_FLOOR = 0.1, 1e-4
LOST = 0.01
NOISE_FROM, MUCH_MISSING = 1 / 740, 0.25
STEP_MARGIN = 0.995
PROBES, NOISE_POWER = 8, 1.25


@dataclass(frozen=True, eq=False)
class Form:
    """The builder's P = diag(w) U' and S = diag(s w) V', with w = (s^2 + mu s_1^2)^-1/2, taken apart.

    ``left`` U (k, r); ``scale`` 1 / (w s_1) and ``strength`` (s / s_1)^2, both (r,); ``floor`` mu; ``square`` |S_1|^2.
    """

    left: FloatArray
    scale: FloatArray
    strength: FloatArray
    floor: float
    square: float


@dataclass(frozen=True, eq=False)
class Whitening:
    """For some of the rows: what ``see`` F (r, r) makes of S x is to meet what ``data`` (r, r) makes of P d.

    ``noise_ratio``: how much more noise max(S'y) has than with all rows.
    """

    see: FloatArray
    data: FloatArray
    noise_ratio: float


def form_of(projection: FloatArray, sensitivity: FloatArray) -> Form | None:
    """What P (r, k) and S (r, n) are made of; None where they have another form."""
    w = np.linalg.norm(projection, axis=1)
    if not w.min() > 0:
        return None
    left = (projection / w[:, None]).T
    squares = np.einsum("ij,ij->i", sensitivity, sensitivity)
    weakest = int(np.argmax(w))
    floor = (1 - squares[weakest]) / w[weakest] ** 2  # mu s_1^2, since |S_i|^2 + mu s_1^2 w_i^2 = 1
    whitened = bool((np.abs(squares + floor * w**2 - 1) <= FORM).all())
    if not whitened or np.abs(left.T @ left - np.eye(len(w))).max() > ORTHOGONAL:
        return None
    s = np.sqrt(squares) / w
    first = int(np.argmax(s))
    return Form(left, 1 / (w * s[first]), (s / s[first]) ** 2, max(0.0, floor / s[first] ** 2), float(squares[first]))


def whiten(form: Form, known: BoolArray, noise: float) -> Whitening:
    """The whitening of the folded rows where ``known`` (k,); ``noise``: rms of a reading's over that of the reference."""
    left = float(known.mean())
    noisy = 1 + min(1.0, (1 - left) / MUCH_MISSING) * max(0.0, noise / NOISE_FROM - 1)
    floor = max(form.floor * max(left**3, LEAST_FLOOR_SHARE) * noisy, LEAST_FLOOR)
    lost = LOST * floor
    unit, missing = np.eye(len(form.scale)), ~known
    # U is orthogonal but for rounding to float32: which rows are summed over shows in the eighth figure
    by_missing = missing.sum() <= known.sum()
    products = unit - form.left[missing].T @ form.left[missing] if by_missing else form.left[known].T @ form.left[known]
    r = np.linalg.cholesky(products + lost * unit).T
    g = np.linalg.cholesky((r * form.strength) @ r.T + floor * unit)
    share = np.sqrt(STEP_MARGIN * form.square * (1 + floor) / (1 + lost))
    see = share * np.linalg.solve(g, r * form.scale)
    data = share * np.linalg.solve(g, np.linalg.solve(r.T, np.diag(form.scale)))
    return Whitening(see, data, _noise_ratio(form, np.linalg.solve(g.T, see), share))


def _noise_ratio(form: Form, spread: FloatArray, share: float) -> float:
    """By sign vectors that are orthogonal within each eight directions; ``spread`` is G'^-1 F."""
    i = np.arange(len(form.scale))
    odd = [(i & p ^ (i & p) >> 1 ^ (i & p) >> 2) & 1 for p in range(PROBES)]
    probes = (1 - 2 * np.array(odd).T) * (np.sqrt(form.strength) / form.scale)[:, None]
    whole = float(np.sum(form.strength / form.scale**4))
    ratio = share * np.sqrt(np.sum((spread @ probes) ** 2) / (PROBES * whole))
    return float(ratio**NOISE_POWER)
