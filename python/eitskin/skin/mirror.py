"""The mirror images that the rim adds to touches. No current crosses the rim, so it reflects the
dipole field of a touch."""

import numpy as np
import numpy.typing as npt

from eitskin.arrays import ComplexArray
from eitskin.skin.outline import Outline


def rim_mirror(outline: Outline, points_mm: npt.ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return the mirror (a, b) of a dipole at each of ``points_mm`` (k, 2), both (k,) complex.

    With x + iy for vectors, a dipole p at z_p makes the conjugate field p / (z - z_p)^2 at z, and
    the rim adds -conj(p) / (a - b z)^2. This is exact for a disk of radius R: a = R, b = conj(z_p)
    / R. For other outlines the nearest piece of the rim is taken as straight: b = conj(n) with the
    outward normal n of that piece, and a = b (z_p + 2 d n) with the distance d to it.
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
    b = np.conj(normal)
    return b * (place + 2 * np.where(inside, distance, 0.0) * normal), b
