"""The mirror images that the rim adds to touches. No current crosses the rim, so it reflects the
dipole field of a touch."""

import numpy as np
import numpy.typing as npt

from eitskin.arrays import ComplexArray, FloatArray
from eitskin.skin.outline import Outline

PIECES = 1200  # of the rim, at least, in the integral equation
NEAR_RIM = 2.0  # pieces: closer to the rim, the nearest one counts as straight
POINTS_AT_ONCE = 512


def rim_mirror(outline: Outline, points_mm: npt.ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return the mirror (a, b) of a dipole at each of ``points_mm`` (k, 2), both (k,) complex.

    With x + iy for vectors, a dipole p at z_p makes the conjugate field p / (z - z_p)^2 at z, and
    the rim adds -conj(p) / (a - b z)^2. This is exact for a disk of radius R: a = R, b = conj(z_p)
    / R. Any other outline is replaced, for each point, by the disk whose mirror agrees with that of
    the outline at the point itself, with its first derivative. With the conformal map f of the
    outline to the unit disk that takes z_p to 0, and l = |f'(z_p)|, the mirror is b = c / l and a =
    (1 + c z_p) / l, where c is the derivative (d/dx - i d/dy) / 2 of log l by the point.

    Points outside and those next to the rim take the nearest piece of the rim as straight: b =
    conj(n) with the outward normal n of that piece, and a = b (z_p + 2 d n) with the distance d to
    it.
    """
    points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
    place = points[:, 0] + 1j * points[:, 1]
    if outline.diameter_mm is not None:
        radius = outline.diameter_mm / 2
        return np.full(len(place), complex(radius)), np.asarray(
            np.conj(place) / radius, dtype=np.complex128
        )
    corners = np.asarray(outline.vertices_mm, dtype=np.float64)
    start = corners[:, 0] + 1j * corners[:, 1]
    along = np.roll(start, -1) - start
    offset = place[:, None] - start[None, :]
    share = np.clip((offset * np.conj(along)).real / np.abs(along) ** 2, 0.0, 1.0)
    away = share * along - offset  # vector from the place to the nearest point of each edge
    nearest = np.argmin(np.abs(away), axis=1)
    to_rim = away[np.arange(len(place)), nearest]
    outward = -1j * along[nearest] / np.abs(along[nearest])  # the rim runs counterclockwise
    distance = np.abs(to_rim)
    inside = outline.contains(points)
    normal = np.where((distance > 1e-9) & inside, to_rim / np.maximum(distance, 1e-9), outward)
    b = np.asarray(np.conj(normal), dtype=np.complex128)
    a = b * (place + 2 * np.where(inside, distance, 0.0) * normal)
    longest = outline.perimeter_mm / PIECES
    deep = np.flatnonzero(inside & (distance > NEAR_RIM * longest))
    for part in np.array_split(deep, -(-len(deep) // POINTS_AT_ONCE) or 1):
        slope, growth = _map_to_disk(_cut(start, longest), place[part])
        b[part], a[part] = growth / slope, (1 + growth * place[part]) / slope
    return a, b


def _cut(corners: ComplexArray, longest: float) -> ComplexArray:
    """Return the polygon's ``corners`` with more of them on edges over ``longest`` mm."""
    edges = zip(corners, np.roll(corners, -1), strict=True)
    parts = [
        begin + (end - begin) * np.arange(count) / count
        for begin, end in edges
        for count in [int(np.ceil(abs(end - begin) / longest))]
    ]
    return np.concatenate(parts)


def _map_to_disk(begin: ComplexArray, place: ComplexArray) -> tuple[FloatArray, ComplexArray]:
    """Return l = |f'(z_p)| (k,) and c = (d/dx - i d/dy) / 2 of log l (k,) at each ``place`` (k,)
    inside the polygon with the corners ``begin`` (p,).

    log |f(z)| = log |z - z_p| - h(z) with the harmonic function h that equals log |z - z_p| on the
    rim; so l = exp(-h(z_p)), and c = -2 dh/dz there, as h is symmetric in z and z_p. h is the
    potential of a double layer with one density per edge (R. Kress, Linear Integral Equations,
    chapter 6), which is the density times the angle under which the edge is seen.
    """
    end = np.roll(begin, -1)
    middle = (begin + end) / 2
    turns = _angles(begin, end, middle)
    np.fill_diagonal(turns, np.pi)  # an edge seen from its own middle, from within
    rim = np.log(np.abs(middle[:, None] - place))
    density = np.linalg.solve(turns, rim).T
    height = (density * _angles(begin, end, place)).sum(axis=1)
    slope = density * (1 / (begin - place[:, None]) - 1 / (end - place[:, None]))
    return np.exp(-height), np.asarray(1j * slope.sum(axis=1))


def _angles(begin: ComplexArray, end: ComplexArray, seen_from: ComplexArray) -> FloatArray:
    """Return the angles (k, p) under which edges are seen, counterclockwise ones positive."""
    eye = seen_from[:, None]
    return np.asarray(np.angle((end - eye) / (begin - eye)))
