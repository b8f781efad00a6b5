"""Skins and scenes on surfaces: a model's mesh and the scenes' mesh are two triangulations."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import lifted, mesh_for_elements
from eitskin.scene.cover import Cover, with_touches
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.streams import stream
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.placement import by_points
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin, outline_on
from eitskin.surface.outline import surface_map
from eitskin.surface.shapes import make_shape
from eitskin.surface.surface_map import SurfaceMap
from eitskin_studies.experiments.experiment import SIMULATED_ELEMENTS

MODEL_TRIANGLES, SCENE_TRIANGLES = 4000, 16_000
ELECTRODES = 16
TRIES = 4000
# of the flat skin of 194 mm, scaled to the skin's size
RADIUS_MM, GAP_MM, MARGIN_MM, CONTRAST, WIDTH_MM = (6.0, 12.0), 12.0, 4.0, (3.0, 10.0), 4.0


@dataclass(frozen=True, eq=False)
class SpaceTouch:
    """A touch on a surface: a disc of ``radius_mm`` by distances in space around ``point_mm``
    (3,)."""

    point_mm: FloatArray
    radius_mm: float
    contrast: float


def size_of(surface: SurfaceMap) -> float:
    """The size of the true area relative to that of the flat skin of 194 mm."""
    return float(np.sqrt(surface.area_mm2 / np.pi)) / 97.0


def skin_on(name: str, surface: SurfaceMap) -> Skin:
    """A skin with electrodes evenly along the rim."""
    width = WIDTH_MM * size_of(surface)
    return Skin(name, outline_on(surface), Electrodes(ELECTRODES, width), surface=surface)


def same_on(name: str, surface: SurfaceMap, model_skin: Skin) -> Skin:
    """The skin of ``model_skin`` on another triangulation, electrodes at the same points."""
    assert model_skin.surface is not None
    points = 1e3 * model_skin.surface.at(model_skin.electrode_centres_mm()).point_m
    outline = outline_on(surface)
    start_deg = Electrodes().start_angle_deg
    placed = by_points(outline, surface.rim_places(points)[0], start_deg, False, 1e3)
    electrodes = Electrodes(
        ELECTRODES, model_skin.electrodes.width_mm, positions_mm=placed.positions_mm
    )
    return Skin(name, outline, electrodes, surface=surface)


def flat_map(surface: SurfaceMap) -> SurfaceMap:
    """The flattened copy of ``surface`` as a surface of its own, in the plane z = 0."""
    flat = surface.flat_mm
    return SurfaceMap(flat, np.column_stack([flat, np.zeros(len(flat))]), surface.triangles)


def shape_map(name: str, triangles: int) -> SurfaceMap:
    return surface_map(*make_shape(name, triangles))


def draw_touches(surface: SurfaceMap, seed: int, role: str, count: int) -> list[list[SpaceTouch]]:
    """Scenes of one to three touches, evenly over the surface; gaps and the distance from the rim
    are distances in space."""
    scale = size_of(surface)
    corners = surface.points_mm[surface.triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    scenes = []
    for number in range(count):
        draw = stream(seed, f"touches {role}", number)
        wanted = int(draw.integers(1, 3, endpoint=True))
        touches: list[SpaceTouch] = []
        for _ in range(wanted):
            radius = scale * float(draw.uniform(*RADIUS_MM))
            contrast = float(draw.uniform(*CONTRAST))
            triangle = draw.choice(len(area), TRIES, p=area / area.sum())
            weight = draw.dirichlet(np.ones(3), TRIES)
            points = (weight[:, :, None] * corners[triangle]).sum(axis=1)
            fits = surface.rim_places(points)[1] >= radius + scale * MARGIN_MM
            for other in touches:
                away = np.linalg.norm(points - other.point_mm, axis=1)
                fits &= away >= radius + other.radius_mm + scale * GAP_MM
            if fits.any():
                touches.append(SpaceTouch(points[int(np.argmax(fits))], radius, contrast))
        scenes.append(touches)
    return scenes


def on_copy(surface: SurfaceMap, touches: list[SpaceTouch]) -> tuple[TrueTouch, ...]:
    """Touches as scenes take them: the middle on the flattened copy, the radius true."""
    if not touches:
        return ()
    flat, _ = surface.flat_of(np.array([one.point_mm for one in touches]))
    return tuple(
        TrueTouch(x, y, one.radius_mm, one.contrast)
        for (x, y), one in zip(flat.tolist(), touches, strict=True)
    )


def solved(
    skin: Skin,
    protocol: Protocol,
    contact_ohm_m2: FloatArray,
    scenes: list[tuple[TrueTouch, ...]],
    thinner: SurfaceMap | None = None,
) -> dict[str, FloatArray]:
    """``quiet`` (m,) and ``frames`` (k, m) in V. Where the skin was on the surface ``thinner``
    before it was stretched, its thickness keeps the volume."""
    mesh = mesh_for_elements(skin, SIMULATED_ELEMENTS)
    forward = ForwardModel(mesh, skin, protocol, contact_ohm_m2)
    sheet = np.full(mesh.n_elements, skin.conductivity_s_per_m)
    if thinner is not None:
        sheet = sheet * lifted(mesh, thinner).true_areas_mm2 / mesh.true_areas_mm2
    cover = Cover(mesh)
    frames = [forward.voltages(with_touches(sheet, cover.change(one))) for one in scenes]
    return {"quiet": forward.voltages(sheet), "frames": np.array(frames)}
