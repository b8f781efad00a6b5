"""The outline of a skin: a simple polygon, or a disk whose arcs stay exact.

Arc lengths run counterclockwise along the rim. They start at angle 0 (the rightmost point) for a
disk, and at the first vertex for a polygon.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, isfinite, pi, radians, sin

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.errors import GeometryError

MIN_SIZE_MM = 1.0
MAX_SIZE_MM = 1e5
MAX_VERTICES = 2000
DISK_VERTICES = 256


@dataclass(frozen=True)
class Outline:
    """A simple polygon, counterclockwise and open (the last vertex does not repeat the first). Make
    one with ``disk`` or ``polygon``.

    A disk has ``diameter_mm`` and its centre at (0, 0). Its vertices only approximate the circle,
    but every method calculates with the exact circle.
    """

    vertices_mm: tuple[tuple[float, float], ...]
    diameter_mm: float | None = None

    @cached_property
    def _corners(self) -> FloatArray:
        return np.array(self.vertices_mm, dtype=np.float64)

    @cached_property
    def _arc(self) -> FloatArray:
        """The arc length at each vertex and at the closing point, (k + 1,); for polygons only."""
        steps = np.roll(self._corners, -1, axis=0) - self._corners
        return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])

    @property
    def perimeter_mm(self) -> float:
        """The length of the rim."""
        return pi * self.diameter_mm if self.diameter_mm is not None else float(self._arc[-1])

    @property
    def area_mm2(self) -> float:
        """The enclosed area."""
        return (
            pi * self.diameter_mm**2 / 4
            if self.diameter_mm is not None
            else _signed_area(self._corners)
        )

    @property
    def bounding_box_mm(self) -> tuple[float, float, float, float]:
        """The bounding box as (xmin, ymin, xmax, ymax)."""
        if self.diameter_mm is not None:
            radius = self.diameter_mm / 2
            return (-radius, -radius, radius, radius)
        low, high = self._corners.min(axis=0), self._corners.max(axis=0)
        return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))

    @cached_property
    def centre_mm(self) -> tuple[float, float]:
        """The point inside the outline from which angles are measured.

        It is the centre of area if that lies inside. For a concave outline whose centre of area
        lies outside, it is the middle of the longest stretch inside the outline at the height of
        the centre of area.
        """
        if self.diameter_mm is not None:
            return (0.0, 0.0)
        origin = self._corners.mean(axis=0)
        a = self._corners - origin
        b = np.roll(a, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        x, y = origin + ((a + b) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
        if not self.contains([(x, y)])[0]:
            corners, ends = self._corners, np.roll(self._corners, -1, axis=0)
            k = (corners[:, 1] > y) != (ends[:, 1] > y)
            share = (y - corners[k, 1]) / (ends[k, 1] - corners[k, 1])
            crossings = np.sort(corners[k, 0] + share * (ends[k, 0] - corners[k, 0])).reshape(-1, 2)
            x = crossings[np.argmax(np.diff(crossings, axis=1))].mean()
        return (float(x), float(y))

    def contains(self, points: npt.ArrayLike) -> BoolArray:
        """Return for each of ``points`` (k, 2) in mm whether it lies inside, (k,). A point exactly
        on the rim may count as either."""
        p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if self.diameter_mm is not None:
            return np.asarray(p[:, 0] ** 2 + p[:, 1] ** 2 <= self.diameter_mm**2 / 4)
        inside = np.zeros(len(p), dtype=np.bool_)
        x, y = p[:, 0], p[:, 1]
        for (x0, y0), (x1, y1) in zip(
            self.vertices_mm, self.vertices_mm[1:] + self.vertices_mm[:1], strict=True
        ):
            if y0 != y1:
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * ((x1 - x0) / (y1 - y0)))
        return inside

    def points_at(self, arc_length_mm: npt.ArrayLike) -> FloatArray:
        """Return the rim's points (k, 2) in mm at the arc lengths (k,), taken modulo the
        perimeter."""
        s = np.mod(np.asarray(arc_length_mm, dtype=np.float64).ravel(), self.perimeter_mm)
        if self.diameter_mm is not None:
            radius = self.diameter_mm / 2
            return np.column_stack([radius * np.cos(s / radius), radius * np.sin(s / radius)])
        edge = np.clip(np.searchsorted(self._arc, s, side="right") - 1, 0, len(self._corners) - 1)
        share = ((s - self._arc[edge]) / (self._arc[edge + 1] - self._arc[edge]))[:, None]
        return np.asarray(
            (1 - share) * self._corners[edge] + share * np.roll(self._corners, -1, axis=0)[edge]
        )

    def point_at(self, arc_length_mm: float) -> tuple[float, float]:
        """Return the rim's point (x, y) in mm at an arc length, taken modulo the perimeter."""
        x, y = self.points_at([arc_length_mm])[0]
        return (float(x), float(y))

    def corner_arc_lengths_mm(self) -> FloatArray:
        """Return the arc length of each vertex of a polygon, (k,). A disk has no corners: the
        result is empty."""
        return np.zeros(0) if self.diameter_mm is not None else self._arc[:-1].copy()

    def arc_length_at_angle(self, angle_deg: float) -> float:
        """Return the arc length, in [0, perimeter), at which the ray from the centre at
        ``angle_deg`` last crosses the rim."""
        angle = radians(angle_deg % 360.0)
        if self.diameter_mm is not None:
            return angle * self.diameter_mm / 2
        cx, cy = self.centre_mm
        direction = np.array([cos(angle), sin(angle)])
        a = self._corners - (cx, cy)
        step = np.roll(a, -1, axis=0) - a
        off_a = direction[0] * a[:, 1] - direction[1] * a[:, 0]
        off_b = np.roll(off_a, -1)
        tolerance = 1e-12 * self.perimeter_mm
        off_a = np.where(np.abs(off_a) < tolerance, 0.0, off_a)
        off_b = np.where(np.abs(off_b) < tolerance, 0.0, off_b)
        crosses = (off_a * off_b <= 0) & (off_a != off_b)
        share = np.where(crosses, off_a / np.where(crosses, off_a - off_b, 1.0), 0.0)
        reach = (a + share[:, None] * step) @ direction
        reach = np.where(crosses, reach, -np.inf)
        edge = int(np.argmax(reach))
        s = float(self._arc[edge] + share[edge] * (self._arc[edge + 1] - self._arc[edge]))
        return s % self.perimeter_mm


def disk(diameter_mm: float) -> Outline:
    """Return a disk centred at (0, 0).

    Raises:
        GeometryError: the diameter is out of range.
    """
    if not (isfinite(diameter_mm) and MIN_SIZE_MM <= diameter_mm <= MAX_SIZE_MM):
        raise GeometryError(
            f"outline: diameter_mm = {diameter_mm:g} is out of range; it must be {MIN_SIZE_MM:g} to"
            f" {MAX_SIZE_MM:g} mm"
        )
    radius = diameter_mm / 2
    turns = [2 * pi * k / DISK_VERTICES for k in range(DISK_VERTICES)]
    return Outline(
        tuple((radius * cos(turn), radius * sin(turn)) for turn in turns), float(diameter_mm)
    )


def polygon(vertices: Iterable[Sequence[float]]) -> Outline:
    """Return the polygon through ``vertices`` (x, y) in mm, given in either direction; a repeated
    closing point is dropped.

    Raises:
        GeometryError: the points are too few, too many, not finite or repeated, the polygon crosses
            itself, or its size or area is out of range.
    """
    points = [(float(x), float(y)) for x, y in vertices]
    if len(points) > 1 and points[0] == points[-1]:
        points.pop()
    if not 3 <= len(points) <= MAX_VERTICES:
        raise GeometryError(
            f"outline: {len(points)} different points; a polygon needs 3 to {MAX_VERTICES}"
        )
    corners = np.array(points)
    if not np.isfinite(corners).all():
        bad = int(np.flatnonzero(~np.isfinite(corners).all(axis=1))[0])
        raise GeometryError(
            f"outline: point {bad} (from 0) is {points[bad]}, not finite; repair its coordinates"
        )
    size = np.ptp(corners, axis=0)
    if size.min() < MIN_SIZE_MM or size.max() > MAX_SIZE_MM:
        raise GeometryError(
            f"outline: {size[0]:g} x {size[1]:g} mm is out of range; each side must be "
            f"{MIN_SIZE_MM:g} to {MAX_SIZE_MM:g} mm (are the units mm?)"
        )
    _refuse_repeats(corners, float(size.max()))
    _refuse_crossings(corners)
    area = _signed_area(corners)
    if abs(area) < 1e-3 * float(size.max()) ** 2:
        raise GeometryError(
            f"outline: its area of {abs(area):g} mm2 is too small for its size; check its points"
        )
    if area < 0:
        points = points[:1] + points[:0:-1]
    return Outline(tuple(points))


def _signed_area(corners: FloatArray) -> float:
    a = corners - corners.mean(axis=0)
    b = np.roll(a, -1, axis=0)
    return float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


def _refuse_repeats(corners: FloatArray, size_mm: float) -> None:
    steps = np.roll(corners, -1, axis=0) - corners
    short = np.flatnonzero(np.hypot(steps[:, 0], steps[:, 1]) < 1e-6 * size_mm)
    if len(short):
        k, after = int(short[0]), (int(short[0]) + 1) % len(corners)
        raise GeometryError(f"outline: points {k} and {after} (from 0) are the same; remove one")


def _refuse_crossings(corners: FloatArray) -> None:
    """Check every pair of edges: edges that are not neighbours must not meet, and neighbours must
    not fold back onto each other."""
    count = len(corners)
    ends = np.roll(corners, -1, axis=0)
    for k in range(count):
        after = (k + 1) % count
        u, v = ends[k] - corners[k], ends[after] - corners[after]
        if abs(u[0] * v[1] - u[1] * v[0]) <= 1e-9 * np.hypot(*u) * np.hypot(*v) and u @ v < 0:
            raise GeometryError(
                f"outline: it folds back on itself at point {after} (from 0); remove that point"
            )
        others = np.arange(k + 2, count - (1 if k == 0 else 0))
        if not len(others):
            continue
        c, d = corners[others], ends[others]
        side = _turn(corners[k], ends[k], c) * _turn(corners[k], ends[k], d)
        back = _turn(c, d, corners[k]) * _turn(c, d, ends[k])
        low_k, high_k = np.minimum(corners[k], ends[k]), np.maximum(corners[k], ends[k])
        near = ((np.minimum(c, d) <= high_k) & (low_k <= np.maximum(c, d))).all(axis=1)
        meets = np.flatnonzero((side <= 0) & (back <= 0) & near)
        if len(meets):
            raise GeometryError(
                f"outline: it crosses or touches itself, edge {k} with edge {int(others[meets[0]])}"
                " (from 0); list the points in order along the rim"
            )


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the sign of the turn from a via b to c (last axis x, y), broadcast."""
    return np.asarray(
        np.sign(
            (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        )
    )
