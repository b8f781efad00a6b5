"""The numpy reference of csrc/src/evidence/ellipse.c: whether a disc is an ellipse, and which."""

from dataclasses import replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_reference.constants_table import (
    ELLIPSE_EVIDENCE,
    ELLIPSE_EXPECTED,
    ELLIPSE_HALF,
    ELLIPSE_MOST,
    MAX_MOVE,
)
from eitskin_reference.disc_fit import Disc, Fit


def long_axis(
    dipole: FloatArray, inverse: FloatArray, polarity: float, excess: float
) -> FloatArray:
    """Half of the long axis over the radius, as a vector (2,), of a disc with these ``dipole``
    terms (2,), the block ``inverse`` (2, 2) of the linearisation's inverse being theirs; zeros
    where it is a disc as far as the data tell."""
    if not dipole @ np.linalg.solve(inverse, dipole) > ELLIPSE_EVIDENCE * excess:
        return np.zeros(2)
    d = float(np.hypot(*dipole))
    e = ELLIPSE_MOST * d / (d + ELLIPSE_HALF)
    angle = np.arctan2(polarity * dipole[1], polarity * dipole[0]) / 2
    return np.asarray(np.sqrt((1 + e) / (1 - e)) * np.array([np.cos(angle), np.sin(angle)]))


def placed(
    fit: Fit, disc: Disc, best_mm: FloatArray, axis: FloatArray
) -> tuple[float, float, float]:
    """x, y and radius, mm, with which ``disc`` is reported: its own, but of an ellipse, which has
    an ``axis`` (2,), where the test has it (``best_mm`` (2,)), and more as its strength suggests.
    """
    radius = disc.radius_mm
    if not axis.any() or not np.isfinite(best_mm).all():
        return disc.x_mm, disc.y_mm, radius
    place, reach = np.array([disc.x_mm, disc.y_mm]), MAX_MOVE * fit.model.grid.pixel_mm
    x, y = (place + np.clip(best_mm - place, -reach, reach)).tolist()
    there = replace(disc, x_mm=x, y_mm=y)
    if not fit.on_skin(there):
        there = disc
    if fit.options.touch_change_s_per_m > 0:
        radius += ELLIPSE_EXPECTED * (fit.expected_radius(disc) - radius)
    return there.x_mm, there.y_mm, radius
