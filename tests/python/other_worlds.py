"""Scenes that the model does not share: fingers, uneven skins, misplaced electrodes, drift. Each
has a skin of its own, 64 untouched frames and one touched frame.

Simulated on another mesh than the model's; misplaced electrodes and outlines out of round move its
nodes. Each part of a scene is drawn from a stream of its own. The sets of ``eitskin study
other-worlds`` are drawn alike; these stay as they are, since tests have bounds for them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eitskin.fem.cem import ForwardModel
from eitskin.fem.deform import MeshDeformation
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.scene.cover import Cover, with_touches
from eitskin.scene.random_field import random_field
from eitskin.scene.random_touches import TouchScene, TrueTouch, rim_distance_mm
from eitskin.scene.simulate import Measurement, measure
from eitskin.scene.streams import stream
from eitskin.scene.touch_shape import named_shape
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin

Draws = Callable[[str], np.random.Generator]
Range = tuple[float, float]
RIM_MARGIN_MM, GAP_MM = 4.0, 12.0
CONTACT_SPREAD = 0.2
CORRELATION = (0.35, 1.0)  # of a smooth field, over the skin's radius


@dataclass(frozen=True)
class World:
    """A set: its touches (each range is drawn from uniformly), what is wrong with the skin
    (standard deviations, relative but for mm), and the noise (``snr_db`` None: none; ``adc_bits``
    0: no converter).

    ``spacing_radii``: least distance between two middles over the mean of their radii; None: edges
    12 mm apart. ``pair_mm``: two touches side by side, their middles so far apart. ``drift``,
    ``contact_drift`` and ``amplitude_drift`` come after the tare.
    """

    count: tuple[int, int] = (1, 3)
    radius_mm: Range = (6.0, 12.0)
    contrast: Range = (3.0, 10.0)
    aspect: Range = (1.0, 1.0)
    shape: str | None = None
    spacing_radii: float | None = None
    pair_mm: Range | None = None
    contact_log_sd: float = 0.0
    misplaced_mm: float = 0.0
    out_of_round: float = 0.0
    uneven: float = 0.0
    drift: float = 0.0
    contact_drift: float = 0.0
    amplitude_drift: float = 0.0
    snr_db: float | None = 60.0
    adc_bits: int = 12


EIGHT = {"count": (8, 8), "radius_mm": (9.0, 9.0), "contrast": (5.0, 5.0), "spacing_radii": 4.0}
LOW_NOISE = {"snr_db": 80.0, "adc_bits": 16}
MILD = {
    "contact_log_sd": 0.3, "misplaced_mm": 0.5, "uneven": 0.05, "drift": 0.003,
    "contact_drift": 0.03, "amplitude_drift": 0.003,
}  # fmt: skip
FINGERS = {"aspect": (1.4, 2.2), "shape": "finger"}
NONE = (0, 0)
WORLDS = {
    "discs_1_to_3": World(),
    "ellipses": World(aspect=(1.4, 2.2), shape="ellipse"),
    "fingers": World(**FINGERS),
    "two_fingers_12_to_16_mm": World((2, 2), (5.0, 8.0), pair_mm=(12.0, 16.0), **FINGERS),
    "eight_at_4_radii": World(**EIGHT, **LOW_NOISE),
    "eight_mild_errors": World(**EIGHT, **LOW_NOISE, **MILD),
    "crowd_on_an_uneven_skin": World(
        (9, 12), (5.0, 9.0), spacing_radii=2.5, uneven=0.1, drift=0.01
    ),
    "uneven_20_percent": World(uneven=0.2),
    "misplaced_3_mm": World(misplaced_mm=3.0),
    "out_of_round_2_percent": World(out_of_round=0.02),
    "drift_2_percent_light": World(contrast=(1.3, 2.0), drift=0.02),
    "drift_2_percent_strong": World(drift=0.02),
    "no_touch_drift_2_percent": World(NONE, drift=0.02),
    "no_touch_uneven_20_percent": World(NONE, uneven=0.2),
    "no_touch_noiseless": World(NONE, drift=1e-6, snr_db=None, adc_bits=0),
    "no_touch_converter_without_dither": World(NONE, drift=1e-4, snr_db=None),
}


@dataclass(frozen=True, eq=False)
class WorldScenes:
    """Scene k has ``untouched_v[k]`` (q, m) for its tare and ``frames_v[k]`` (m,), in V."""

    scenes: tuple[TouchScene, ...]
    untouched_v: np.ndarray
    frames_v: np.ndarray


@dataclass(eq=False)
class WorldFactory:
    """Simulates sets on one skin."""

    skin: Skin
    protocol: Protocol
    elements: int = 11_000

    @cached_property
    def mesh(self) -> Mesh:
        return mesh_for_elements(self.skin, self.elements)

    @cached_property
    def _forward(self) -> ForwardModel:
        return ForwardModel(self.mesh, self.skin, self.protocol)

    @cached_property
    def _deformation(self) -> MeshDeformation:
        return MeshDeformation(self.mesh)

    @cached_property
    def _radius_mm(self) -> float:
        return math.sqrt(self.skin.outline.area_mm2 / math.pi)

    def scenes(self, name: str, count: int, seed: int) -> WorldScenes:
        """``count`` scenes of the set ``name``."""
        world, role = WORLDS[name], f"worlds tuning {name}"
        drawn, untouched_v, frames_v = [], [], []
        for k in range(count):
            touches = draw_touches(self.skin, world, stream(seed, f"{role} touches", k))

            def draw(part: str, k: int = k) -> np.random.Generator:
                return stream(seed, f"{role} {part}", k)

            exact_v = self._solve(world, touches, draw)
            noisy_v = _measured(exact_v, world, seed, f"{role} {k}")
            drawn.append(TouchScene(f"{name} {k}", touches))
            untouched_v.append(noisy_v[:-1])
            frames_v.append(noisy_v[-1])
        return WorldScenes(tuple(drawn), np.array(untouched_v), np.array(frames_v))

    def _solve(self, world: World, touches: tuple[TrueTouch, ...], draw: Draws) -> np.ndarray:
        """The untouched and the touched frame (2, m) of one skin."""
        forward = self._forward_with(world, draw)
        middles, electrodes = forward.mesh.centroids_mm(), self.skin.electrodes
        contact = np.full(electrodes.count, electrodes.contact_impedance_ohm_m2)
        if world.contact_log_sd:
            contact *= np.exp(world.contact_log_sd * draw("contact").standard_normal(len(contact)))
        else:
            contact *= 1 + CONTACT_SPREAD * draw("contact").uniform(-1, 1, len(contact))
        sheet = np.full(len(middles), self.skin.conductivity_s_per_m)
        if world.uneven:
            sheet *= np.exp(world.uneven * self._field(middles, draw("uneven")))
        untouched = forward.voltages(sheet, contact)
        drifted, amplitude = sheet.copy(), 1.0
        if world.drift:
            drifted *= np.exp(world.drift * self._field(middles, draw("drift")))
        if world.contact_drift:
            change = world.contact_drift * draw("contact drift").standard_normal(len(contact))
            contact = contact * np.exp(change)
        if world.amplitude_drift:
            amplitude += world.amplitude_drift * float(draw("amplitude drift").standard_normal())
        changed = with_touches(drifted, Cover(forward.mesh).change(touches))
        return np.array([untouched, amplitude * forward.voltages(changed, contact)])

    def _field(self, at_mm: np.ndarray, draw: np.random.Generator) -> np.ndarray:
        return random_field(at_mm, self._radius_mm * float(draw.uniform(*CORRELATION)), draw)

    def _forward_with(self, world: World, draw: Draws) -> ForwardModel:
        """The forward model on the mesh with its nodes where this skin's are."""
        if not (world.misplaced_mm or world.out_of_round):
            return self._forward
        count, rim = self.skin.electrodes.count, self._deformation.rim
        shifts, outwards = np.zeros(count), np.zeros(len(rim.nodes))
        if world.misplaced_mm:
            shifts = world.misplaced_mm * draw("misplaced").standard_normal(count)
        if world.out_of_round:
            generator = draw("out of round")
            x, y = (self.mesh.nodes_mm[rim.nodes] - self.skin.outline.centre_mm).T
            for harmonic in (2, 3):
                size, phase = generator.standard_normal(), generator.uniform(0, 2 * math.pi)
                outwards += size * np.cos(harmonic * np.arctan2(y, x) - phase)
            outwards *= world.out_of_round * self._radius_mm
        mesh = self._deformation.moved(shifts, np.ones(count), outwards)
        return ForwardModel(mesh, self.skin, self.protocol)


def draw_touches(skin: Skin, world: World, generator: np.random.Generator) -> tuple[TrueTouch, ...]:
    """One scene's touches: sizes first, then places until all fit; after 200 misses for one touch
    all places are drawn again."""
    number = int(generator.integers(*world.count, endpoint=True))
    if not number:
        return ()
    if world.pair_mm is not None:
        return _draw_pair(skin, world, world.pair_mm, generator)
    sizes = _sizes(world, generator, number)
    radii, _, aspects, _ = sizes
    long_mm = radii * np.sqrt(aspects)
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    places: list[tuple[float, float]] = []
    misses = 0
    while len(places) < number:
        x, y = float(generator.uniform(x0, x1)), float(generator.uniform(y0, y1))
        k = len(places)
        if world.spacing_radii is None:
            least = long_mm[k] + long_mm[:k] + GAP_MM
        else:
            least = world.spacing_radii * (radii[k] + radii[:k]) / 2
        away = np.hypot(*(np.array(places).reshape(-1, 2) - (x, y)).T)
        margin = long_mm[k] + RIM_MARGIN_MM
        if (away >= least).all() and rim_distance_mm(skin.outline, (x, y))[0] >= margin:
            places.append((x, y))
            misses = 0
        else:
            misses += 1
        if misses >= 200:
            places, misses = [], 0
    return _shaped(world, np.array(places), *sizes)


def _sizes(
    world: World, generator: np.random.Generator, number: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Radii, contrasts, aspects and angles."""
    return (
        generator.uniform(*world.radius_mm, size=number),
        generator.uniform(*world.contrast, size=number),
        generator.uniform(*world.aspect, size=number),
        generator.uniform(0.0, math.pi, size=number),
    )


def _draw_pair(
    skin: Skin, world: World, pair_mm: Range, generator: np.random.Generator
) -> tuple[TrueTouch, ...]:
    """Two fingers side by side: long axes along one another to 20 degrees, and across the line of
    their middles, on which they do not overlap."""
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    while True:
        radii, contrasts, aspects, angles = _sizes(world, generator, 2)
        apart = float(generator.uniform(*pair_mm))
        angles[1] = angles[0] + math.radians(float(generator.uniform(-20.0, 20.0)))
        across = angles[0] + math.pi / 2
        middle = generator.uniform((x0, y0), (x1, y1))
        half = apart / 2 * np.array([math.cos(across), math.sin(across)])
        places = np.array([middle - half, middle + half])
        margin = radii * np.sqrt(aspects) + RIM_MARGIN_MM
        fits = (rim_distance_mm(skin.outline, places) >= margin).all()
        if fits and (radii / np.sqrt(aspects)).sum() <= apart:
            return _shaped(world, places, radii, contrasts, aspects, angles)


def _shaped(
    world: World,
    places: np.ndarray,
    radii: np.ndarray,
    contrasts: np.ndarray,
    aspects: np.ndarray,
    angles: np.ndarray,
) -> tuple[TrueTouch, ...]:
    shapes = [
        None if world.shape is None else named_shape(world.shape, float(a), math.degrees(angle))
        for a, angle in zip(aspects, angles, strict=True)
    ]
    return tuple(
        TrueTouch(float(x), float(y), float(r), float(c), shape)
        for (x, y), r, c, shape in zip(places, radii, contrasts, shapes, strict=True)
    )


def _measured(exact_v: np.ndarray, world: World, seed: int, role: str) -> np.ndarray:
    """Untouched frames and the touched one (q + 1, m), with noise and converter."""
    how, (untouched, touched) = Measurement(), exact_v
    rms = float(np.sqrt((untouched**2).mean()))
    noise_v = 0.0 if world.snr_db is None else rms * 10 ** (-world.snr_db / 20)
    span_v = how.adc_headroom * float(np.abs(untouched).max())
    lsb_v = 2 * span_v / 2**world.adc_bits if world.adc_bits else 0.0
    many = np.vstack([np.tile(untouched, (how.quiet_frames, 1)), touched])
    return measure(many, noise_v, lsb_v, span_v, seed, role)[0]
