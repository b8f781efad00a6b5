"""Shapes of touches: an ellipse and how the change falls from its middle to its edge.

Contact mechanics gives the two smooth profiles' names: under a round indenter the pressure is
sqrt(1 - rho^2) of that in the middle (H. Hertz 1882; K. L. Johnson, Contact Mechanics, Cambridge
1985, ch. 4), and a fingertip's contact is an ellipse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

PROFILES = ("flat", "hertz", "gauss")
GAUSS_REACH = 2.5  # of the half-height radius; there it has fallen to 1.3 %


@dataclass(frozen=True)
class TouchShape:
    """How a touch differs from an even disc.

    Attributes:
        aspect: long over short axis; both together have the area of the disc of the touch's radius.
        angle_rad: of the long axis.
        profile: "flat": the same change all over; "hertz": sqrt(1 - rho^2) of that in the middle,
            rho being 1 on the ellipse; "gauss": 2^(-rho^2), half on the ellipse.
    """

    aspect: float = 1.0
    angle_rad: float = 0.0
    profile: str = "flat"

    @property
    def reach(self) -> float:
        """The greatest distance from the middle that the touch changes anything at, over its
        radius."""
        return math.sqrt(self.aspect) * (GAUSS_REACH if self.profile == "gauss" else 1.0)

    def change_at(self, offsets_mm: FloatArray, radius_mm: float) -> FloatArray:
        """The change (...) at ``offsets_mm`` (..., 2) from the middle, over that in the middle."""
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        along = offsets_mm[..., 0] * cos + offsets_mm[..., 1] * sin
        across = offsets_mm[..., 1] * cos - offsets_mm[..., 0] * sin
        root = math.sqrt(self.aspect)
        rho2 = ((along / root) ** 2 + (across * root) ** 2) / radius_mm**2
        if self.profile == "hertz":
            return np.sqrt(np.maximum(1.0 - rho2, 0.0))
        if self.profile == "gauss":
            return np.where(rho2 <= GAUSS_REACH**2, np.exp2(-rho2), 0.0)
        return np.asarray((rho2 <= 1.0).astype(np.float64))
