"""Shapes of touches that are no even discs: an ellipse, and how the change falls from its middle.

A round indenter presses with sqrt(1 - rho^2) of the pressure in the middle (Hertz, J. reine angew.
Math. 92, 1882; Johnson, Contact Mechanics, Cambridge 1985, ch. 4), a fingertip with a like dome
(Pawluk and Howe, J. Biomech. Eng. 121, 1999) that is longer than wide. Conductivity is taken to
follow the pressure. Imported only where a touch names a shape.
"""

import math
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray

# name: its profile, and its long over short axis where none is given
SHAPES = {
    "ellipse": ("flat", 1.5),
    "hertz": ("hertz", 1.0),
    "gauss": ("gauss", 1.0),
    "finger": ("hertz", 1.6),
}
MAX_ASPECT = 10.0
GAUSS_REACH = 2.5  # of the radius; there it has fallen to 1.3 %, and ends
RIM_POINTS = 64


@dataclass(frozen=True)
class TouchShape:
    """How a touch differs from an even disc.

    Attributes:
        profile: how the change of conductivity falls with rho, which is 1 on the touch's ellipse.
            "flat": not at all; "hertz": as sqrt(1 - rho^2); "gauss": as 2^(-rho^2), half on it.
        aspect: long over short axis; the ellipse has the area of the disc of the touch's radius.
        angle_deg: of the long axis, from x towards y.
    """

    profile: str = "flat"
    aspect: float = 1.0
    angle_deg: float = 0.0

    @property
    def reach(self) -> float:
        """The greatest distance from the middle at which it changes anything, over its radius."""
        return math.sqrt(self.aspect) * (GAUSS_REACH if self.profile == "gauss" else 1.0)

    def rho2(self, x_mm: FloatArray, y_mm: FloatArray, radius_mm: float) -> FloatArray:
        """rho^2 (...) at distances (...) from the middle."""
        angle, root = math.radians(self.angle_deg), math.sqrt(self.aspect)
        along = x_mm * math.cos(angle) + y_mm * math.sin(angle)
        across = y_mm * math.cos(angle) - x_mm * math.sin(angle)
        return np.asarray(((along / root) ** 2 + (across * root) ** 2) / radius_mm**2)

    def change_at(self, x_mm: FloatArray, y_mm: FloatArray, radius_mm: float) -> FloatArray:
        """The change (...) at distances (...) from the middle, over that in the middle."""
        rho2 = self.rho2(x_mm, y_mm, radius_mm)
        if self.profile == "hertz":
            return np.sqrt(np.maximum(1.0 - rho2, 0.0))
        if self.profile == "gauss":
            return np.where(rho2 <= GAUSS_REACH**2, np.exp2(-rho2), 0.0)
        return np.asarray((rho2 <= 1.0).astype(np.float64))

    def rim_mm(self, radius_mm: float) -> FloatArray:
        """Points (64, 2) of the ellipse, from the middle."""
        angle, root = math.radians(self.angle_deg), math.sqrt(self.aspect)
        turn = np.linspace(0, 2 * np.pi, RIM_POINTS, endpoint=False)
        along, across = radius_mm * root * np.cos(turn), radius_mm / root * np.sin(turn)
        return np.column_stack(
            [
                along * math.cos(angle) - across * math.sin(angle),
                along * math.sin(angle) + across * math.cos(angle),
            ]
        )


def named_shape(name: str, aspect: float | None = None, angle_deg: float = 0.0) -> TouchShape:
    """The shape called ``name``, with its own aspect where none is given."""
    profile, usual = SHAPES[name]
    return TouchShape(profile, usual if aspect is None else aspect, angle_deg)
