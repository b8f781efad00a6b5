"""Touches in the frame of reference of a robot's link."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.kinematics.pose import IDENTITY, Pose, quaternion_xyzw
from eitskin.surface.surface_map import (
    LocatedTouch,
    SurfaceMap,
    covariance_in_space,
    flat_covariance_mm2,
)


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
    the skin; for a ``surface`` it is the pose of its mesh."""

    link: str
    pose: Pose = IDENTITY
    surface: SurfaceMap | None = None

    def place(self, touch: LocatedTouch) -> PlacedTouch:
        """Return ``touch`` in the link's frame. On a surface, the covariance includes the
        uncertainty of the touch's radius (``SurfaceMap.touch``); touches after a drive have
        none."""
        if self.surface is not None and isinstance(touch, Touch):
            there = self.surface.touch(touch)
            point_m, tangents, normal = there.point_m, there.tangents, there.normal
            scale, covariance = there.scale, there.covariance_m2
        else:
            point_m, scale = np.array([touch.x_mm / 1e3, touch.y_mm / 1e3, 0.0]), 1.0
            tangents, normal = np.eye(3)[:, :2], np.array([0.0, 0.0, 1.0])
            if self.surface is not None:
                places = self.surface.at([touch.x_mm, touch.y_mm])
                point_m, scale = places.point_m[0], float(places.scale[0])
                tangents, normal = places.tangents[0], places.normal[0]
            flat = flat_covariance_mm2(touch)
            covariance = None if flat is None else covariance_in_space(flat, tangents, scale)
        turn, velocity = self.pose.rotation, None
        if hasattr(touch, "vx_mm_per_s") and hasattr(touch, "vy_mm_per_s"):
            flat_velocity = np.array([touch.vx_mm_per_s, touch.vy_mm_per_s])
            velocity = scale / 1e3 * (turn @ tangents @ flat_velocity)
        return PlacedTouch(
            position_m=self.pose.points(point_m),
            rotation=turn @ np.column_stack([tangents, normal]),
            scale=scale,
            covariance_m2=None if covariance is None else turn @ covariance @ turn.T,
            velocity_m_per_s=velocity,
        )
