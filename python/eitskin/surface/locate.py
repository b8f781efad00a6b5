"""Find places in triangulations: the triangle that holds a place of the plane, and the nearest
point of a surface or a rim."""

import numpy as np

from eitskin.arrays import FloatArray, IntArray

INSIDE = -1e-9  # least weight of a corner at which a place counts as within the triangle
POINTS_AT_ONCE = 2048


class Locator:
    """Finds the triangles of the plane that hold places. Cells of a grid know the triangles that
    their squares meet."""

    def __init__(self, nodes: FloatArray, triangles: IntArray) -> None:
        self._nodes, self._triangles = nodes, triangles
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        self._low = low
        self._side = float(np.sqrt(np.prod(high - low) / len(triangles)))
        self._size = np.maximum(np.ceil((high - low) / self._side).astype(np.int64), 1)
        cell = np.clip(((nodes - low) / self._side).astype(np.int64), 0, self._size - 1)
        corners = cell[triangles]
        first, last = corners.min(axis=1), corners.max(axis=1)
        width, height = (last - first + 1).T
        count = width * height
        owner = np.repeat(np.arange(len(triangles)), count)
        place = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        row, column = np.divmod(place, width[owner])
        number = (first[owner, 1] + row) * self._size[0] + first[owner, 0] + column
        order = np.argsort(number, kind="stable")
        self._sorted = owner[order]
        self._begin = np.searchsorted(number[order], np.arange(int(np.prod(self._size)) + 1))

    def find(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the triangle (k,) that holds each of ``places`` (k, 2), -1 for none, and the
        weights of its corners, (k, 3)."""
        triangle = np.full(len(places), -1, dtype=np.int64)
        weight = np.zeros((len(places), 3))
        cell = np.floor((places - self._low) / self._side)
        known = np.isfinite(cell).all(axis=1) & (cell >= -1).all(axis=1)
        known &= (cell <= self._size).all(axis=1)
        for start in range(0, len(places), POINTS_AT_ONCE):
            mine = start + np.flatnonzero(known[start : start + POINTS_AT_ONCE])
            if len(mine):
                triangle[mine], weight[mine] = self._find(places[mine], cell[mine])
        return triangle, weight

    def _find(self, places: FloatArray, cell: FloatArray) -> tuple[IntArray, FloatArray]:
        near = np.clip(cell.astype(np.int64), 0, self._size - 1)
        number = near[:, 1] * self._size[0] + near[:, 0]
        count = self._begin[number + 1] - self._begin[number]
        owner = np.repeat(np.arange(len(places)), count)
        at = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        candidate = self._sorted[self._begin[number][owner] + at]
        weight = weights_in_plane(places[owner], self._nodes[self._triangles[candidate]])
        least = weight.min(axis=1)
        # of several that hold it, on a common edge, the one that holds it deepest
        order = np.lexsort((-least, owner))
        first = order[np.r_[True, np.diff(owner[order]) != 0]] if len(order) else order
        good = first[least[first] >= INSIDE]
        triangle = np.full(len(places), -1, dtype=np.int64)
        found = np.zeros((len(places), 3))
        triangle[owner[good]] = candidate[good]
        found[owner[good]] = weight[good]
        return triangle, found


def weights_in_plane(places: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the weights (k, 3) by which the corners (k, 3, 2) of triangles make ``places``
    (k, 2)."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    w = places - corners[:, 0]
    whole = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    second = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / whole
    third = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / whole
    return np.column_stack([1 - second - third, second, third])


def nearest_on_segments(
    points: FloatArray, begin: FloatArray, end: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the segment (k,) nearest to each of ``points`` (k, d) among those from ``begin`` to
    ``end`` (b, d), and how far along it the nearest place is, from 0 to 1, (k,)."""
    step = end - begin
    segment = np.zeros(len(points), dtype=np.int64)
    share = np.zeros(len(points))
    for k, point in enumerate(points):
        along, square = _along(point, begin, step)
        segment[k] = np.argmin(square)
        share[k] = along[segment[k]]
    return segment, share


def _along(point: FloatArray, begin: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far along each segment from ``begin`` by ``step`` (b, d) its place nearest to
    ``point`` (d,) is, from 0 to 1, and the square of the distance to that place, both (b,)."""
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    share = np.clip(((point - begin) * step).sum(axis=1) / length, 0.0, 1.0)
    return share, ((begin + share[:, None] * step - point) ** 2).sum(axis=1)


def nearest_on_triangles(
    points: FloatArray, nodes: FloatArray, triangles: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the triangle (k,) of the surface that is nearest to each of ``points`` (k, 3), the
    weights of its corners at the nearest place, (k, 3), and the distance to that place, (k,)."""
    corners = nodes[triangles]
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    found = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    away = np.zeros(len(points))
    for k, point in enumerate(points):
        distance = np.linalg.norm(middles - point, axis=1)
        near = np.flatnonzero(distance - reach <= (distance + reach).min())
        weight = _nearest_weights(point, corners[near])
        places = (weight[:, :, None] * corners[near]).sum(axis=1)
        lengths = np.linalg.norm(places - point, axis=1)
        best = int(np.argmin(lengths))
        found[k], weights[k], away[k] = near[best], weight[best], lengths[best]
    return found, weights, away


def _nearest_weights(point: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the weights (t, 3) of the place of each triangle (t, 3, 3) nearest to ``point``."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], point - corners[:, 0]
    uu, uv, vv = ((a * b).sum(axis=1) for a, b in ((u, u), (u, v), (v, v)))
    uw, vw = (u * w).sum(axis=1), (v * w).sum(axis=1)
    whole = np.maximum(uu * vv - uv**2, 1e-300)
    second, third = (vv * uw - uv * vw) / whole, (uu * vw - uv * uw) / whole
    weight = np.column_stack([1 - second - third, second, third])
    outside = np.flatnonzero(weight.min(axis=1) < 0)
    best = np.full(len(outside), np.inf)
    for first in range(3):
        last = (first + 1) % 3
        begin, step = corners[outside, first], corners[outside, last] - corners[outside, first]
        share, away = _along(point, begin, step)
        wins = away < best
        best[wins] = away[wins]
        own = np.zeros((int(wins.sum()), 3))
        own[:, first], own[:, last] = 1 - share[wins], share[wins]
        weight[outside[wins]] = own
    return weight
