"""Zones files: named keys, pads and rings of a skin (docs/guide/gestures.md)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.config import check_keys, load_toml, number
from eitskin.core.gestures import Zone
from eitskin.errors import ConfigError, GeometryError
from eitskin.fem.grid import Grid
from eitskin.skin.outline import Outline, polygon

KEYS = {
    "key": ("name", "corners_mm"),
    "pad": ("name", "x_mm", "y_mm", "radius_mm"),
    "ring": ("name", "x_mm", "y_mm", "inner_mm", "outer_mm"),
}
MAX_ZONES = 64
MAX_PLACE_MM = 1e5
ROUND = 96  # corners of a circle, to look for crossings
INWARD_MM = 0.05  # zones may share a border


def load_zones(path: str | Path) -> tuple[Zone, ...]:
    """The zones of a TOML file with tables [[key]], [[pad]] and [[ring]], in that order.

    Raises:
        FileError: the file cannot be read.
        ConfigError: a key is unknown, missing or out of range, a name comes twice, a corner list
            crosses itself, two zones cross, or there are too many.
    """
    table = load_toml(path, "zones file")
    check_keys(table, KEYS, str(path))
    zones = []
    for shape in KEYS:
        rows = table.get(shape, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise ConfigError(f"{path}: write each {shape} as a table  [[{shape}]]")
        zones += [_zone(shape, row, f"{path} [[{shape}]] {k}") for k, row in enumerate(rows, 1)]
    if not 1 <= len(zones) <= MAX_ZONES:
        raise ConfigError(f"{path}: has {len(zones)} zones; name 1 to {MAX_ZONES}")
    names = [zone.name for zone in zones]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"{path}: zone {name!r} comes twice; give each its own name")
    _refuse_crossings([_Area(zone) for zone in zones], path)
    return tuple(zones)


def refuse_off_skin(zones: Sequence[Zone], grid: Grid) -> None:
    """Reject a zone that lies outside the skin entirely, because no finger could press it."""
    for area in map(_Area, zones):
        on_skin = grid.locate(area.inner_points()) >= 0
        if not on_skin.any() and not area.contains(grid.centres_mm()).any():
            low, high = grid.centres_mm().min(axis=0), grid.centres_mm().max(axis=0)
            raise ConfigError(
                f"zone {area.zone.name!r}: lies off the skin, which goes from"
                f" x = {low[0]:.0f} to {high[0]:.0f} mm and y = {low[1]:.0f} to {high[1]:.0f} mm"
            )


def _zone(shape: str, row: Mapping[str, Any], where: str) -> Zone:
    check_keys(row, KEYS[shape], where)
    name = row.get("name")
    if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > 40:
        raise ConfigError(f"{where}: name must be a text of 1 to 40 printable characters")
    if shape == "key":
        return Zone(name, corners_mm=_corners(row, where))

    def length(key: str, low: float) -> float:
        return number(row, key, None, where, low=low, high=MAX_PLACE_MM)

    x, y = length("x_mm", -MAX_PLACE_MM), length("y_mm", -MAX_PLACE_MM)
    if shape == "pad":
        return Zone(name, x_mm=x, y_mm=y, outer_mm=length("radius_mm", 0.1))
    inner, outer = length("inner_mm", 0.1), length("outer_mm", 0.1)
    if not inner < outer:
        raise ConfigError(f"{where}: inner_mm = {inner:g} must be below outer_mm = {outer:g}")
    return Zone(name, x_mm=x, y_mm=y, inner_mm=inner, outer_mm=outer)


def _corners(row: Mapping[str, Any], where: str) -> tuple[tuple[float, float], ...]:
    given = row.get("corners_mm")
    pairs = isinstance(given, list) and all(
        isinstance(one, list)
        and len(one) == 2
        and all(isinstance(n, int | float) and not isinstance(n, bool) for n in one)
        and max(map(abs, one)) <= MAX_PLACE_MM
        for one in given
    )
    if not isinstance(given, list) or not pairs or not 3 <= len(given) <= 64:
        raise ConfigError(
            f"{where}: corners_mm must be 3 to 64 corners [x, y] in mm, within {MAX_PLACE_MM:g}"
        )
    try:
        outline = polygon(given)
    except GeometryError as error:
        raise ConfigError(f"{where}: {error}") from None
    return outline.vertices_mm


@dataclass(frozen=True)
class _Area:
    """A zone as polygons: its outer border, and a ring's inner one."""

    zone: Zone

    @property
    def loops(self) -> list[Outline]:
        zone = self.zone
        if zone.corners_mm:
            return [Outline(zone.corners_mm)]
        turn = 2 * np.pi * np.arange(ROUND) / ROUND
        rim = np.column_stack([np.cos(turn), np.sin(turn)])
        middle = np.array([zone.x_mm, zone.y_mm])
        radii = [zone.outer_mm, zone.inner_mm] if zone.inner_mm else [zone.outer_mm]
        return [Outline(tuple(map(tuple, (middle + r * rim).tolist()))) for r in radii]

    def contains(self, points: FloatArray) -> BoolArray:
        """Return whether each of (k, 2) lies in it."""
        outer, *inner = self.loops
        inside = outer.contains(points)
        return inside & ~inner[0].contains(points) if inner else inside

    def inner_points(self) -> FloatArray:
        """Places just inside its border, beside the middle of each edge."""
        found = []
        for loop, side in zip(self.loops, (1.0, -1.0), strict=False):
            corners = np.array(loop.vertices_mm)
            along = np.roll(corners, -1, axis=0) - corners
            inward = np.column_stack([-along[:, 1], along[:, 0]])
            inward /= np.linalg.norm(inward, axis=1)[:, None]
            found.append(corners + 0.5 * along + side * INWARD_MM * inward)
        return np.vstack(found)


def _refuse_crossings(areas: list[_Area], path: str | Path) -> None:
    for one, other in combinations(areas, 2):
        meet = any(_cross(a, b) for a in one.loops for b in other.loops)
        if (
            meet
            or one.contains(other.inner_points()).any()
            or other.contains(one.inner_points()).any()
        ):
            raise ConfigError(
                f"{path}: zones {one.zone.name!r} and {other.zone.name!r} cross; move them apart,"
                " so that a place is in one zone at most"
            )


def _cross(one: Outline, other: Outline) -> bool:
    """Return whether an edge of one crosses an edge of the other, touching aside."""
    a, c = np.array(one.vertices_mm)[:, None], np.array(other.vertices_mm)[None]
    b, d = np.roll(a, -1, axis=0), np.roll(c, -1, axis=1)

    def side(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        """Return the distance of r to the left of the line from p to q, mm."""
        along = q - p
        cross = along[..., 0] * (r - p)[..., 1] - along[..., 1] * (r - p)[..., 0]
        far = cross / np.linalg.norm(along, axis=-1)
        return np.asarray(np.where(np.abs(far) < INWARD_MM, 0.0, far))

    crossing = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    return bool(crossing.any())
