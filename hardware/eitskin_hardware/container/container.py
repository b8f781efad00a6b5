"""The container's measures from a skin, and its parts by OpenSCAD."""

import re
import subprocess
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import EitskinError
from eitskin.skin.skin import Skin

PARTS = ("dish", "jig", "post")
TIMEOUT_S = 600
RIM_POINTS = 180  # of a round outline


class ContainerError(EitskinError):
    """OpenSCAD is missing or did not make the part, or the skin is too thick for its posts."""


@dataclass(frozen=True, eq=False)
class Container:
    """A container: ``outline_mm`` (n, 2) is its inside, which is the skin's outline; ``holes_mm``
    (electrodes, 3) has a point of the inside and the direction out of it, in degrees."""

    name: str
    outline_mm: FloatArray
    holes_mm: FloatArray
    gel_mm: float
    wall_mm: float = 4.0
    floor_mm: float = 4.0
    rim_mm: float = 8.0  # above the gel
    hole_mm: float = 4.0
    washer_mm: float = 9.0
    nut_mm: float = 8.1  # across corners, M4
    post_mm: float = 30.0
    jig_mm: float = 6.0
    clearance_mm: float = 0.3

    @property
    def height_mm(self) -> float:
        """The height of the wall, floor included."""
        return self.floor_mm + self.gel_mm + self.rim_mm

    @property
    def hole_height_mm(self) -> float:
        """The height of the holes' centres: the middle of the gel."""
        return self.floor_mm + self.gel_mm / 2

    def parameters(self) -> str:
        """Return the measures as OpenSCAD reads them."""
        numbers = {
            "gel_mm": self.gel_mm,
            "wall_mm": self.wall_mm,
            "floor_mm": self.floor_mm,
            "height_mm": self.height_mm,
            "hole_height_mm": self.hole_height_mm,
            "hole_mm": self.hole_mm,
            "washer_mm": self.washer_mm,
            "nut_mm": self.nut_mm,
            "post_mm": self.post_mm,
            "post_inside_mm": self.post_mm - self.wall_mm - 12.0,
            "jig_mm": self.jig_mm,
            "clearance_mm": self.clearance_mm,
        }
        lines = [
            f"// The container of the skin {self.name!r}; written by eitskin hardware container."
        ]
        lines += [f"{key} = {value:g};" for key, value in numbers.items()]
        lines.append(f"outline_mm = {_points(self.outline_mm)};")
        lines.append(f"holes_mm = {_points(self.holes_mm)};")
        return "\n".join(lines) + "\n"


def _points(rows: FloatArray) -> str:
    cells = ", ".join("[" + ", ".join(f"{value:.3f}" for value in row) + "]" for row in rows)
    return f"[{cells}]"


def container_of(skin: Skin) -> Container:
    """Return the container of a skin: one hole at the middle of each electrode.

    Raises:
        ContainerError: the gel is too thin for holes of 4 mm, or electrodes are too close for
            washers.
    """
    outline, perimeter = skin.outline, skin.outline.perimeter_mm
    along = skin.electrode_spans_mm().mean(axis=1) % perimeter
    centres = outline.points_at(along)
    ahead, behind = (outline.points_at((along + d) % perimeter) for d in (0.5, -0.5))
    tangent = ahead - behind
    outward = np.degrees(np.arctan2(-tangent[:, 0], tangent[:, 1]))
    rim = (
        outline.points_at(np.arange(RIM_POINTS) * perimeter / RIM_POINTS)
        if outline.diameter_mm
        else np.asarray(outline.vertices_mm)
    )
    made = Container(skin.name, rim, np.column_stack([centres, outward]), skin.thickness_mm)
    if made.gel_mm < made.hole_mm + 2:
        raise ContainerError(
            f"skin {skin.name!r}: {made.gel_mm:g} mm of gel hold no posts of {made.hole_mm:g} mm;"
            f" at least {made.hole_mm + 2:g} mm are needed, or clamp tape to the rim of a foil"
        )
    gaps = np.linalg.norm(centres - np.roll(centres, 1, axis=0), axis=1)
    if gaps.min() < made.washer_mm + 1:
        raise ContainerError(
            f"skin {skin.name!r}: neighbouring posts are {gaps.min():.1f} mm apart, their washers"
            f" need {made.washer_mm + 1:g} mm; use fewer electrodes or a larger skin"
        )
    return made


def scad() -> str:
    """Return the container's OpenSCAD source."""
    return (
        files("eitskin_hardware.container").joinpath("container.scad").read_text(encoding="utf-8")
    )


def write_scad(container: Container, folder: Path) -> None:
    """Write container.scad and its parameters into ``folder``."""
    (folder / "container.scad").write_text(scad(), encoding="utf-8")
    (folder / "parameters.scad").write_text(container.parameters(), encoding="utf-8")


def make_stl(folder: Path, part: str) -> Path:
    """Return the STL file of a part, made by OpenSCAD from what ``write_scad`` wrote.

    Raises:
        ContainerError: OpenSCAD is missing, fails or does not end.
    """
    made = folder / f"{part}.stl"
    command = ["openscad", "-o", str(made), "-D", f'part="{part}"', "container.scad"]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
    except FileNotFoundError as error:
        raise ContainerError("openscad is not installed: sudo apt-get install openscad") from error
    except subprocess.TimeoutExpired as error:
        raise ContainerError(f"openscad did not end within {TIMEOUT_S} s") from error
    if done.returncode != 0 or not made.exists():
        raise ContainerError(f"openscad: {done.stderr.strip().splitlines()[-1:]}")
    return made


def triangles(stl: Path) -> FloatArray:
    """Return the triangles (n, 3, 3) of an ASCII STL file."""
    numbers = re.findall(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)", stl.read_text(encoding="utf-8"))
    return np.array(numbers, dtype=np.float64).reshape(-1, 3, 3)


def volume_mm3(faces: FloatArray) -> float:
    """Return the volume that closed triangles bound."""
    return float(np.einsum("ij,ij->", faces[:, 0], np.cross(faces[:, 1], faces[:, 2])) / 6)


def is_closed(faces: FloatArray) -> bool:
    """Return whether each edge belongs to exactly two triangles, once in each direction."""
    corner = np.round(faces, 4)
    edges: dict[tuple[bytes, bytes], int] = {}
    for face in corner + 0.0:
        for k in range(3):
            edge = (face[k].tobytes(), face[(k + 1) % 3].tobytes())
            edges[edge] = edges.get(edge, 0) + 1
    return all(count == edges.get(edge[::-1], 0) for edge, count in edges.items())
