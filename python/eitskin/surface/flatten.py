"""Flatten a surface that is a disk in the sense of topology, conformally, so that its rim keeps its
length.

A conformal map changes lengths near each place by one factor, exp(u) flat mm per true mm. Among all
flat copies, the one with u = 0 on the rim has the least spread of u (Springborn, Schroeder and
Pinkall, ACM Trans. Graph. 27, 2008), unrolls what can be unrolled without any change, and leaves
electrodes at the rim as wide as they are. The steps are those of boundary first flattening (Sawhney
and Crane, ACM Trans. Graph. 37, 2017): u solves Laplace's equation with the curvature as its
source; it gives the rim's direction on the plane, and so the rim; inside, both coordinates are
harmonic.
"""

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import GeometryError, missing_extra
from eitskin.surface.topology import rim_loop

try:
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error


def flattened(points_mm: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the places (N, 2) in mm of the vertices ``points_mm`` (N, 3) on the flattened copy.
    Its rim has the true length, and its centre of area is (0, 0).

    Raises:
        GeometryError: the flat copy overlaps itself: the surface is curved too strongly.
    """
    rim = rim_loop(triangles)
    angles = corner_angles(points_mm, triangles)
    laplacian = cotangent_laplacian(triangles, angles, len(points_mm))
    missing = 2 * np.pi - np.bincount(
        triangles.ravel(), weights=angles.ravel(), minlength=len(points_mm)
    )
    inside = np.setdiff1d(np.arange(len(points_mm)), rim)
    below = laplacian[inside]
    factors = splu(below[:, inside].tocsc())
    u = np.zeros(len(points_mm))
    u[inside] = factors.solve(-missing[inside])
    turns = missing[rim] - np.pi + (laplacian @ u)[rim]
    flat = np.zeros((len(points_mm), 2))
    flat[rim] = _closed_curve(points_mm[rim], turns)
    flat[inside] = factors.solve(-(below[:, rim] @ flat[rim]))
    corners = flat[triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    doubled = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    if doubled.min() <= 0:
        turned = int(np.count_nonzero(doubled <= 0))
        raise GeometryError(
            f"surface: it cannot be flattened: {turned} of {len(triangles)} triangles turn over on"
            " the flat copy; cut the surface into flatter skins, or make its mesh finer and more"
            " even"
        )
    middle = (corners.mean(axis=1) * doubled[:, None]).sum(axis=0) / doubled.sum()
    return np.asarray(flat - middle)


def _closed_curve(points_mm: FloatArray, turns: FloatArray) -> FloatArray:
    """Return the plane's closed curve (B, 2) that turns by ``turns`` (B,) at its corners and has
    the edges of the loop ``points_mm`` (B, 3), each changed as little as closing it needs."""
    lengths = np.linalg.norm(np.roll(points_mm, -1, axis=0) - points_mm, axis=1)
    heading = np.cumsum(turns * (2 * np.pi / turns.sum()))
    along = np.column_stack([np.cos(heading), np.sin(heading)])
    # least squares of the relative changes of the lengths, such that the edges add up to 0
    moment = (along * lengths[:, None]).T @ along
    lengths = lengths * (1 - along @ np.linalg.solve(moment, along.T @ lengths))
    steps = along * lengths[:, None]
    return np.asarray(np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)[:-1]]))


def corner_angles(points_mm: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the angle at each corner of each triangle, (T, 3)."""
    corners = points_mm[triangles]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(after, before), axis=2)
    return np.asarray(np.arctan2(across, (after * before).sum(axis=2)))


def cotangent_laplacian(triangles: IntArray, angles: FloatArray, count: int) -> csc_matrix:
    """Return the stiffness matrix (N, N) of linear elements for a sheet of conductance 1: half the
    cotangents of the angles opposite to each edge."""
    half = 0.5 / np.tan(angles)
    rows, columns, values = [], [], []
    for k in range(3):
        i, j, w = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3], half[:, k]
        rows += [i, j, i, j]
        columns += [j, i, i, j]
        values += [-w, -w, w, w]
    return csc_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        shape=(count, count),
    )
