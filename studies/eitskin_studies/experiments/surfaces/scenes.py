"""Skins and scenes on surfaces: a model's mesh and the scenes' mesh are two triangulations."""

from collections.abc import Sequence
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
from eitskin_studies.benchmarks.limit_bound import bounds_of, touch_slopes_v
from eitskin_studies.experiments.experiment import SIMULATED_ELEMENTS

MODEL_TRIANGLES, SCENE_TRIANGLES = 4000, 16_000
ELECTRODES = 16
TRIES = 4000
# x and y in mm of the flat skin of 194 mm, log radius and amplitude
BOUND_STEPS = (0.6, 0.6, 0.067, 0.02)
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


class SolvedSurface:
    """The voltages of a skin on a surface, by finite elements on one mesh."""

    def __init__(self, skin: Skin, protocol: Protocol, contact_ohm_m2: FloatArray) -> None:
        mesh = mesh_for_elements(skin, SIMULATED_ELEMENTS)
        self.mesh = mesh
        self._forward = ForwardModel(mesh, skin, protocol, contact_ohm_m2)
        self._sheet = np.full(mesh.n_elements, skin.conductivity_s_per_m)
        self._cover = Cover(mesh)

    def thinned(self, before: SurfaceMap) -> None:
        """The skin was on the surface ``before`` when it was made; its thickness keeps the
        volume."""
        self._sheet *= lifted(self.mesh, before).true_areas_mm2 / self.mesh.true_areas_mm2

    def voltages(self, touches: Sequence[TrueTouch]) -> FloatArray:
        """Return the voltages (m,) in V with ``touches``."""
        if not touches:
            return self._forward.voltages(self._sheet)
        return self._forward.voltages(with_touches(self._sheet, self._cover.change(touches)))


def solved(
    skin: Skin,
    protocol: Protocol,
    contact_ohm_m2: FloatArray,
    scenes: list[tuple[TrueTouch, ...]],
    thinner: SurfaceMap | None = None,
) -> dict[str, FloatArray]:
    """``quiet`` (m,) and ``frames`` (k, m) in V. Where the skin was on the surface ``thinner``
    before it was stretched, its thickness keeps the volume."""
    model = SolvedSurface(skin, protocol, contact_ohm_m2)
    if thinner is not None:
        model.thinned(thinner)
    frames = [model.voltages(one) for one in scenes]
    return {"quiet": model.voltages(()), "frames": np.array(frames)}


def slopes_v(
    model: SolvedSurface, surface: SurfaceMap, scenes: list[tuple[TrueTouch, ...]]
) -> list[FloatArray]:
    """The slopes (p, m) of the voltages of each scene by the parameters of its touches: differences
    over BOUND_STEPS, which are so wide that the mesh does not matter."""
    size, (x_mm, y_mm, *others) = size_of(surface), BOUND_STEPS
    steps = (size * x_mm, size * y_mm, *others)
    return [touch_slopes_v(model, scene, steps) for scene in scenes]


def bounds_mm(
    slopes: Sequence[FloatArray],
    surface: SurfaceMap,
    scenes: list[tuple[TrueTouch, ...]],
    sigma_v: float,
) -> list[float]:
    """The median error in mm on ``surface`` of each touch of ``scenes``, whose slopes are
    ``slopes_v``, that the Cramer-Rao bound allows for one frame with noise ``sigma_v``
    (``benchmarks.limit_bound``; contacts count as known)."""
    found = []
    for scene, own in zip(scenes, slopes, strict=True):
        scales = surface.at([[one.x_mm, one.y_mm] for one in scene]).scale
        found += [
            scale * one.median_mm
            for scale, one in zip(scales.tolist(), bounds_of(own / sigma_v, scene), strict=True)
        ]
    return found
