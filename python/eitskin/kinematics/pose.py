"""Poses: where one frame of reference is in another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import GeometryError

NORM_SLACK = 1e-3  # by which the length of a quaternion may differ from 1


@dataclass(frozen=True, eq=False)
class Pose:
    """A frame of reference in another one: a place p of the first is ``rotation`` p +
    ``translation_m`` in the second."""

    rotation: FloatArray  # (3, 3)
    translation_m: FloatArray  # (3,)

    def points(self, points_m: npt.ArrayLike) -> FloatArray:
        """(..., 3) places of the first frame in the second, m."""
        return np.asarray(np.asarray(points_m) @ self.rotation.T + self.translation_m)

    def __matmul__(self, inner: "Pose") -> "Pose":
        """Return the pose of the frame that ``inner`` places in this pose's first frame."""
        return Pose(self.rotation @ inner.rotation, self.points(inner.translation_m))

    def matrix(self) -> FloatArray:
        """(4, 4), homogeneous."""
        whole = np.eye(4)
        whole[:3, :3], whole[:3, 3] = self.rotation, self.translation_m
        return whole


IDENTITY = Pose(np.eye(3), np.zeros(3))


def from_rpy(xyz_m: Sequence[float], rpy_rad: Sequence[float]) -> Pose:
    """The pose of a URDF's origin: turned about the fixed axes x, y and z, one after the other."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy_rad), np.sin(rpy_rad)
    rotation = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return Pose(np.array(rotation), np.array(xyz_m, dtype=np.float64))


def from_quaternion(xyz_m: Sequence[float], quaternion_xyzw: Sequence[float]) -> Pose:
    """The pose with the rotation of a quaternion of length 1.

    Raises:
        GeometryError: its length is not 1.
    """
    length = float(np.linalg.norm(quaternion_xyzw))
    if abs(length - 1) > NORM_SLACK:
        raise GeometryError(
            f"quaternion_xyzw has the length {length:.4g}, so it is not a rotation; its length"
            " must be 1, and w is the last of the four numbers"
        )
    x, y, z, w = np.asarray(quaternion_xyzw, np.float64) / length
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return Pose(np.array(rotation), np.array(xyz_m, dtype=np.float64))


def quaternion_xyzw(rotation: FloatArray) -> tuple[float, float, float, float]:
    """The quaternion of a rotation (3, 3), with w >= 0."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    # The four products 4 q_k^2; the greatest divides, so that nothing small does.
    squares = (1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i)
    rows = (
        (squares[0], b + d, c + g, h - f),
        (b + d, squares[1], f + h, c - g),
        (c + g, f + h, squares[2], d - b),
        (h - f, c - g, d - b, squares[3]),
    )
    best = max(range(4), key=squares.__getitem__)
    scale = 0.5 / squares[best] ** 0.5
    if rows[best][3] < 0:
        scale = -scale
    x, y, z, w = (scale * one for one in rows[best])
    return x, y, z, w
