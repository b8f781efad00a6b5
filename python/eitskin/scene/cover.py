"""Compute which elements of a mesh a touch covers, and which part of each."""

from collections.abc import Iterable

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.mesh import Mesh
from eitskin.fem.shaped_touch import centres_of_parts
from eitskin.scene.random_touches import TrueTouch

SUBDIVISION = 8
MIN_FACTOR = 1e-3


class Cover:
    """Finds the elements under touches on one mesh. Whatever does not depend on the touch is
    computed once.

    Each element near the disc is split into ``subdivision`` squared equal triangles; the touch is
    evaluated at their centres.
    """

    def __init__(self, mesh: Mesh, subdivision: int = SUBDIVISION) -> None:
        self._corners = mesh.nodes_mm[mesh.triangles]
        self._middles = mesh.centroids_mm()
        self._reach = np.linalg.norm(self._corners - self._middles[:, None], axis=2).max(axis=1)
        self._weights = centres_of_parts(subdivision)

    def of(self, touch: TrueTouch) -> tuple[IntArray, FloatArray]:
        """Return the elements (e,) that ``touch`` meets, ascending, and the covered part of each
        (e,), in (0, 1]. For a shape this is its mean change in the element relative to that in its
        middle."""
        centre = np.array([touch.x_mm, touch.y_mm])
        reach_mm = touch.radius_mm * (1.0 if touch.shape is None else touch.shape.reach)
        near = np.flatnonzero(
            np.linalg.norm(self._middles - centre, axis=1) <= reach_mm + self._reach
        )
        offsets = self._weights @ self._corners[near] - centre
        if touch.shape is None:
            part = ((offsets**2).sum(axis=2) <= touch.radius_mm**2).mean(axis=1)
        else:
            x, y = offsets[..., 0], offsets[..., 1]
            part = touch.shape.change_at(x, y, touch.radius_mm).mean(axis=1)
        met = part > 0
        return near[met], part[met]

    def factor(self, touches: Iterable[TrueTouch]) -> tuple[IntArray, FloatArray]:
        """Return the elements (e,) that ``touches`` meet, ascending, and the factor of each one's
        conductivity (e,).

        If touches share an element, their changes add; the factor is at least a thousandth.
        """
        change = np.zeros(len(self._middles))
        for touch in touches:
            elements, part = self.of(touch)
            change[elements] += part * (touch.contrast - 1.0)
        elements = np.flatnonzero(change)
        return elements, np.maximum(1.0 + change[elements], MIN_FACTOR)
