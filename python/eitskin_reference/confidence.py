"""The numpy reference of csrc/src/evidence/confidence.c: what the numbers of the test have meant on
scenes with a truth."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_reference.constants_table import (
    CONFIDENCE_HALF,
    MAX_MOVE,
    MIN_CONFIDENCE,
    MIN_FREEDOM,
    PAIR_ODDS,
    PLACE_APART,
    PLACE_DISTANCE,
    PLACE_FACTOR,
    PLACE_GEOMETRY,
    PLACE_MIN,
)
from eitskin_reference.disc_fit import Fit
from eitskin_reference.evidence import Tested
from eitskin_reference.places import Corrected
from eitskin_reference.problem import orthonormal

PLACE_PARAMETERS = 4  # of a disc: strength, place, radius


def rated(
    tested: Tested, distance: float, tared: Corrected | None, pixel_mm: float
) -> tuple[FloatArray, FloatArray]:
    """For each disc the probability that it is a touch (k,), and the covariance of its place as
    wide as places err: xx, xy, yy (k, 3), mm^2; ``distance`` of the reference from the model's,
    ``tared`` how places are corrected by that, None where they are not."""
    x, y = PLACE_APART * np.clip(tested.apart_mm, -MAX_MOVE * pixel_mm, MAX_MOVE * pixel_mm).T
    least = pixel_mm**2 * PLACE_MIN
    trust, left = (0.0, 0.0) if tared is None else (tared.trust, PLACE_GEOMETRY * tared.left_mm2)
    least += trust * left + (1 - trust) * pixel_mm**2 * PLACE_DISTANCE * distance
    place = PLACE_FACTOR * tested.place_mm2 + np.column_stack([x * x + least, x * y, y * y + least])
    return tested.rise / (tested.rise + CONFIDENCE_HALF), place


def places_by_fit(fit: Fit) -> FloatArray:
    """The covariance of each disc's place, xx, xy, yy (k, 3), mm^2: by the normal equations with
    the strengths of all discs free, times the model's factor; zeros where it has none."""
    rank, factor, count = fit.model.rank, fit.model.place_factor, len(fit.discs)
    out = np.zeros((count, 3))
    if not factor > 0:
        return out
    unit = factor * fit.left() / max(rank - PLACE_PARAMETERS * count, MIN_FREEDOM)
    beside = orthonormal([fit.answers(disc)[0] for disc in fit.discs], rank)
    for k, disc in enumerate(fit.discs):
        slope = disc.change * fit.answers(disc)[1][:2]
        slope -= slope @ beside.T @ beside
        (xx, xy), (_, yy) = slope @ slope.T
        with np.errstate(divide="ignore", invalid="ignore"):
            place = unit / (xx * yy - xy * xy) * np.array([yy, -xy, xx])
        if np.isfinite(place).all() and place[0] > 0 and place[2] > 0:
            out[k] = place
    return out


def miscounted(tested: Tested) -> bool:
    """Whether a disc may be two touches, or none, or the test was cut short."""
    if tested.spent and len(tested.rise) > 0:
        return True
    sure = tested.rise / (tested.rise + CONFIDENCE_HALF)
    return bool((tested.pair > PAIR_ODDS).any() or (sure < MIN_CONFIDENCE).any())
