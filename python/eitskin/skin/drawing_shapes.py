"""The shapes of a drawing, in mm with y up, and the conversion of curves to straight pieces."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError

TOLERANCE_MM = 0.1
MAX_SHAPES = 20_000
MAX_DEPTH = 100  # limit of nested groups or blocks
MAX_PIECES = 2_000
MAX_POINTS = 30_000  # limit for all shapes together, after curves are flattened


@dataclass(frozen=True, eq=False)
class DrawnShape:
    """One line of a drawing: ``points_mm`` (k, 2) with y up and curves flattened. The last point of
    a closed shape does not repeat the first.

    ``name`` is the shape's own id, or empty; ``names`` also holds its classes, its layer, and the
    names of the groups around it. ``part_of`` is the same number for all parts of one path.
    """

    name: str
    names: frozenset[str]
    points_mm: FloatArray
    closed: bool
    part_of: int | None = None

    @property
    def middle_mm(self) -> FloatArray:
        """The middle of the bounding box, (2,)."""
        return np.asarray((self.points_mm.min(axis=0) + self.points_mm.max(axis=0)) / 2)


@dataclass(frozen=True)
class DrawingReading:
    """Options for reading a drawing: ``scale_mm`` is mm per unit of the drawing (None: the file's
    own units), and ``tolerance_mm`` is how far a flattened curve may be from the true one."""

    scale_mm: float | None = None
    tolerance_mm: float = TOLERANCE_MM


class TooManyPoints(Exception):
    """Raised when the shapes have more than ``MAX_POINTS`` points."""


def limited(shapes: Iterable[DrawnShape], where: str) -> list[DrawnShape]:
    """Return ``shapes`` as a list, once they are known to have at most ``MAX_POINTS`` points.

    Raises:
        ConfigError: they have more points.
    """
    found, points = [], 0
    try:
        for one in shapes:
            points += len(one.points_mm)
            if points > MAX_POINTS:
                raise TooManyPoints
            found.append(one)
    except TooManyPoints:
        raise ConfigError(
            f"{where}: over {MAX_POINTS} points, curves flattened; export the outline alone, or"
            " simplify it"
        ) from None
    return found


def flattened(
    point_at: Callable[[float], tuple[float, float]], pieces: float
) -> list[tuple[float, float]]:
    """Return the points of a curve after its first, at equal steps of its parameter from 0 to 1, in
    about ``pieces`` pieces."""
    count = min(max(1, math.ceil(pieces)), MAX_PIECES) if math.isfinite(pieces) else 1
    return [point_at((k + 1) / count) for k in range(count)]


def bezier_pieces(controls: npt.ArrayLike, tolerance: float) -> float:
    """Return how many straight pieces keep a Bezier curve of degree d with ``controls`` (d + 1, 2)
    within ``tolerance``. The bound by second differences is sqrt(d (d - 1) max|P_i - 2 P_i+1 +
    P_i+2| / (8 tolerance))."""
    bent = np.diff(np.asarray(controls, dtype=np.float64), n=2, axis=0)
    degree = len(bent) + 1
    return math.sqrt(
        degree * (degree - 1) * float(np.hypot(bent[:, 0], bent[:, 1]).max()) / (8 * tolerance)
    )


def arc_pieces(radius: float, sweep_rad: float, tolerance: float) -> float:
    """Return how many straight pieces keep an arc within ``tolerance``, at least 6 per turn: a
    chord over an angle a deviates from the arc by radius (1 - cos(a / 2))."""
    share = min(max(tolerance / radius, 1e-9), 0.5) if radius > 0 else 0.5
    return abs(sweep_rad) / (2 * math.acos(1 - share))
