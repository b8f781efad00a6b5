"""A skin on a surface whose surface changes its shape after the tare, as over a muscle.

The pose is another mesh file of the same triangles as the skin's own; each vertex is the same place
of the skin, and moves along a straight line. The skin keeps its volume where it stretches, so it
gets thinner there; the resistivity of a gel stays (Keplinger et al., Science 341, 2013). Electrodes
go along and keep their widths. Touches stay on the material, with their true radius in the pose. To
tare in the pose, let it begin before the untouched frames (``at_s`` of -1000).
"""

from dataclasses import MISSING, dataclass, replace
from pathlib import Path

from eitskin.arrays import FloatArray
from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.deformation import FLAT, Deformation, FlexedSurface
from eitskin.scene.effect import DeformationStep, EffectCost, EffectSession, Stage, part_at
from eitskin.surface.mesh_file import UNITS_MM, read_surface
from eitskin.surface.surface_map import SurfaceMap

NAME = "flex"
STAGE = Stage.MATERIAL
ORDER = 5
SUMMARY = "The surface under the skin changes its shape, electrodes with it."


@dataclass(frozen=True)
class Parameters:
    """The surface in its pose, and the time of the change."""

    surface: str = parameter(
        MISSING, "", "mesh file of the pose, beside the scene, with the triangles of the skin's own"
    )
    surface_unit: str = parameter("mm", "", "unit of its numbers", choices=tuple(UNITS_MM))
    at_s: float = parameter(0.0, "s", "time at which it begins")
    rise_s: float = parameter(0.0, "s", "time until it is complete; 0: at once", low=0)


def make(parameters: Parameters, session: EffectSession) -> DeformationStep:
    """Return the step in which the vertices move linearly; frames with equal places share a
    solve."""
    rest = session.skin.surface
    if rest is None:
        raise ConfigError(
            f"surface: the skin {session.skin.name!r} is flat; use bend or stretch, or a skin that"
            " covers a surface"
        )
    posed_mm = posed_points_mm(rest, session.folder / parameters.surface, parameters.surface_unit)
    kept: dict[float, Deformation] = {0.0: FLAT}

    def apply(time_s: float, frame: int) -> Deformation:
        part = part_at(time_s, parameters.at_s, parameters.rise_s)
        if part not in kept:
            points_mm = (1 - part) * rest.points_mm + part * posed_mm
            kept[part] = FlexedSurface(replace(rest, points_mm=points_mm))
        return kept[part]

    states = {part_at(float(t), parameters.at_s, parameters.rise_s) for t in session.times_s()}
    note = f"to the surface in {parameters.surface} from {parameters.at_s:g} s on"
    cost = EffectCost(factorisations=len(states))
    return DeformationStep(NAME, cost, note, apply, of_surfaces=True)


def posed_points_mm(rest: SurfaceMap, path: Path, unit: str) -> FloatArray:
    """Return the points (N, 3) in the mesh file ``path`` of the vertices of ``rest``.

    Raises:
        ConfigError: its triangles are not those of ``rest``.
        FileError, GeometryError, MissingExtraError: as ``read_surface``.
    """
    posed = read_surface(path, unit)
    points = rest.points_mm.copy()
    same = not rest.simplified_from and len(posed.triangles) == len(rest.triangles)
    if same:
        # vertices are numbered by their places, so corners of the same triangle belong together
        points[rest.triangles] = posed.points_mm[posed.triangles]
        number = points[rest.triangles] == posed.points_mm[posed.triangles]
        same = bool(number.all()) and len(posed.points_mm) == len(rest.points_mm)
    if not same:
        raise ConfigError(
            f"surface: {path} does not have the triangles of the skin's surface; export both poses"
            " of one mesh, with at most 20000 triangles"
        )
    return points
