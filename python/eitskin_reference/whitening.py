"""The numpy reference of csrc/src/frame/whitening.c and regularisation.c: the reduction that a
model would have had without the rows that a frame lacks, or with a higher regularisation."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.model.model import Model
from eitskin_reference.constants_table import (
    LOST,
    MAX_REGULARISATION,
    MIN_REGULARISATION,
    MIN_REGULARISATION_FRACTION,
    NOISE_POWER,
    NOISE_PROBES,
    REST_POWER,
    STEP_MARGIN,
)


@dataclass(frozen=True, eq=False)
class WhitenedForm:
    """The builder's P = diag(w) U' and S = diag(s w) V', with w = (s^2 + mu s_1^2)^-1/2, taken
    apart.

    ``left`` U (k, r); ``scale`` 1 / (w s_1) and ``strength`` (s / s_1)^2, both (r,);
    ``regularisation`` mu; ``square`` |S_1|^2.
    """

    left: FloatArray
    scale: FloatArray
    strength: FloatArray
    regularisation: float
    square: float


@dataclass(frozen=True, eq=False)
class Whitening:
    """For some of the rows, or for all and a raised ``regularisation``: what ``see`` F (r, r) makes
    of S x is to meet what ``data`` (r, r) makes of P d.

    ``noise_ratio``: how much more noise max(S'y) has than with all rows and the model's
    regularisation; ``energy_ratio``: |y|^2 likewise. ``fill`` (k, k): of taught models,
    folded data with those left out filled in from the others.
    """

    see: FloatArray
    data: FloatArray
    noise_ratio: float
    regularisation: float
    energy_ratio: float = 1.0
    fill: FloatArray | None = None


def form_of(model: Model) -> WhitenedForm | None:
    """What the model's P and S are made of, as it says; None where it does not."""
    rows = model.row_form
    if rows is None:
        return None
    scale = rows.scale.astype(np.float64)
    return WhitenedForm(
        (model.projection * (scale * rows.s1)[:, None]).T,
        scale,
        rows.strength.astype(np.float64),
        rows.mu,
        rows.s1_square,
    )


def _upper_factor(n: FloatArray, least: float) -> FloatArray:
    """R of n = R'R, pivots held at ``least``, as eits_factor_products."""
    rest, r = n.copy(), np.zeros_like(n)
    for i in range(len(n)):
        r[i, i:] = rest[i, i:] / np.sqrt(max(rest[i, i], least))
        r[i, i] = np.sqrt(max(rest[i, i], least))
        rest -= np.outer(r[i], r[i])
    return r


def filled(model: Model, known: BoolArray) -> Whitening | None:
    """Of a taught model that lacks some folded rows, at most as many as it has directions: they are
    filled in by what the noise of the others makes them expect (csrc/src/frame/rows_out.c)."""
    out = ~known
    if model.precision is None or not 0 < out.sum() <= min(model.rank, len(known) - model.rank):
        return None
    count = len(known)
    precision = np.zeros((count, count))
    precision[np.tril_indices(count)] = model.precision
    precision += np.tril(precision, -1).T
    p = model.projection[:, out].astype(np.float64)
    fill = np.diag(known.astype(np.float64))
    fill[np.ix_(out, known)] = -np.linalg.solve(
        precision[np.ix_(out, out)], precision[np.ix_(out, known)]
    )
    left = np.eye(model.rank) - p @ np.linalg.solve(precision[np.ix_(out, out)], p.T)
    see = _upper_factor(left, LOST**2)
    return Whitening(see, np.asarray(np.linalg.inv(see.T)), 1.0, 0.0, fill=fill)


def whiten(form: WhitenedForm, known: BoolArray, asked: float) -> Whitening | None:
    """The whitening of the folded rows where ``known`` (k,), the noise asking for a regularisation
    of at least ``asked`` for all of them: None for the model's own."""
    least = min(asked, MAX_REGULARISATION)
    of_all = max(least, form.regularisation)
    if not known.all():
        left = float(known.mean())
        regularisation = max(
            form.regularisation * max(left**REST_POWER, MIN_REGULARISATION_FRACTION),
            left * least,
            MIN_REGULARISATION,
        )
        return _of_rest(form, known, regularisation, _noise_of_all(form, of_all))
    return _raised(form, of_all) if of_all > form.regularisation else None


def _raised(form: WhitenedForm, regularisation: float) -> Whitening:
    """Of all rows, with a higher regularisation: a weight for each direction, that of the strongest
    kept."""
    weight = _weights(form, regularisation)
    energy = float(np.sum((weight / form.scale) ** 2) / np.sum(1 / form.scale**2))
    return Whitening(
        np.diag(weight),
        np.diag(weight),
        _noise_of_all(form, regularisation),
        regularisation,
        energy,
    )


def _weights(form: WhitenedForm, regularisation: float) -> FloatArray:
    return np.minimum(
        np.sqrt(form.square * (1 + regularisation) / (form.strength + regularisation)) * form.scale,
        1.0,
    )


def _noise_of_all(form: WhitenedForm, regularisation: float) -> float:
    if not regularisation > form.regularisation:
        return 1.0
    square = form.strength / form.scale**4
    return float(np.sqrt(np.sum(square * _weights(form, regularisation) ** 4) / np.sum(square)))


def _of_rest(
    form: WhitenedForm, known: BoolArray, regularisation: float, noise_of_all: float
) -> Whitening:
    """Of some rows; ``noise_of_all``: the noise ratio of all of them."""
    lost = LOST * regularisation
    unit, missing = np.eye(len(form.scale)), ~known
    # U is orthogonal but for rounding to float32: which rows are summed over shows in the eighth
    # figure
    by_missing = missing.sum() <= known.sum()
    products = (
        unit - form.left[missing].T @ form.left[missing]
        if by_missing
        else form.left[known].T @ form.left[known]
    )
    r = np.linalg.cholesky(products + lost * unit).T
    g = np.linalg.cholesky((r * form.strength) @ r.T + regularisation * unit)
    share = np.sqrt(STEP_MARGIN * form.square * (1 + regularisation) / (1 + lost))
    see = share * np.linalg.solve(g, r * form.scale)
    data = share * np.linalg.solve(g, np.linalg.solve(r.T, np.diag(form.scale)))
    by_rows = _noise_ratio(form, np.linalg.solve(g.T, see), share) / noise_of_all
    return Whitening(see, data, noise_of_all * by_rows**NOISE_POWER, regularisation)


def _noise_ratio(form: WhitenedForm, spread: FloatArray, share: float) -> float:
    """By sign vectors that are orthogonal within each eight directions; ``spread`` is G'^-1 F."""
    i = np.arange(len(form.scale))
    odd = [(i & p ^ (i & p) >> 1 ^ (i & p) >> 2) & 1 for p in range(NOISE_PROBES)]
    probes = (1 - 2 * np.array(odd).T) * (np.sqrt(form.strength) / form.scale)[:, None]
    whole = float(np.sum(form.strength / form.scale**4))
    return float(share * np.sqrt(np.sum((spread @ probes) ** 2) / (NOISE_PROBES * whole)))
