"""Touches in the frame of reference of a robot's link."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.kinematics.pose import IDENTITY, Pose, quaternion_xyzw
from eitskin.surface.surface_map import SurfaceMap


class FlatTouch(Protocol):
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
class PlacedTouch:
    """A touch in its link's frame.

    Attributes:
        position_m: (3,) its centre.
        rotation: (3, 3) columns: the directions of the drawing's x and y on the skin, and the
            normal, out of the skin. A finger presses against the normal.
        scale: true millimetres per millimetre of the drawing there; 1 on a flat skin.
        covariance_m2: (3, 3) of ``position_m``, 0 along the normal; None: not known.
        velocity_m_per_s: (3,) of a touch after a drive; None: of a frame.
    """

    position_m: FloatArray
    rotation: FloatArray
    scale: float
    covariance_m2: FloatArray | None
    velocity_m_per_s: FloatArray | None = None

    @property
    def normal(self) -> FloatArray:
        """(3,) of length 1, out of the skin."""
        return self.rotation[:, 2]

    def as_dict(self) -> dict[str, Any]:
        """The fields that it adds to a touch in a message."""
        covariance, velocity = self.covariance_m2, self.velocity_m_per_s
        facts = {
            "position_m": self.position_m.tolist(),
            "normal": self.normal.tolist(),
            "quaternion_xyzw": list(quaternion_xyzw(self.rotation)),
            "scale": self.scale,
            "covariance_m2": None if covariance is None else covariance.tolist(),
        }
        return facts if velocity is None else facts | {"velocity_m_per_s": velocity.tolist()}


@dataclass(frozen=True, eq=False)
class Placement:
    """The place of a skin in the frame of ``link``. ``pose`` is that of its drawing, with z out of
    the skin; of a ``surface`` it is that of its mesh."""

    link: str
    pose: Pose = IDENTITY
    surface: SurfaceMap | None = None

    def place(self, touch: FlatTouch) -> PlacedTouch:
        """``touch`` in the link's frame."""
        if self.surface is None:
            position_m = self.pose.points([touch.x_mm / 1e3, touch.y_mm / 1e3, 0.0])
            return _placed(touch, position_m, self.pose.rotation, 1.0)
        if isinstance(touch, Touch):
            there = self.surface.touch(touch)
            point_m, normal, tangents = there.point_m, there.normal, there.tangents
            scale = there.scale
        else:  # after a drive, without a shape
            places = self.surface.at([touch.x_mm, touch.y_mm])
            point_m, normal, tangents = places.point_m[0], places.normal[0], places.tangents[0]
            scale = float(places.scale[0])
        rotation = self.pose.rotation @ np.column_stack([tangents, normal])
        return _placed(touch, self.pose.points(point_m), rotation, scale)


def _placed(
    touch: FlatTouch, position_m: FloatArray, rotation: FloatArray, scale: float
) -> PlacedTouch:
    m_per_mm, tangents = scale / 1e3, rotation[:, :2]
    xx, xy, yy = touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2
    covariance = None
    if xx is not None and xy is not None and yy is not None:
        covariance = m_per_mm**2 * tangents @ np.array([[xx, xy], [xy, yy]]) @ tangents.T
    velocity = None
    if hasattr(touch, "vx_mm_per_s") and hasattr(touch, "vy_mm_per_s"):
        velocity = m_per_mm * tangents @ np.array([touch.vx_mm_per_s, touch.vy_mm_per_s])
    return PlacedTouch(position_m, rotation, scale, covariance, velocity)
