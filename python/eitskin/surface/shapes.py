"""Surfaces made by formulas, for examples and studies: each is a disk in the sense of topology."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin.fileio import write_bytes

Place = Callable[..., FloatArray]


@dataclass(frozen=True)
class Shape:
    """A surface by formula: ``place`` takes u and v (k,) from -1 to 1, and ``measures`` by their
    names, to points (k, 3) in mm. ``round`` shapes use the disk u^2 + v^2 <= 1, the others the
    whole square. ``measures`` holds the default values of those that a caller may choose, which
    must lie within ``MEASURES``."""

    place: Place
    round: bool
    what: str
    measures: Mapping[str, float] = field(default_factory=dict)


MEASURES = {"radius_mm": (1.0, 2000.0), "length_mm": (1.0, 5000.0), "angle_deg": (10.0, 350.0)}


def _tube(
    u: FloatArray, v: FloatArray, radius_mm: float, length_mm: float, angle_deg: float
) -> FloatArray:
    turn = u * np.radians(angle_deg / 2)
    return np.column_stack([radius_mm * np.cos(turn), radius_mm * np.sin(turn), v * length_mm / 2])


def _dome(u: FloatArray, v: FloatArray, radius_mm: float, angle_deg: float) -> FloatArray:
    polar, turn = np.hypot(u, v) * np.radians(angle_deg / 2), np.arctan2(v, u)
    return radius_mm * np.column_stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
    )


def _cylinder(u: FloatArray, v: FloatArray) -> FloatArray:
    angle, radius = 97.0 * u / 60.0, 60.0
    return np.column_stack([radius * np.sin(angle), 97.0 * v, radius * np.cos(angle)])


def _cone(u: FloatArray, v: FloatArray) -> FloatArray:
    """The disk of 194 mm, whose middle is 220 mm from the tip, on a cone with a half angle of 20
    degrees."""
    half = np.radians(20.0)
    along, angle = np.hypot(220.0 + 97.0 * v, 97.0 * u), np.arctan2(97.0 * u, 220.0 + 97.0 * v)
    turn, radius = angle / np.sin(half), along * np.sin(half)
    return np.column_stack([radius * np.sin(turn), along * np.cos(half), radius * np.cos(turn)])


def _saddle(u: FloatArray, v: FloatArray) -> FloatArray:
    x, y = 80.0 * u, 80.0 * v
    return np.column_stack([x, y, (x**2 - y**2) / 160.0])


def _fingertip(u: FloatArray, v: FloatArray) -> FloatArray:
    """The pad of a finger: half of a tube of radius 9 mm, 16 mm long, closed by a quarter of a
    ball."""
    angle, along = u * np.pi / 2, (v + 1) / 2 * (16.0 + 9.0 * np.pi / 2)
    polar = np.maximum(along - 16.0, 0.0) / 9.0
    # the last line of the tube is the point of the ball, so the square's edge v = 1 shrinks; the
    # pad ends 15 degrees before it
    polar = polar * (75.0 / 90.0)
    radius = 9.0 * np.cos(polar)
    return np.column_stack(
        [
            radius * np.sin(angle),
            np.minimum(along, 16.0) + 9.0 * np.sin(polar),
            radius * np.cos(angle),
        ]
    )


def _forearm(u: FloatArray, v: FloatArray, bulge_mm: float = 6.0) -> FloatArray:
    """A sleeve around a forearm, open along the elbow's side: a tube 200 mm long that narrows from
    48 to 30 mm, flatter at the wrist, with a muscle that bulges in the upper half."""
    angle, along = u * np.radians(140.0), (v + 1) / 2
    wide = 48.0 - 18.0 * along
    flat = 1.0 - 0.25 * along
    muscle = bulge_mm * np.exp(-(((along - 0.3) / 0.22) ** 2) - (angle / 0.9) ** 2)
    return np.column_stack(
        [
            (wide + muscle) * np.sin(angle),
            200.0 * along,
            (wide * flat + muscle) * np.cos(angle),
        ]
    )


def flexed_forearm(triangles: int, bulge_mm: float) -> tuple[FloatArray, IntArray]:
    """Return the points and triangles of the forearm whose muscle bulges by ``bulge_mm``, 6 at
    rest; the same vertex is the same place of the skin."""
    flat, faces = square_net(triangles)
    return _forearm(flat[:, 0], flat[:, 1], bulge_mm), faces


SHAPES = {
    "cylinder": Shape(_cylinder, True, "a disk of 194 mm around a cylinder of radius 60 mm"),
    "cone": Shape(_cone, True, "a disk of 194 mm on a cone with a half angle of 20 degrees"),
    "hemisphere": Shape(
        partial(_dome, radius_mm=60.0, angle_deg=180.0), True, "half a ball of radius 60 mm"
    ),
    "saddle": Shape(_saddle, True, "a saddle, 160 mm across"),
    "fingertip": Shape(_fingertip, False, "the pad of a finger, 28 by 28 mm"),
    "forearm": Shape(_forearm, False, "a sleeve around a forearm, 200 mm long"),
    "flexed_forearm": Shape(
        partial(_forearm, bulge_mm=12.0), False, "the same forearm with a muscle that bulges"
    ),
    "tube": Shape(
        _tube,
        False,
        "the side of a cylinder around the axis z, open towards -x",
        {"radius_mm": 40.0, "length_mm": 200.0, "angle_deg": 300.0},
    ),
    "dome": Shape(
        _dome, True, "the cap of a ball around the axis z", {"radius_mm": 40.0, "angle_deg": 180.0}
    ),
}


def make_shape(name: str, triangles: int = 4000, **measures: float) -> tuple[FloatArray, IntArray]:
    """Return the points (N, 3) in mm and the triangles (T, 3) of the surface ``name``, about
    ``triangles`` of them, counterclockwise seen from outside. ``measures`` replace the shape's.

    Raises:
        UsageError: no shape has this name, or it has no such measure; a number is out of range.
    """
    if name not in SHAPES:
        raise UsageError(f"surface {name!r}: {nearest(name, list(SHAPES))}")
    if not 50 <= triangles <= 2_000_000:
        raise UsageError(f"surface: {triangles} triangles is out of range; use 50 to 2000000")
    shape = SHAPES[name]
    for measure, value in measures.items():
        if measure not in shape.measures:
            own = ", ".join(shape.measures) or "none"
            raise UsageError(f"surface {name!r} has no {measure}; measures of it: {own}")
        low, high = MEASURES[measure]
        if not low <= value <= high:
            raise UsageError(
                f"surface: {measure} {value:g} is out of range; use {low:g} to {high:g}"
            )
    flat, faces = disk_net(triangles) if shape.round else square_net(triangles)
    return shape.place(*flat.T, **{**shape.measures, **measures}), faces


def disk_net(triangles: int) -> tuple[FloatArray, IntArray]:
    """Return places (N, 2) in the disk of radius 1 and triangles (T, 3), about as many as asked:
    rings of 6, 12, 18... places around the middle."""
    rings = max(2, round(np.sqrt(triangles / 6)))
    places, faces = [np.zeros((1, 2))], []
    for ring in range(1, rings + 1):
        turn = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        places.append(ring / rings * np.column_stack([np.cos(turn), np.sin(turn)]))
        inner, outer = 3 * (ring - 1) * (ring - 2) + 1, 3 * ring * (ring - 1) + 1
        for side in range(6):
            for k in range(ring):
                a = outer + side * ring + k
                b = outer + (side * ring + k + 1) % (6 * ring)
                c = inner + (side * (ring - 1) + k) % max(6 * (ring - 1), 1) if ring > 1 else 0
                faces.append((a, b, c))
                if k < ring - 1:
                    d = inner + (side * (ring - 1) + k + 1) % (6 * (ring - 1))
                    faces.append((b, d, c))
    return np.concatenate(places), np.array(faces, dtype=np.int64)


def square_net(triangles: int) -> tuple[FloatArray, IntArray]:
    """Return places (N, 2) in the square from -1 to 1 and triangles (T, 3), about as many as
    asked; the diagonals alternate."""
    cells = max(3, round(np.sqrt(triangles / 2)))
    line = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(line, line)
    row, column = np.divmod(np.arange(cells * cells), cells)
    a = row * (cells + 1) + column
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    even = ((row + column) % 2 == 0)[:, None]
    first = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    return np.column_stack([x.ravel(), y.ravel()]), np.concatenate([first, second]).astype(np.int64)


def write_obj(path: str | Path, points_mm: FloatArray, triangles: IntArray) -> None:
    """Write a surface as an OBJ file, in mm.

    Raises:
        FileError: the file cannot be written.
    """
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points_mm.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    write_bytes(path, ("\n".join(lines) + "\n").encode())
