"""A mesh's elements as a touch sees them: on the plane, or around it on a surface."""

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.fem.mesh import Mesh, flat_gradients
from eitskin.scene.random_touches import TrueTouch
from eitskin.surface.surface_map import SurfaceMap


class PlaneChart:
    """A flat skin: every touch sees the places of the plane."""

    def __init__(self, mesh: Mesh) -> None:
        self.element_corners = mesh.nodes_mm[mesh.triangles]
        self._middles = mesh.centroids_mm()
        self._reach = np.linalg.norm(self.element_corners - self._middles[:, None], axis=2).max(
            axis=1
        )

    def near(self, touch: TrueTouch) -> IntArray:
        """Return the elements (e,) that ``touch`` may meet, ascending."""
        away = np.hypot(self._middles[:, 0] - touch.x_mm, self._middles[:, 1] - touch.y_mm)
        return np.flatnonzero(away <= touch.reach_mm + self._reach)

    def around(self, touch: TrueTouch, elements: IntArray, weights: FloatArray) -> FloatArray:
        """Return places (e, s, 2) in the coordinates of ``touch``: those with ``weights`` (s, 3) of
        the corners of ``elements`` (e,)."""
        return np.asarray(weights @ self.element_corners[elements])

    def outward(self, touch: TrueTouch, elements: IntArray) -> FloatArray:
        """Return the direction away from ``touch`` in each of ``elements`` (e,) in the coordinates
        of the element, (e, 2)."""
        return touch.outward(self._middles[elements])


class SurfaceChart:
    """A surface: a touch sees each place in its tangent plane, in the direction in which it lies
    and at its distance in space. An element has coordinates of its own, in which it has its true
    shape; ``element_corners`` (E, 3, 2) are in them."""

    def __init__(self, mesh: Mesh, surface: SurfaceMap) -> None:
        assert mesh.stretch is not None
        self._surface = surface
        self._corners = 1e3 * surface.at(mesh.nodes_mm).point_m[mesh.triangles]
        self._middles = self._corners.mean(axis=1)
        self._reach = np.linalg.norm(self._corners - self._middles[:, None], axis=2).max(axis=1)
        jacobian = 1e-3 * np.einsum("eka,ekd->ead", self._corners, flat_gradients(mesh))
        self._frames = jacobian @ np.linalg.inv(mesh.stretch)  # (E, 3, 2), orthonormal columns
        self._normals = np.cross(self._frames[:, :, 0], self._frames[:, :, 1])
        self.element_corners = mesh.nodes_mm[mesh.triangles] @ mesh.stretch

    def near(self, touch: TrueTouch) -> IntArray:
        """Return the elements (e,) that ``touch`` may meet, ascending; not those that lie close
        behind it on the other side of a thin body."""
        centre, _ = self._centre(touch)
        away = np.linalg.norm(self._middles - centre, axis=1)
        normal = self._surface.at([[touch.x_mm, touch.y_mm]]).normal[0]
        return np.flatnonzero((away <= touch.reach_mm + self._reach) & (self._normals @ normal > 0))

    def around(self, touch: TrueTouch, elements: IntArray, weights: FloatArray) -> FloatArray:
        """Return places as :class:`PlaneChart` does."""
        centre, tangents = self._centre(touch)
        offsets = weights @ self._corners[elements] - centre
        seen = offsets @ tangents
        length = np.maximum(np.linalg.norm(seen, axis=2), 1e-12)
        seen *= (np.linalg.norm(offsets, axis=2) / length)[:, :, None]
        return np.asarray(seen + np.array([touch.x_mm, touch.y_mm]))

    def outward(self, touch: TrueTouch, elements: IntArray) -> FloatArray:
        """Return directions as :class:`PlaneChart` does."""
        _, tangents = self._centre(touch)
        seen = self.around(touch, elements, np.full((1, 3), 1 / 3))[:, 0]
        return np.asarray(
            np.einsum("ead,ea->ed", self._frames[elements], touch.outward(seen) @ tangents.T)
        )

    def _centre(self, touch: TrueTouch) -> tuple[FloatArray, FloatArray]:
        place = self._surface.at([[touch.x_mm, touch.y_mm]])
        return 1e3 * place.point_m[0], place.tangents[0]
