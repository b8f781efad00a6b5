"""Places of electrodes as the user gives them: fractions of the rim, points near it, or marks in a
drawing."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.errors import GeometryError
from eitskin.skin.drawing_shapes import DrawnShape
from eitskin.skin.outline import Outline

SNAP_MM = 5.0


@dataclass(frozen=True)
class Placed:
    """Places along the rim in the form that ``Electrodes`` takes: ascending from the start point in
    the numbering direction."""

    positions_mm: tuple[float, ...]
    clockwise: bool


def by_fractions(outline: Outline, fractions: Sequence[float], clockwise: bool) -> Placed:
    """Place electrodes at fractions of the rim's length, each from 0 to below 1, counted from the
    start point."""
    for k, value in enumerate(fractions):
        if not 0 <= value < 1:
            raise GeometryError(
                f"electrodes: fraction {k} (from 0) is {value:g}; use 0 to below 1 of the rim"
            )
    return Placed(tuple(value * outline.perimeter_mm for value in fractions), clockwise)


def by_points(
    outline: Outline,
    points_mm: npt.ArrayLike,
    start_angle_deg: float,
    clockwise: bool | None,
    snap_mm: float = SNAP_MM,
) -> Placed:
    """Place electrodes at the rim's points nearest to ``points_mm`` (k, 2), electrode 0 first. If
    ``clockwise`` is None, the points may go round in either direction.

    Raises:
        GeometryError: a point is more than ``snap_mm`` from the rim, or the points are not in order
            along it.
    """
    points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
    arc_mm, away_mm = nearest_on_rim(outline, points)
    worst = int(np.argmax(away_mm))
    if not away_mm[worst] <= snap_mm:
        x, y = points[worst]
        raise GeometryError(
            f"electrodes: electrode {worst} (from 0) at ({x:g}, {y:g}) mm is {away_mm[worst]:.3g}"
            f" mm from the rim; move it within snap_mm = {snap_mm:g} mm of it"
        )
    start, perimeter = outline.arc_length_at_angle(start_angle_deg), outline.perimeter_mm
    for way in (False, True) if clockwise is None else (clockwise,):
        along = np.mod(start - arc_mm if way else arc_mm - start, perimeter)
        steps = np.mod(np.diff(along), perimeter)
        if steps.sum() < perimeter:
            places = along[0] + np.concatenate([[0.0], np.cumsum(steps)])
            return Placed(tuple(places.tolist()), way)
    way_text = {None: "", True: " clockwise", False: " counterclockwise"}[clockwise]
    raise GeometryError(
        f"electrodes: {len(points)} places are not in order along the rim{way_text}; give them one"
        " after another"
    )


def by_marks(
    outline: Outline,
    marks: Sequence[DrawnShape],
    start_angle_deg: float,
    clockwise: bool | None,
    snap_mm: float = SNAP_MM,
) -> Placed:
    """Place electrodes at the middles of ``marks``. If every id ends with a number, the numbers
    give the order; otherwise the order is that along the rim from the start point.

    Raises:
        GeometryError: two marks have the same number; or as ``by_points``.
    """
    middles = np.array([mark.middle_mm for mark in marks])
    numbers = [re.search(r"(\d+)$", mark.name) for mark in marks]
    if all(numbers):
        values = [int(found[1]) for found in numbers if found is not None]
        if len(set(values)) < len(values):
            twice = next(value for value in values if values.count(value) > 1)
            raise GeometryError(
                f"electrodes: two marks are numbered {twice}; give each its own number"
            )
        return by_points(outline, middles[np.argsort(values)], start_angle_deg, clockwise, snap_mm)
    arc_mm, _ = nearest_on_rim(outline, middles)
    start, way = outline.arc_length_at_angle(start_angle_deg), bool(clockwise)
    along = np.mod(start - arc_mm if way else arc_mm - start, outline.perimeter_mm)
    order = np.argsort(along, kind="stable")
    return by_points(outline, middles[order], start_angle_deg, way, snap_mm)


def nearest_on_rim(outline: Outline, points_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the rim's point nearest to each of ``points_mm`` (k, 2): return its arc length and the
    distance to it, both (k,) in mm."""
    points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
    if outline.diameter_mm is not None:
        radius = outline.diameter_mm / 2
        angle = np.mod(np.arctan2(points[:, 1], points[:, 0]), 2 * np.pi)
        return angle * radius, np.abs(np.hypot(points[:, 0], points[:, 1]) - radius)
    begin = np.asarray(outline.vertices_mm)
    step = np.roll(begin, -1, axis=0) - begin
    length = np.hypot(step[:, 0], step[:, 1])
    offset = points[:, None, :] - begin[None]
    share = np.clip((offset * step).sum(axis=2) / length**2, 0.0, 1.0)
    away = np.sqrt(((offset - share[:, :, None] * step) ** 2).sum(axis=2))
    edge = np.argmin(away, axis=1)
    place = np.arange(len(points))
    arc = outline.corner_arc_lengths_mm()[edge] + share[place, edge] * length[edge]
    return np.mod(arc, outline.perimeter_mm), away[place, edge]
