"""A surface as a skin's description names it, and the electrodes along its rim."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import ConfigError, FileError, GeometryError
from eitskin.kinematics.link_mesh import LinkMesh, link_mesh
from eitskin.surface.surface_map import SurfaceMap


@dataclass(frozen=True, eq=False)
class CoveredSurface:
    """The ``map`` of the surface that a skin covers, and the vertices of its mesh file,
    ``file_points_mm`` (F, 3), by which electrodes may be named."""

    map: SurfaceMap
    file_points_mm: FloatArray

    def vertices_mm(self, numbers: Sequence[float], where: str) -> list[list[float]]:
        """Return the points of vertices by their ``numbers`` in the file, from 0; ``where`` names
        the table with the numbers in errors.

        Raises:
            ConfigError: the file has no such vertex.
        """
        count = len(self.file_points_mm)
        for number in numbers:
            if number != int(number) or not 0 <= number < count:
                raise ConfigError(
                    f"{where}: vertex {number:g} is not one of the mesh file's 0 to {count - 1}"
                )
        points: list[list[float]] = self.file_points_mm[[int(n) for n in numbers]].tolist()
        return points

    def on_rim(self, points_mm: Sequence[Sequence[float]], snap_mm: float) -> FloatArray:
        """Return the places (k, 2) of the flattened copy's rim that are nearest to points near the
        surface's rim.

        Raises:
            GeometryError: a point is more than ``snap_mm`` from the rim.
        """
        points = np.asarray(points_mm, dtype=np.float64)
        flat, away = self.map.rim_places(points)
        worst = int(np.argmax(away))
        if not away[worst] <= snap_mm:
            x, y, z = points[worst]
            raise GeometryError(
                f"electrodes: electrode {worst} (from 0) at ({x:.4g}, {y:.4g}, {z:.4g}) mm is"
                f" {away[worst]:.3g} mm from the surface's rim; move it within snap_mm ="
                f" {snap_mm:g} mm of it"
            )
        return flat


def covered_surface(path: Path, unit: str, link: str) -> CoveredSurface:
    """Read the surface in the mesh file ``path`` and flatten it.

    Raises:
        FileError, GeometryError, MissingExtraError: as ``read_surface`` and ``surface_map``.
    """
    return _covered(path, unit, link, str(path))


def covered_link(urdf: Path, name: str) -> CoveredSurface:
    """Read the surface that is the mesh of a link, in the link's frame, and flatten it; ``name`` is
    as of ``link_mesh``.

    Raises:
        FileError, ConfigError, GeometryError, MissingExtraError: as ``link_mesh``,
            ``read_surface`` and ``surface_map``.
    """
    mesh = link_mesh(urdf, name)
    try:
        return _covered(mesh, "m", mesh.link, str(mesh.file))
    except (FileError, GeometryError) as error:
        raise type(error)(f"{urdf}: link {mesh.link!r}: {error}") from None


def _covered(source: Path | LinkMesh, unit: str, link: str, where: str) -> CoveredSurface:
    from eitskin.surface.mesh_file import read_surface
    from eitskin.surface.outline import surface_map

    read = read_surface(source, unit)
    try:
        surface = surface_map(read.points_mm, read.triangles, link, read.simplified_from)
    except GeometryError as error:
        raise GeometryError(f"{where}: {error}") from None
    return CoveredSurface(surface, read.file_points_mm)
