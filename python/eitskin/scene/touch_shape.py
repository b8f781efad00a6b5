"""Shapes of touches other than even discs: an ellipse, and profiles that fall off from the middle.

A round indenter presses with sqrt(1 - rho^2) of the pressure in the middle (Hertz, J. reine angew.
Math. 92, 1882; Johnson, Contact Mechanics, Cambridge 1985, ch. 4), and a fingertip with a similar
dome (Pawluk and Howe, J. Biomech. Eng. 121, 1999) that is longer than wide. Conductivity is assumed
to follow the pressure. This module is imported only if a touch names a shape.
"""

import math
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray

# the profile of each shape, and its default for the long over the short axis
SHAPES = {
    "ellipse": ("flat", 1.5),
    "hertz": ("hertz", 1.0),
    "gauss": ("gauss", 1.0),
    "finger": ("hertz", 1.6),
}
MAX_ASPECT = 10.0
GAUSS_REACH = 2.5  # in radii: here it has fallen to 1.3 %, and is cut off
RIM_POINTS = 64


@dataclass(frozen=True)
class TouchShape:
    """The differences of a touch from an even disc.

    Attributes:
        profile: how the change of conductivity falls with rho, which is 1 on the ellipse of the
            touch. "flat" is constant, "hertz" is sqrt(1 - rho^2), and "gauss" is 2^(-rho^2), which
            is one half on the ellipse.
        aspect: long over short axis; the ellipse has the area of the disc with the touch's radius.
        angle_deg: the direction of the long axis, from x towards y.
    """

    profile: str = "flat"
    aspect: float = 1.0
    angle_deg: float = 0.0

    @property
    def reach(self) -> float:
        """The greatest distance from the middle at which it changes anything, over its radius."""
        return math.sqrt(self.aspect) * (GAUSS_REACH if self.profile == "gauss" else 1.0)

    def rho2(self, x_mm: FloatArray, y_mm: FloatArray, radius_mm: float) -> FloatArray:
        """Return rho^2 (...) at distances (...) from the middle."""
        angle, root = math.radians(self.angle_deg), math.sqrt(self.aspect)
        along = x_mm * math.cos(angle) + y_mm * math.sin(angle)
        across = y_mm * math.cos(angle) - x_mm * math.sin(angle)
        return np.asarray(((along / root) ** 2 + (across * root) ** 2) / radius_mm**2)

    def change_at(self, x_mm: FloatArray, y_mm: FloatArray, radius_mm: float) -> FloatArray:
        """Return the change (...) at distances (...) from the middle, relative to that in the
        middle."""
        rho2 = self.rho2(x_mm, y_mm, radius_mm)
        if self.profile == "hertz":
            return np.sqrt(np.maximum(1.0 - rho2, 0.0))
        if self.profile == "gauss":
            return np.where(rho2 <= GAUSS_REACH**2, np.exp2(-rho2), 0.0)
        return np.asarray((rho2 <= 1.0).astype(np.float64))

    def outward(self, offsets_mm: FloatArray) -> FloatArray:
        """Return the directions, of any length, in which rho grows at ``offsets_mm`` (k, 2) from
        the middle, (k, 2)."""
        angle = math.radians(self.angle_deg)
        axes = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        return np.asarray((offsets_mm @ axes.T) * [1 / self.aspect, self.aspect] @ axes)

    def rim_mm(self, radius_mm: float) -> FloatArray:
        """Return points (64, 2) on the ellipse, relative to the middle."""
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
    """Return the shape called ``name``, with its default aspect unless one is given."""
    profile, default = SHAPES[name]
    return TouchShape(profile, default if aspect is None else aspect, angle_deg)
