"""The true places of touches at any instant, for frames whose rows are measured at different
instants."""

from dataclasses import dataclass, fields

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FrameError

NAMES = ("path_touch", "path_time_s", "path_xy_mm", "path_radius_mm", "path_strength")


@dataclass(frozen=True, eq=False)
class Paths:
    """Points (i,) on the paths of touches, which are straight between consecutive points.

    ``path_touch`` is the number of the touch, ascending. ``path_time_s`` ascends within a touch, on
    the same axis as the frames' ``time_s``. ``path_xy_mm`` (i, 2), ``path_radius_mm`` and
    ``path_strength`` are defined like the frames' touch fields. A touch exists from its first point
    to its last.
    """

    path_touch: IntArray
    path_time_s: FloatArray
    path_xy_mm: FloatArray
    path_radius_mm: FloatArray
    path_strength: FloatArray

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.path_touch))
        for one in fields(self):
            values = np.asarray(getattr(self, one.name))
            shape = (count, 2) if one.name == "path_xy_mm" else (count,)
            if values.shape != shape or not np.isfinite(values.astype(np.float64)).all():
                raise FrameError(f"{one.name} must be finite numbers of shape {shape}")
        same = np.diff(self.path_touch) == 0
        if (np.diff(self.path_touch) < 0).any() or (np.diff(self.path_time_s)[same] <= 0).any():
            raise FrameError("path_touch must ascend, and path_time_s within a touch")

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the touches at ``time_s``: places (k, 2) in mm, radii (k,) in mm, strengths
        (k,)."""
        found = []
        for number in np.unique(self.path_touch):
            own = np.flatnonzero(self.path_touch == number)
            times = self.path_time_s[own]
            if not times[0] <= time_s <= times[-1]:
                continue
            columns = (*self.path_xy_mm[own].T, self.path_radius_mm[own], self.path_strength[own])
            found.append([np.interp(time_s, times, column) for column in columns])
        table = np.array(found).reshape(-1, 4)
        return table[:, :2], table[:, 2], table[:, 3]
