"""The flattened copy of a surface as a skin's plane: how it lies, and its outline."""

from dataclasses import replace

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.surface.surface_map import SurfaceMap

ROUND = 2e-3  # a rim that is this close to a circle, relative to the radius, counts as one
TOLERANCE = 2.5e-4  # by how much the outline may miss the rim, as a part of the copy's size
ALONG = ((1, 1), (0, 0), (2, 1))  # axes of the mesh and of the copy that may lie along each other


def surface_map(
    points_mm: FloatArray, triangles: IntArray, link: str = "", simplified_from: int = 0
) -> SurfaceMap:
    """Return the map of a surface to its flattened copy, which is turned so that the mesh's axis y
    or x lies along it, whichever changes most over the surface (z, along y, if that does). A copy
    with a round rim has its centre at (0, 0).

    Raises:
        GeometryError: the surface cannot be flattened.
    """
    from eitskin.surface.flatten import flattened  # needs scipy, the rest of this module does not

    flat = flattened(points_mm, triangles)
    along = (points_mm - points_mm.mean(axis=0)).T @ (flat - flat.mean(axis=0))
    lengths = np.linalg.norm(along, axis=1)
    mesh_axis, flat_axis = next((m, f) for m, f in ALONG if lengths[m] > 0.8 * lengths.max())
    x, y = along[mesh_axis] / lengths[mesh_axis]
    turn = np.array([[x, y], [-y, x]]) if flat_axis == 0 else np.array([[y, -x], [x, y]])
    flat = flat @ turn.T
    surface = SurfaceMap(flat, points_mm, triangles, link, simplified_from)
    circle = rim_circle(surface.rim_mm)
    return surface if circle is None else replace(surface, flat_mm=flat - circle[0])


def rim_circle(rim_mm: FloatArray) -> tuple[FloatArray, float] | None:
    """Return centre and radius in mm of the circle on which the closed curve ``rim_mm`` (B, 2)
    lies, or None if it is not round."""
    following = np.roll(rim_mm, -1, axis=0)
    weight = np.linalg.norm(following - rim_mm, axis=1)
    centre = ((rim_mm + following) / 2 * weight[:, None]).sum(axis=0) / weight.sum()
    away = np.linalg.norm(rim_mm - centre, axis=1)
    radius = float(away.mean())
    if np.abs(away - radius).max() > ROUND * radius or weight.max() > radius / 2:
        return None
    return centre, radius


def simplified(rim_mm: FloatArray) -> FloatArray:
    """Return the closed curve (B, 2) with fewer corners: every corner left out lies within
    TOLERANCE of the copy's size of the curve (Douglas and Peucker, Cartographica 10, 1973)."""
    tolerance = TOLERANCE * float(np.ptp(rim_mm, axis=0).max())
    start = int(np.argmax(np.linalg.norm(rim_mm - rim_mm.mean(axis=0), axis=1)))
    rim = np.roll(rim_mm, -start, axis=0)
    far = int(np.argmax(np.linalg.norm(rim - rim[0], axis=1)))
    closed = np.vstack([rim, rim[:1]])
    kept: BoolArray = np.zeros(len(closed), dtype=np.bool_)
    kept[[0, far, len(rim)]] = True
    parts = [(0, far), (far, len(rim))]
    while parts:
        first, last = parts.pop()
        inner = closed[first + 1 : last]
        if not len(inner):
            continue
        step = closed[last] - closed[first]
        share = np.clip((inner - closed[first]) @ step / max(step @ step, 1e-300), 0, 1)
        away = np.linalg.norm(inner - closed[first] - share[:, None] * step, axis=1)
        worst = int(np.argmax(away))
        if away[worst] > tolerance:
            middle = first + 1 + worst
            kept[middle] = True
            parts += [(first, middle), (middle, last)]
    return np.asarray(closed[:-1][kept[:-1]])
