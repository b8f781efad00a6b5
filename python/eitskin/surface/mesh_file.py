"""Read a surface from a mesh file: OBJ, PLY or STL."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FileError, GeometryError, missing_extra
from eitskin.kinematics.link_mesh import LinkMesh
from eitskin.surface.topology import check_disk, rim_loop

SUFFIXES = (".obj", ".ply", ".stl")
MAX_TRIANGLES = 20_000
MAX_FILE_TRIANGLES = 5_000_000
MIN_TRIANGLES = 20
MIN_MM, MAX_MM = 5.0, 5000.0
MERGE = 1e-6  # vertices closer than this part of the surface's size are one
UNITS_MM = {"mm": 1.0, "m": 1000.0}
# The remedy for a surface that has a skin's size if its numbers are multiplied by the key.
UNIT_HINTS = {
    "mm": {1e3: 'its numbers seem to be in m: write surface_unit = "m"'},
    "m": {1e-3: 'its numbers seem to be in mm: write surface_unit = "mm"'},
}
URDF_HINTS = {
    1e-3: 'its numbers seem to be in mm: write scale="0.001 0.001 0.001" in the URDF\'s <mesh>',
    1e3: "its numbers seem to be in m already: leave the scale of the URDF's <mesh> out",
}


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """A surface as read: ``points_mm`` (N, 3), ``triangles`` (T, 3), the file's own vertices
    ``file_points_mm`` (F, 3), and ``simplified_from``, the number of triangles of the file if the
    surface has fewer, else 0."""

    points_mm: FloatArray
    triangles: IntArray
    file_points_mm: FloatArray
    simplified_from: int = 0


def read_surface(source: Path | LinkMesh, unit: str = "mm") -> SurfaceMesh:
    """Read a mesh file, whose numbers are in ``unit``, "mm" or "m", or the mesh of a URDF's link,
    into the link's frame. Vertices at the same place become one. A mesh of more than MAX_TRIANGLES
    is simplified.

    Raises:
        FileError: the file cannot be read.
        GeometryError: it is not a disk, or its size is not that of a skin.
        MissingExtraError: trimesh is not installed.
    """
    path = source.file if isinstance(source, LinkMesh) else source
    where = str(path)
    points, triangles = _loaded(path)
    if isinstance(source, LinkMesh):
        points, triangles = 1e3 * source.points_m(points), source.outward(triangles)
        hints = URDF_HINTS
    else:
        points, hints = points * UNITS_MM[unit], UNIT_HINTS[unit]
    _check_numbers(points, triangles, where)
    _check_size(points, hints, where)
    merged, joined = merge_vertices(points, triangles)
    count = len(joined)
    if count > MAX_TRIANGLES:
        _, joined = without_slivers(merged, joined)
        merged, joined = _simplified(merged, joined)
        merged, joined = merge_vertices(merged, joined)
    check_disk(merged, joined, where)
    return SurfaceMesh(merged, joined, points, count if count > len(joined) else 0)


def merge_vertices(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the surface with one vertex at each place, and none of no triangle. STL files and OBJ
    files with seams repeat vertices."""
    step = MERGE * float(np.ptp(points, axis=0).max())
    _, first, number = np.unique(
        np.round(points / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    corners = number.ravel()[triangles]
    used, corners = np.unique(corners, return_inverse=True)
    return points[first[used]], corners.reshape(triangles.shape)


def without_slivers(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the surface without triangles that name a vertex twice."""
    a, b, c = triangles.T
    return points, triangles[(a != b) & (b != c) & (c != a)]


def _loaded(path: Path) -> tuple[FloatArray, IntArray]:
    if path.suffix.lower() not in SUFFIXES:
        raise FileError(f"{path}: a surface is a file of type {', '.join(SUFFIXES)}; convert it")
    if not path.is_file():
        raise FileError(f"{path}: there is no such mesh file; check its name and folder")
    try:
        import trimesh
    except ModuleNotFoundError as error:
        raise missing_extra("surface", "trimesh") from error
    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False, maintain_order=True)
        points = np.asarray(mesh.vertices, dtype=np.float64)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # trimesh raises whatever its parsers meet
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise FileError(f"{path}: cannot be read as a mesh ({why}); export it again") from None
    if points.ndim != 2 or triangles.ndim != 2 or not len(triangles):
        raise FileError(f"{path}: holds no whole triangles; export the surface as triangles again")
    return points, triangles


def _check_numbers(points: FloatArray, triangles: IntArray, where: str) -> None:
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise GeometryError(f"{where}: vertex {bad} (from 0) is not finite; repair the file")
    if not MIN_TRIANGLES <= len(triangles) <= MAX_FILE_TRIANGLES:
        raise GeometryError(
            f"{where}: {len(triangles)} triangles is out of range; a surface has {MIN_TRIANGLES} to"
            f" {MAX_FILE_TRIANGLES}"
        )


def _check_size(points_mm: FloatArray, hints: Mapping[float, str], where: str) -> None:
    size = np.ptp(points_mm, axis=0)
    if MIN_MM <= size.max() <= MAX_MM:
        return
    likely = [text for factor, text in hints.items() if MIN_MM <= factor * size.max() <= MAX_MM]
    hint = likely[0] if likely else f"a skin is {MIN_MM:g} to {MAX_MM:g} mm long, so scale the mesh"
    raise GeometryError(
        f"{where}: the surface is {size[0]:.3g} x {size[1]:.3g} x {size[2]:.3g} mm; {hint}"
    )


def _simplified(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the surface with about MAX_TRIANGLES triangles, by the least change of its shape
    (quadric error metrics). The rim's vertices are tied to it."""
    try:
        import fast_simplification
    except ModuleNotFoundError as error:
        raise missing_extra("surface", "fast-simplification") from error
    reduced: Any = fast_simplification.simplify(
        points, triangles.astype(np.int32), target_count=MAX_TRIANGLES
    )
    return np.asarray(reduced[0], dtype=np.float64), np.asarray(reduced[1], dtype=np.int64)


def rim_points_mm(mesh: SurfaceMesh) -> FloatArray:
    """Return the rim's vertices in order, (B, 3)."""
    return np.asarray(mesh.points_mm[rim_loop(mesh.triangles)])
