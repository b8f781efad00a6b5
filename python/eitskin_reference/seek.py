"""The numpy reference of the discs sought in the data in csrc/src/touch/seek.c: the same steps,
written for reading."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.options_table import SIGNS
from eitskin_reference.constants_table import (
    CENTRE_SHARE,
    CENTRE_SPREAD,
    SEEK_EXCHANGED,
    SEEK_GAIN,
    SEEK_ROUNDS,
    SEEK_SWEEPS,
)
from eitskin_reference.disc_fit import Disc, Fit


def seek(fit: Fit) -> None:
    """Discs where what is left answers most, one after the other."""
    fit.discs = []
    while len(fit.discs) < fit.options.max_touches:
        before, left = list(fit.discs), fit.left()
        _add(fit)
        for _ in range(SEEK_ROUNDS if 1 < len(fit.discs) <= SEEK_EXCHANGED else 0):
            if not _exchange(fit):
                break
        explained, least = fit.explained(), fit.options.touch_min_fraction
        alone = len(fit.discs) == 1
        if not (explained > 0).all() or (
            not alone and (min(explained) < least or left - fit.left() < least * fit.whole)
        ):
            fit.discs = before
            return


def _of_sign(fit: Fit, answer: FloatArray) -> FloatArray:
    """How large ``answer`` is (n,), of a sign that is looked for."""
    return {SIGNS[0]: answer, SIGNS[1]: -answer}.get(fit.options.sign, np.abs(answer))


def _add(fit: Fit) -> None:
    answer = fit.seen.T @ fit.residual()
    size = _of_sign(fit, answer)
    at = int(np.argmax(size)) if size.max() > 0 else 0
    x, y = fit.centres[at].tolist()
    polarity = -1.0 if answer[at] < 0 else 1.0
    fit.discs.append(Disc(x, y, fit.options.touch_seed_radius_mm, 0.0, polarity))
    fit.fit_strengths()
    fit.move_all(SEEK_SWEEPS)


def _exchange(fit: Fit) -> bool:
    found = False
    for k in range(len(fit.discs)):
        before, left = list(fit.discs), fit.left()
        del fit.discs[k]
        fit.fit_strengths()
        _add(fit)
        if fit.left() < SEEK_GAIN * left:
            found = True
        else:
            fit.discs = before
    return found


def centre(fit: Fit, data: FloatArray) -> FloatArray | None:
    """The one disc of an instrument that is far from the model moved to the middle of the blob that
    one regularised step of ``data`` (r,) makes; the covariance of its place, xx, xy, yy (3,), mm^2,
    None where it stays."""
    image = fit.model.column_weight.astype(np.float64) * (fit.seen.T @ data)
    size = _of_sign(fit, image)
    at = int(np.argmax(size))
    if not size[at] > 0:
        return None
    share = image / image[at]
    blob = np.where(share >= CENTRE_SHARE, share, 0.0)
    blob /= blob.sum()
    middle = blob @ fit.centres
    off = fit.centres - middle
    before, explained_data = list(fit.discs), fit.data
    x, y = middle.tolist()
    polarity = -1.0 if image[at] < 0 else 1.0
    fit.discs, fit.data = [Disc(x, y, fit.options.touch_seed_radius_mm, 0.0, polarity)], data
    fit.fit_strengths()
    if not fit.explained()[0] > 0:
        fit.discs, fit.data = before, explained_data
        return None
    xx, xy, yy = ((blob * off[:, a]) @ off[:, b] for a, b in ((0, 0), (0, 1), (1, 1)))
    own = fit.model.grid.pixel_mm**2 / 12
    return CENTRE_SPREAD * np.array([xx + own, xy, yy + own])
