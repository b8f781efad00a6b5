"""The numpy reference of csrc/src/evidence/confidence.c: what the numbers of the test have meant on
scenes with a truth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import (
    CONFIDENCE_HALF,
    CONFIDENCE_STEPS,
    PLACE_FACTOR,
    PLACE_MIN_MM2,
)
from eitskin.reference.evidence import Tested

FloatArray = npt.NDArray[np.float64]


def rated(tested: Tested) -> tuple[FloatArray, FloatArray]:
    """For each disc the probability that it is one touch (k,), and the covariance of its place as
    wide as places err: xx, xy, yy (k, 3), mm^2."""
    odds = (np.maximum(tested.rise, 0) / CONFIDENCE_HALF) ** (CONFIDENCE_STEPS / 2)
    least = np.array([PLACE_MIN_MM2, 0, PLACE_MIN_MM2])
    return odds / (1 + odds), PLACE_FACTOR * tested.place_mm2 + least
