"""Touches of several shapes on a mesh: the mean change of conductivity in each element."""

from dataclasses import dataclass, replace
from math import cos, sin, sqrt

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.mesh import Mesh

PROFILES = ("uniform", "hertz", "gaussian")
# the extent of each profile, in half axes of its ellipse
REACH = {"uniform": 1.0, "hertz": 1.0, "gaussian": 2.0}
SUBDIVISION = 6
MIN_FACTOR = 1e-3


@dataclass(frozen=True)
class ShapedTouch:
    """A touch as an ellipse of area pi ``radius_mm``^2. Its long axis is ``aspect`` times the short
    one and points along ``angle_rad``; its mean conductivity is ``contrast`` times the skin's.

    ``profile`` is "uniform", "hertz" for Hertz's pressure sqrt(1 - rho^2) with rho in half axes, or
    "gaussian" with the second moment of the uniform profile.
    """

    x_mm: float
    y_mm: float
    radius_mm: float
    contrast: float
    aspect: float = 1.0
    angle_rad: float = 0.0
    profile: str = "uniform"

    def disc(self) -> "ShapedTouch":
        """Return the uniform disc of equal area and mean."""
        return replace(self, aspect=1.0, angle_rad=0.0, profile="uniform")

    def change_at(self, points_mm: FloatArray) -> FloatArray:
        """Return the relative change of conductivity at ``points_mm`` (..., 2)."""
        x, y = points_mm[..., 0] - self.x_mm, points_mm[..., 1] - self.y_mm
        c, s = cos(self.angle_rad), sin(self.angle_rad)
        stretch = sqrt(self.aspect)
        square = ((c * x + s * y) / stretch) ** 2 + ((c * y - s * x) * stretch) ** 2
        square /= self.radius_mm**2
        if self.profile == "hertz":
            shape = 1.5 * np.sqrt(np.maximum(1 - square, 0))
        elif self.profile == "gaussian":
            shape = np.where(square <= REACH["gaussian"] ** 2, 2 * np.exp(-2 * square), 0.0)
        else:
            shape = (square <= 1).astype(np.float64)
        return np.asarray((self.contrast - 1) * shape)


class TouchCover:
    """Finds the elements under touches on one mesh. Whatever does not depend on the touch is
    computed once.

    Each element near a touch is split into ``SUBDIVISION`` squared equal triangles; the touch is
    evaluated at their centres.
    """

    def __init__(self, mesh: Mesh) -> None:
        self._corners = mesh.nodes_mm[mesh.triangles]
        self._middles = mesh.centroids_mm()
        self._reach = np.linalg.norm(self._corners - self._middles[:, None], axis=2).max(axis=1)
        self._weights = centres_of_parts(SUBDIVISION)

    def near(self, x_mm: float, y_mm: float, reach_mm: float) -> IntArray:
        """Return the elements (e,) that may lie within ``reach_mm`` of a place."""
        away = np.hypot(self._middles[:, 0] - x_mm, self._middles[:, 1] - y_mm)
        return np.flatnonzero(away <= reach_mm + self._reach)

    def mean_change(self, touch: ShapedTouch, elements: IntArray) -> FloatArray:
        """Return the mean relative change in each of ``elements`` (e,), (e,)."""
        return np.asarray(touch.change_at(self._weights @ self._corners[elements]).mean(axis=1))

    def factors(self, touches: tuple[ShapedTouch, ...]) -> FloatArray:
        """Return the factor for the conductivity of each element, (E,), at least a thousandth."""
        change = np.zeros(len(self._middles))
        for touch in touches:
            reach = touch.radius_mm * sqrt(touch.aspect) * REACH[touch.profile]
            elements = self.near(touch.x_mm, touch.y_mm, reach)
            change[elements] += self.mean_change(touch, elements)
        return np.maximum(1 + change, MIN_FACTOR)


def centres_of_parts(parts: int) -> FloatArray:
    """Return the barycentric weights (p^2, 3) of the centres of the p^2 equal triangles into which
    lines parallel to its sides cut a triangle."""
    upright = [(3 * i + 1, 3 * j + 1) for i in range(parts) for j in range(parts - i)]
    turned = [(3 * i + 2, 3 * j + 2) for i in range(parts - 1) for j in range(parts - 1 - i)]
    first = np.array(upright + turned, dtype=np.float64) / (3 * parts)
    return np.column_stack([first, 1.0 - first.sum(axis=1)])
