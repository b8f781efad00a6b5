"""The numpy reference of csrc/src/evidence/pair.c: whether a disc may be two touches."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_reference.constants_table import (
    PAIR_BOTH,
    PAIR_BULGE,
    PAIR_DIPOLE,
    PAIR_GROWTH,
    PAIR_GROWTH_2,
    PAIR_MIN_BULGE,
    PAIR_MIN_VARIANCE,
    PAIR_OFFSET,
)


def pair_scores(offsets: FloatArray, step: FloatArray, variance: FloatArray) -> FloatArray:
    """Log odds of each disc (k,), from how far its parameters are from their priors' middles
    ``offsets`` (k, p), the ``step`` (k p,) of the linearisation and the ``variance`` of it (k p,);
    -1 where discs have no shape."""
    count, parameters = offsets.shape
    if parameters < 8:
        return np.full(count, -1.0)
    at = (offsets + step.reshape(count, -1))[:, 3:]
    deviation = np.sqrt(np.maximum(variance.reshape(count, -1)[:, 3:], PAIR_MIN_VARIANCE))
    bulge, dipole = np.hypot(at[:, 1], at[:, 2]), np.hypot(at[:, 3], at[:, 4])
    along = (at[:, 1] * at[:, 3] + at[:, 2] * at[:, 4]) / np.maximum(bulge, PAIR_MIN_BULGE)
    score = PAIR_OFFSET + PAIR_BULGE * bulge / deviation[:, 1]
    score += PAIR_DIPOLE * along / deviation[:, 3] + PAIR_BOTH * bulge * dipole
    return np.asarray(score + PAIR_GROWTH * at[:, 0] + PAIR_GROWTH_2 * at[:, 0] ** 2)


def pair_lines(offsets: FloatArray, step: FloatArray) -> FloatArray:
    """The unit vector (k, 2) along which each disc's edge bulges: two in its place would lie on
    that line; zeros where discs have no shape. Arguments as of ``pair_scores``."""
    count, parameters = offsets.shape
    if parameters < 8:
        return np.zeros((count, 2))
    bulge = (offsets + step.reshape(count, -1))[:, 4:6]
    angle = np.arctan2(bulge[:, 1], bulge[:, 0]) / 2
    return np.column_stack([np.cos(angle), np.sin(angle)])
