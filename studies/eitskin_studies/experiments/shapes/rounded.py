"""Outlines of straight sides and rounded corners, as a polygon, as an SVG path and as a DXF
polyline."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from eitskin.errors import GeometryError
from eitskin.skin.outline import Outline, polygon


@dataclass(frozen=True)
class Corner:
    """A corner of an outline that is listed counterclockwise, with the radius that it is rounded
    by; mm."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Fillet:
    """The arc that rounds a corner: from ``begin`` to ``end`` about ``centre``, turning by
    ``turn_rad``, to the left above 0."""

    begin: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float]
    radius: float
    turn_rad: float


def fillets(corners: Sequence[Corner]) -> list[Fillet]:
    """The arc of each corner; a corner of turn a takes radius tan(|a| / 2) of both its sides.

    Raises:
        GeometryError: two corners take more than the side between them has.
    """
    count, found, taken = len(corners), [], []
    for k, corner in enumerate(corners):
        into, out = (_unit(corners[j], corners[(j + 1) % count]) for j in (k - 1, k))
        turn = math.atan2(into[0] * out[1] - into[1] * out[0], into[0] * out[0] + into[1] * out[1])
        reach = corner.radius * math.tan(abs(turn) / 2)
        begin = (corner.x - reach * into[0], corner.y - reach * into[1])
        end = (corner.x + reach * out[0], corner.y + reach * out[1])
        side = math.copysign(corner.radius, turn)
        found.append(
            Fillet(
                begin,
                end,
                (begin[0] - side * into[1], begin[1] + side * into[0]),
                corner.radius,
                turn,
            )
        )
        taken.append(reach)
    for k, corner in enumerate(corners):
        after = corners[(k + 1) % count]
        if taken[k] + taken[(k + 1) % count] > math.hypot(after.x - corner.x, after.y - corner.y):
            raise GeometryError(
                f"outline: the side after corner {k} (from 0) is too short for its corners; use"
                " smaller radii"
            )
    return found


def as_outline(corners: Sequence[Corner], tolerance_mm: float = 0.1) -> Outline:
    """The polygon whose chords lie within ``tolerance_mm`` of the arcs.

    Raises:
        GeometryError: as ``fillets`` and ``polygon``.
    """
    points = []
    for arc in fillets(corners):
        step = 2 * math.acos(1 - min(tolerance_mm / arc.radius, 0.5))
        count = max(1, math.ceil(abs(arc.turn_rad) / step))
        start = math.atan2(arc.begin[1] - arc.centre[1], arc.begin[0] - arc.centre[0])
        for k in range(count + 1):
            angle = start + arc.turn_rad * k / count
            points.append(
                (
                    arc.centre[0] + arc.radius * math.cos(angle),
                    arc.centre[1] + arc.radius * math.sin(angle),
                )
            )
    return polygon(points)


def as_svg_path(corners: Sequence[Corner], height_mm: float) -> str:
    """The path's data in mm with y down from ``height_mm``."""
    words: list[str] = []
    for arc in fillets(corners):
        sweep = 0 if arc.turn_rad > 0 else 1  # y down turns it round
        words.append(f"{'L' if words else 'M'}{arc.begin[0]:.3f},{height_mm - arc.begin[1]:.3f}")
        words.append(
            f"A{arc.radius:g},{arc.radius:g} 0 0 {sweep}"
            f" {arc.end[0]:.3f},{height_mm - arc.end[1]:.3f}"
        )
    return " ".join([*words, "Z"])


def as_polyline(corners: Sequence[Corner]) -> list[tuple[float, float, float]]:
    """x, y in mm and DXF's bulge, the tangent of a quarter of the arc's angle, of each point."""
    return [
        point
        for arc in fillets(corners)
        for point in ((*arc.begin, math.tan(arc.turn_rad / 4)), (*arc.end, 0.0))
    ]


def _unit(a: Corner, b: Corner) -> tuple[float, float]:
    length = math.hypot(b.x - a.x, b.y - a.y)
    return (b.x - a.x) / length, (b.y - a.y) / length
