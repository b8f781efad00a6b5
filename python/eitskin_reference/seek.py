"""The numpy reference of the discs sought in the data in csrc/src/touch/seek.c: the same steps,
written for reading."""

from __future__ import annotations

import numpy as np

from eitskin.core.constants_table import (
    SEEK_EXCHANGED,
    SEEK_GAIN,
    SEEK_ROUNDS,
    SEEK_SWEEPS,
)
from eitskin.core.options_table import SIGNS
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


def _add(fit: Fit) -> None:
    answer = fit.seen.T @ fit.residual()
    sign = fit.options.sign
    size = {SIGNS[0]: answer, SIGNS[1]: -answer}.get(sign, np.abs(answer))
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
