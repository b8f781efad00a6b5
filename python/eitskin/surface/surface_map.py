"""The map between a surface and its flattened copy, and touches on the surface.

The solver works on a flattened copy of the surface, in its millimetres. The copy is conformal: near
each place it is the surface turned and made smaller by one factor, the ``scale``, in true mm per
flat mm. A thin sheet conducts alike on both, so touches are found on the copy; this module takes
them back to the surface.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.core.diagnostics_table import Touch
from eitskin.surface.locate import Locator, nearest_on_segments, nearest_on_triangles
from eitskin.surface.topology import rim_loop

EXPECTED_RADIUS_SD = 0.3  # of a touch's radius if the data do not determine it


class LocatedTouch(Protocol):
    """A touch in the millimetres of a skin's drawing, of a frame or after a drive."""

    @property
    def x_mm(self) -> float: ...
    @property
    def y_mm(self) -> float: ...
    @property
    def x_variance_mm2(self) -> float | None: ...
    @property
    def xy_covariance_mm2(self) -> float | None: ...
    @property
    def y_variance_mm2(self) -> float | None: ...


@dataclass(frozen=True, eq=False)
class SurfacePlaces:
    """Places on a surface in the link's frame.

    ``point_m`` (k, 3) are the points and ``normal`` (k, 3) the unit normals outwards. ``tangents``
    (k, 3, 2) hold two orthonormal columns t1 and t2 with t1 x t2 = normal; t1 is the direction of
    +x of the flattened copy. ``scale`` (k,) is in true mm per flat mm, ``triangle`` (k,) is the
    triangle of the map.
    """

    point_m: FloatArray
    normal: FloatArray
    tangents: FloatArray
    scale: FloatArray
    triangle: IntArray


@dataclass(frozen=True, eq=False)
class SurfaceTouch:
    """A touch on a surface, in the link's frame.

    ``point_m``, ``normal`` (outwards) and ``tangents`` (3, 2) are as in :class:`SurfacePlaces`. A
    finger presses against the normal. ``strength_s_m`` is the conductivity change integrated over
    the touch, in S m^2/m. ``covariance_m2`` (3, 3) is that of the point, 0 along the normal; None
    if it is not known. ``long_axis_m`` (3,) is half of the long axis of the touch's ellipse; None
    if the data show no shape."""

    point_m: FloatArray
    normal: FloatArray
    tangents: FloatArray
    scale: float
    radius_m: float
    strength_s_m: float
    covariance_m2: FloatArray | None
    long_axis_m: FloatArray | None


@dataclass(frozen=True, eq=False)
class SurfaceMap:
    """A triangulated surface and its flattened copy.

    ``flat_mm`` (N, 2) are the vertices of the copy and ``points_mm`` (N, 3) the same vertices on
    the surface, in the frame of ``link``. ``triangles`` (T, 3) are counterclockwise in the copy;
    seen from outside they are so on the surface. A place outside the copy takes the nearest place
    of its rim. ``simplified_from`` is the number of triangles of the mesh file if it has been
    simplified, else 0; a stored model does not keep it.
    """

    flat_mm: FloatArray
    points_mm: FloatArray
    triangles: IntArray
    link: str = ""
    simplified_from: int = 0

    @cached_property
    def _locator(self) -> Locator:
        return Locator(self.flat_mm, self.triangles)

    @property
    def rim_mm(self) -> FloatArray:
        """The vertices of the copy's rim in order, counterclockwise, (B, 2)."""
        return np.asarray(self.flat_mm[rim_loop(self.triangles)])

    @cached_property
    def normals(self) -> FloatArray:
        """The unit normal at each vertex, outwards, (N, 3)."""
        return _unit(self._at_vertices(self._doubled_normals))

    @cached_property
    def scales(self) -> FloatArray:
        """True mm per flat mm at each vertex, (N,)."""
        true = self._at_vertices(np.linalg.norm(self._doubled_normals, axis=1))
        return np.asarray(np.sqrt(true / self._at_vertices(self._doubled_flat_areas)))

    @property
    def scale_range(self) -> tuple[float, float]:
        """The least and the greatest scale."""
        return float(self.scales.min()), float(self.scales.max())

    @property
    def area_mm2(self) -> float:
        """The true area."""
        return float(np.linalg.norm(self._doubled_normals, axis=1).sum() / 2)

    @property
    def angle_error(self) -> float:
        """The ratio of a triangle's greater to its lesser scale that 95 % of the area stay below; 1
        if the map is conformal. Linear triangles add about their size over the radius of
        curvature."""
        ratio = self.stretches[:, 0] / self.stretches[:, 1]
        order = np.argsort(ratio)
        share = np.cumsum(self._doubled_flat_areas[order])
        return float(ratio[order][np.searchsorted(share, 0.95 * share[-1])])

    def points_m(self) -> FloatArray:
        """Return the vertices on the surface in m, (N, 3)."""
        return self.points_mm * 1e-3

    def at(self, flat_mm: npt.ArrayLike) -> SurfacePlaces:
        """Return the places on the surface of places (k, 2) of the flattened copy."""
        triangle, weight = self.locate(flat_mm)
        corners = self.triangles[triangle]
        normal = _unit((weight[:, :, None] * self.normals[corners]).sum(axis=1))
        along = self._jacobians[triangle][:, :, 0]
        first = _unit(along - (along * normal).sum(axis=1)[:, None] * normal)
        return SurfacePlaces(
            point_m=1e-3 * (weight[:, :, None] * self.points_mm[corners]).sum(axis=1),
            normal=normal,
            tangents=np.stack([first, np.cross(normal, first)], axis=2),
            scale=np.asarray(np.exp((weight * np.log(self.scales)[corners]).sum(axis=1))),
            triangle=triangle,
        )

    def locate(self, flat_mm: npt.ArrayLike) -> tuple[IntArray, FloatArray]:
        """Return the triangle (k,) of each place (k, 2) of the copy and the weights of its three
        corners, (k, 3)."""
        places = np.asarray(flat_mm, dtype=np.float64).reshape(-1, 2)
        triangle, weight = self._locator.find(places)
        outside = np.flatnonzero(triangle < 0)
        if len(outside):
            edges, owner, corner = self._rim
            edge, share = nearest_on_segments(
                places[outside], self.flat_mm[edges[:, 0]], self.flat_mm[edges[:, 1]]
            )
            triangle[outside] = owner[edge]
            weight[outside] = 0.0
            weight[outside, corner[edge]] = 1 - share
            weight[outside, (corner[edge] + 1) % 3] = share
        return triangle, weight

    def touch(self, touch: Touch) -> SurfaceTouch:
        """Return a touch of the flattened copy as one on the surface.

        A disc on the surface lies on the copy as a disc to first order, but its middle does not:
        where the scale s grows, the far half of the flat disc is longer. The middle on the surface
        is that of the copy's place moved by radius^2 grad(log s) / 2. What is not known of the
        radius adds to the covariance.
        """
        centre = np.array([touch.x_mm, touch.y_mm])
        growth = self.growth_per_mm(centre)[0]
        shift = 0.5 * touch.radius_mm**2 * growth
        length = float(np.hypot(*shift))
        if length > 0.5 * touch.radius_mm:  # beyond the range of the formula
            shift *= 0.5 * touch.radius_mm / length
        place = self.at(centre + shift)
        tangents, scale = place.tangents[0], float(place.scale[0])
        flat, covariance, long_axis = flat_covariance_mm2(touch), None, None
        if flat is not None:
            unsure = EXPECTED_RADIUS_SD
            if touch.radius_sd_mm is not None:
                unsure = touch.radius_sd_mm / touch.radius_mm
            flat = flat + np.outer(shift, shift) * (2 * unsure) ** 2
            covariance = covariance_in_space(flat, tangents, scale)
        if touch.long_x_mm is not None and touch.long_y_mm is not None:
            long_axis = tangents @ np.array([touch.long_x_mm, touch.long_y_mm]) * (1e-3 * scale)
        return SurfaceTouch(
            point_m=place.point_m[0],
            normal=place.normal[0],
            tangents=tangents,
            scale=scale,
            radius_m=1e-3 * touch.radius_mm * scale,
            strength_s_m=1e-6 * touch.strength_s_per_m_mm2 * scale**2,
            covariance_m2=covariance,
            long_axis_m=long_axis,
        )

    def growth_per_mm(self, flat_mm: npt.ArrayLike) -> FloatArray:
        """Return the gradient of log(scale) at places (k, 2) of the copy, (k, 2), per flat mm."""
        triangle, weight = self.locate(flat_mm)
        corners = self.triangles[triangle]
        return np.asarray((weight[:, :, None] * self._growth[corners]).sum(axis=1))

    def flat_of(self, points_mm: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the places (k, 2) of the copy that belong to the surface's points nearest to
        ``points_mm`` (k, 3), and the distances to them, (k,) in mm."""
        points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 3)
        triangle, weight, away = nearest_on_triangles(points, self.points_mm, self.triangles)
        flat = (weight[:, :, None] * self.flat_mm[self.triangles[triangle]]).sum(axis=1)
        return np.asarray(flat), away

    def rim_places(self, points_mm: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the places (k, 2) on the copy's rim that belong to the rim's points nearest to
        ``points_mm`` (k, 3), and the distances to them, (k,) in mm."""
        points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 3)
        (begin, end), edges = self._rim[0].T, self._rim[0]
        edge, share = nearest_on_segments(points, self.points_mm[begin], self.points_mm[end])
        weight = np.stack([1 - share, share], axis=1)[:, :, None]
        near = (weight * self.points_mm[edges[edge]]).sum(axis=1)
        flat = (weight * self.flat_mm[edges[edge]]).sum(axis=1)
        return np.asarray(flat), np.linalg.norm(points - near, axis=1)

    @cached_property
    def _doubled_normals(self) -> FloatArray:
        a, b, c = (self.points_mm[self.triangles[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def _doubled_flat_areas(self) -> FloatArray:
        a, b, c = (self.flat_mm[self.triangles[:, k]] for k in range(3))
        u, v = b - a, c - a
        return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])

    @cached_property
    def _flat_gradients(self) -> FloatArray:
        """The gradients of the three hat functions of each triangle of the copy, (T, 3, 2)."""
        corners = self.flat_mm[self.triangles]
        opposite = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=-1)
        return np.asarray(turned / self._doubled_flat_areas[:, None, None])

    @cached_property
    def _jacobians(self) -> FloatArray:
        """The derivative of the point on the surface by the flat place, (T, 3, 2)."""
        return np.asarray(
            np.einsum("tka,tkd->tad", self.points_mm[self.triangles], self._flat_gradients)
        )

    @cached_property
    def stretches(self) -> FloatArray:
        """The greater and the lesser scale of each triangle, (T, 2); they are equal where the map
        is conformal."""
        return np.asarray(np.linalg.svd(self._jacobians, compute_uv=False))

    @cached_property
    def _growth(self) -> FloatArray:
        """The gradient of log(scale) at each vertex, (N, 2): the mean over its triangles."""
        logs = np.log(self.scales)[self.triangles]
        each = np.einsum("tk,tkd->td", logs, self._flat_gradients)
        area = self._doubled_flat_areas
        return np.asarray(
            self._at_vertices(each * area[:, None]) / self._at_vertices(area)[:, None]
        )

    @cached_property
    def _rim(self) -> tuple[IntArray, IntArray, IntArray]:
        """The rim's edges (B, 2), the triangle of each, and which of its corners it begins at."""
        count = len(self.points_mm)
        begin = self.triangles.ravel()
        end = np.roll(self.triangles, -1, axis=1).ravel()
        lone = ~np.isin(begin * count + end, end * count + begin)
        place = np.flatnonzero(lone)
        return np.column_stack([begin[place], end[place]]), place // 3, place % 3

    def _at_vertices(self, of_triangles: FloatArray) -> FloatArray:
        """Return the sum over the triangles of each vertex of ``of_triangles`` (T, ...)."""
        total = np.zeros((len(self.points_mm), *of_triangles.shape[1:]))
        for k in range(3):
            np.add.at(total, self.triangles[:, k], of_triangles)
        return total


def flat_covariance_mm2(touch: LocatedTouch) -> FloatArray | None:
    """Return the covariance (2, 2) of a touch's place in mm^2 of the drawing; None: not known."""
    xx, xy, yy = touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2
    if xx is None or xy is None or yy is None:
        return None
    return np.array([[xx, xy], [xy, yy]])


def covariance_in_space(flat_mm2: FloatArray, tangents: FloatArray, scale: float) -> FloatArray:
    """Return the covariance (3, 3) in m^2 of a place on a surface whose place on the flattened copy
    has the covariance ``flat_mm2`` (2, 2)."""
    return np.asarray((1e-3 * scale) ** 2 * (tangents @ flat_mm2 @ tangents.T))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])
