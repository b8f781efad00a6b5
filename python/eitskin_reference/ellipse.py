"""The numpy reference of csrc/src/evidence/ellipse.c: whether a disc is an ellipse, and which."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import ELLIPSE_EVIDENCE, ELLIPSE_HALF, ELLIPSE_MOST

FloatArray = npt.NDArray[np.float64]


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
