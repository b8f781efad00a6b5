"""The Cramer-Rao bound of a touch's place: the least error that any method without bias can have.

The data are all rows of a frame with independent normal noise, the unknowns the place, radius and
amplitude q = 2 (c - 1) / (c + 1) of every touch in the frame. As in a fit, radius and amplitude
have priors; the place has none. The reference is known without noise.
"""

from collections.abc import Sequence

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchScene, TrueTouch

RADIUS_PRIOR_MM, AMPLITUDE_PRIOR = 3.0, 0.17
STEPS = np.array([0.05, 0.05, 0.03, 0.005])  # of x, y, radius in mm, and q
MEDIAN_PER_RMS = np.sqrt(np.log(2))  # of a distance whose two parts are normal and alike


def slopes_v(model: RoundSkin, scene: TouchScene) -> FloatArray:
    """The derivatives (4 k, m) of the voltages by x, y, radius, q of each of k touches, by central
    differences."""
    values = np.array([
        [one.x_mm, one.y_mm, one.radius_mm, 2 * (one.contrast - 1) / (one.contrast + 1)]
        for one in scene.touches
    ])  # fmt: skip
    return np.array([
        (_at(model, values, touch, k, step) - _at(model, values, touch, k, -step)) / (2 * step)
        for touch in range(len(values)) for k, step in enumerate(STEPS)
    ])  # fmt: skip


def place_bounds_mm(slopes: FloatArray, sigma_v: FloatArray) -> list[float]:
    """The median distance in mm that the bound allows each touch: ``slopes`` (4 k, m) V and
    ``sigma_v`` (m,)."""
    weighted = slopes / sigma_v
    touches = len(slopes) // 4
    prior = np.tile([0, 0, RADIUS_PRIOR_MM**-2, AMPLITUDE_PRIOR**-2], touches)
    spread = np.linalg.inv(weighted @ weighted.T + np.diag(prior))
    places: Sequence[int] = range(0, 4 * touches, 4)
    return [float(MEDIAN_PER_RMS * np.sqrt(spread[k, k] + spread[k + 1, k + 1])) for k in places]


def _at(
    model: RoundSkin, values: FloatArray, touch: int, parameter: int, step: float
) -> FloatArray:
    moved = values.copy()
    moved[touch, parameter] += step
    touches = [TrueTouch(x, y, r, (2 + q) / (2 - q)) for x, y, r, q in moved.tolist()]
    return model.voltages(touches)
