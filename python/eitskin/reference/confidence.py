"""The numpy reference of csrc/src/evidence/confidence.c: what the numbers of the test have meant on
scenes with a truth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import (
    CONFIDENCE_HALF,
    MAX_MOVE,
    MIN_CONFIDENCE,
    PAIR_ODDS,
    PLACE_DISTANCE,
    PLACE_FACTOR,
    PLACE_MIN,
)
from eitskin.reference.evidence import Tested

FloatArray = npt.NDArray[np.float64]


def rated(tested: Tested, distance: float, pixel_mm: float) -> tuple[FloatArray, FloatArray]:
    """For each disc the probability that it is a touch (k,), and the covariance of its place as
    wide as places err: xx, xy, yy (k, 3), mm^2; ``distance`` of the reference from the model's."""
    x, y = np.clip(tested.apart_mm, -MAX_MOVE * pixel_mm, MAX_MOVE * pixel_mm).T
    least = pixel_mm**2 * (PLACE_MIN + PLACE_DISTANCE * distance)
    place = PLACE_FACTOR * tested.place_mm2 + np.column_stack([x * x + least, x * y, y * y + least])
    return tested.rise / (tested.rise + CONFIDENCE_HALF), place


def miscounted(tested: Tested) -> bool:
    """Whether a disc may be two touches, or none, or the test was cut short."""
    if tested.spent and len(tested.rise) > 0:
        return True
    sure = tested.rise / (tested.rise + CONFIDENCE_HALF)
    return bool((tested.pair > PAIR_ODDS).any() or (sure < MIN_CONFIDENCE).any())
