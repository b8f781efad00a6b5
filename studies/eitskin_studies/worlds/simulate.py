"""Simulates sets of other worlds: for each scene a skin of its own, 64 untouched frames and one
touched frame.

One mesh of about 11,000 elements serves all (the model is made on another); misplaced electrodes
and outlines out of round move its nodes. Each part is drawn from a stream of its own, named after
the family, the set and the part: "tuning" and "judging" share nothing under any seed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.config import nearest
from eitskin.errors import GeometryError, UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.deform import MeshDeformation
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.fileio import write_beside
from eitskin.progress import Progress, silent
from eitskin.scene.cover import Cover, with_touches
from eitskin.scene.random_field import random_field
from eitskin.scene.random_touches import TouchScene, TrueTouch, rim_distance_mm
from eitskin.scene.simulate import Measurement, measure
from eitskin.scene.streams import stream
from eitskin.scene.touch_shape import named_shape
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin_studies.harness.sessions import converter_for
from eitskin_studies.worlds.worlds import WORLDS, Errors, TouchKinds, World

Generators = Callable[[str], np.random.Generator]

FAMILIES = ("tuning", "judging")
ELEMENTS = 11_000
RIM_MARGIN_MM = 4.0
TRIES = 20_000


@dataclass(frozen=True, eq=False)
class WorldScenes:
    """A set, simulated: scene k has ``untouched_v[k]`` (q, m) for its tare and ``frames_v[k]``
    (m,), in V.

    ``scenes[k]`` holds its touches, ``step_v[k]`` a step of its converter, 0 without.
    """

    name: str
    world: World
    scenes: tuple[TouchScene, ...]
    untouched_v: FloatArray
    frames_v: FloatArray
    step_v: FloatArray


@dataclass(eq=False)
class WorldFactory:
    """Simulates sets on one skin; kept in ``folder`` where one is given."""

    skin: Skin
    protocol: Protocol
    folder: Path | None = None
    elements: int = ELEMENTS

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh of the skin as described."""
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

    def scenes(
        self,
        name: str,
        count: int,
        seed: int,
        snr_db: float | None = None,
        *,
        family: str = "tuning",
        progress: Progress = silent,
    ) -> WorldScenes:
        """``count`` scenes of the set ``name``; ``snr_db`` replaces the set's own where it has
        noise.

        Raises:
            UsageError: no such set or family, or a seed below 0.
            GeometryError, MissingExtraError: from drawing and meshing.
        """
        world = named_world(name)
        if family not in FAMILIES:
            raise UsageError(f"worlds: family {family!r}: use one of {', '.join(FAMILIES)}")
        if snr_db is not None and world.snr_db is not None:
            world = replace(world, snr_db=snr_db)
        role = f"worlds {family} {name}"
        drawn = [
            draw_touches(self.skin, world.touches, stream(seed, f"{role} touches", k))
            for k in range(count)
        ]
        exact = self._kept(role, world.errors, drawn, seed, progress)
        measured = measured_frames(exact, world, seed, role)
        scenes = tuple(
            TouchScene(f"{name}-{family}-s{seed}-{k}", touches) for k, touches in enumerate(drawn)
        )
        return WorldScenes(name, world, scenes, *measured)

    def _kept(
        self,
        role: str,
        errors: Errors,
        drawn: list[tuple[TrueTouch, ...]],
        seed: int,
        progress: Progress,
    ) -> FloatArray:
        """(k, 2, m): untouched, touched; exact. What is kept holds for these very touches and
        errors."""
        if self.folder is None:
            return self._solve_all(role, errors, drawn, seed, progress)
        import hashlib

        facts = (repr(self.skin), self.protocol.hash, self.elements, role, errors, drawn, seed)
        digest = hashlib.sha256(repr(facts).encode()).hexdigest()[:16]
        path = self.folder / f"{role.replace(' ', '-')}-{digest}.npy"
        if path.is_file():
            kept: FloatArray = np.load(path, allow_pickle=False)
            return kept
        exact = self._solve_all(role, errors, drawn, seed, progress)
        self.folder.mkdir(parents=True, exist_ok=True)
        with write_beside(path) as temporary:
            np.save(temporary, exact, allow_pickle=False)
        return exact

    def _solve_all(
        self,
        role: str,
        errors: Errors,
        drawn: list[tuple[TrueTouch, ...]],
        seed: int,
        progress: Progress,
    ) -> FloatArray:
        def draws(k: int) -> Generators:
            return lambda part: stream(seed, f"{role} {part}", k)

        return np.array(
            [self._solve(errors, drawn[k], draws(k)) for k in progress(range(len(drawn)), role)]
        )

    def _solve(
        self, errors: Errors, touches: tuple[TrueTouch, ...], draw: Generators
    ) -> FloatArray:
        """The untouched and the touched frame (2, m) of one skin."""
        forward = self._forward_with(errors, draw)
        middles = forward.mesh.centroids_mm()
        electrodes = self.skin.electrodes
        contact = np.full(electrodes.count, electrodes.contact_impedance_ohm_m2)
        if errors.contact_log_sd:
            contact *= np.exp(errors.contact_log_sd * draw("contact").standard_normal(len(contact)))
        else:
            contact *= 1 + errors.contact_spread * draw("contact").uniform(-1, 1, len(contact))
        sheet = np.full(len(middles), self.skin.conductivity_s_per_m)
        if errors.uneven:
            sheet *= np.exp(errors.uneven * self._field(errors, middles, draw("uneven")))
        untouched = forward.voltages(sheet, contact)
        drifted, amplitude = sheet.copy(), 1.0
        if errors.drift:
            drifted *= np.exp(errors.drift * self._field(errors, middles, draw("drift")))
        if errors.contact_drift:
            change = errors.contact_drift * draw("contact drift").standard_normal(len(contact))
            contact = contact * np.exp(change)
        if errors.amplitude_drift:
            amplitude += errors.amplitude_drift * float(draw("amplitude drift").standard_normal())
        changed = with_touches(drifted, Cover(forward.mesh).change(touches))
        return np.array([untouched, amplitude * forward.voltages(changed, contact)])

    def _field(self, errors: Errors, at_mm: FloatArray, draw: np.random.Generator) -> FloatArray:
        length_mm = self._radius_mm * float(draw.uniform(*errors.correlation))
        return random_field(at_mm, length_mm, draw)

    def _forward_with(self, errors: Errors, draw: Generators) -> ForwardModel:
        """The forward model on the mesh with its nodes where this skin's are."""
        if not (errors.misplaced_mm or errors.out_of_round):
            return self._forward
        count, rim = self.skin.electrodes.count, self._deformation.rim
        shifts, outwards = np.zeros(count), np.zeros(len(rim.nodes))
        if errors.misplaced_mm:
            shifts = errors.misplaced_mm * draw("misplaced").standard_normal(count)
        if errors.out_of_round:
            generator = draw("out of round")
            x, y = (self.mesh.nodes_mm[rim.nodes] - self.skin.outline.centre_mm).T
            for harmonic in (2, 3):
                size, phase = generator.standard_normal(), generator.uniform(0, 2 * math.pi)
                outwards += size * np.cos(harmonic * np.arctan2(y, x) - phase)
            outwards *= errors.out_of_round * self._radius_mm
        mesh = self._deformation.moved(shifts, np.ones(count), outwards)
        return ForwardModel(mesh, self.skin, self.protocol)


def named_world(name: str) -> World:
    """The set ``name``.

    Raises:
        UsageError: there is none.
    """
    if name not in WORLDS:
        raise UsageError(f"worlds: no set is named {name!r}; {nearest(name, WORLDS)}")
    return WORLDS[name]


def draw_touches(
    skin: Skin, kinds: TouchKinds, generator: np.random.Generator
) -> tuple[TrueTouch, ...]:
    """One scene's touches: sizes first, then places until all fit; after 200 misses for one touch
    all places are drawn again.

    Raises:
        GeometryError: they do not fit on this skin.
    """
    number = int(generator.integers(kinds.count[0], kinds.count[1], endpoint=True))
    if not number:
        return ()
    if kinds.pair_mm is not None:
        return _draw_pair(skin, kinds, generator)
    radii, contrasts, aspects, angles = _sizes(kinds, generator, number)
    long_mm = radii * np.sqrt(aspects)
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    places: list[tuple[float, float]] = []
    misses = 0
    for _ in range(TRIES):
        x, y = float(generator.uniform(x0, x1)), float(generator.uniform(y0, y1))
        k = len(places)
        if kinds.spacing_radii is None:
            least = long_mm[k] + long_mm[:k] + kinds.gap_mm
        else:
            least = kinds.spacing_radii * (radii[k] + radii[:k]) / 2
        away = np.hypot(*(np.array(places).reshape(-1, 2) - (x, y)).T)
        margin = long_mm[k] + RIM_MARGIN_MM
        if (away >= least).all() and rim_distance_mm(skin.outline, (x, y))[0] >= margin:
            places.append((x, y))
            misses = 0
        else:
            misses += 1
        if len(places) == number:
            return _shaped(kinds, np.array(places), radii, contrasts, aspects, angles)
        if misses >= 200:
            places, misses = [], 0
    raise GeometryError(f"worlds: {number} touches of up to {radii.max():.3g} mm do not fit")


def _sizes(
    kinds: TouchKinds, generator: np.random.Generator, number: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    return (
        generator.uniform(*kinds.radius_mm, size=number),
        generator.uniform(*kinds.contrast, size=number),
        generator.uniform(*kinds.aspect, size=number),
        generator.uniform(0.0, math.pi, size=number),
    )


def _draw_pair(
    skin: Skin, kinds: TouchKinds, generator: np.random.Generator
) -> tuple[TrueTouch, ...]:
    """Two fingers side by side: long axes along one another to 20 degrees, and across the line of
    their middles, on which they do not overlap."""
    assert kinds.pair_mm is not None
    x0, y0, x1, y1 = skin.outline.bounding_box_mm
    for _ in range(TRIES):
        radii, contrasts, aspects, angles = _sizes(kinds, generator, 2)
        apart = float(generator.uniform(*kinds.pair_mm))
        angles[1] = angles[0] + math.radians(float(generator.uniform(-20.0, 20.0)))
        across = angles[0] + math.pi / 2
        middle = generator.uniform((x0, y0), (x1, y1))
        half = apart / 2 * np.array([math.cos(across), math.sin(across)])
        places = np.array([middle - half, middle + half])
        margin = radii * np.sqrt(aspects) + RIM_MARGIN_MM
        fits = (rim_distance_mm(skin.outline, places) >= margin).all()
        if fits and (radii / np.sqrt(aspects)).sum() <= apart:
            return _shaped(kinds, places, radii, contrasts, aspects, angles)
    raise GeometryError("worlds: two fingers do not fit on this skin")


def _shaped(
    kinds: TouchKinds,
    places: FloatArray,
    radii: FloatArray,
    contrasts: FloatArray,
    aspects: FloatArray,
    angles: FloatArray,
) -> tuple[TrueTouch, ...]:
    shapes = [
        None if kinds.shape is None else named_shape(kinds.shape, float(a), math.degrees(angle))
        for a, angle in zip(aspects, angles, strict=True)
    ]
    return tuple(
        TrueTouch(float(x), float(y), float(r), float(c), shape)
        for (x, y), r, c, shape in zip(places, radii, contrasts, shapes, strict=True)
    )


def measured_frames(
    exact_v: FloatArray, world: World, seed: int, role: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Untouched frames (k, q, m) and touched frames (k, m) with noise and converter, and its steps
    (k,)."""
    how = Measurement() if world.snr_db is None else converter_for(world.snr_db)
    bits = how.adc_bits if world.adc_bits is None else world.adc_bits
    tares, frames, steps = [], [], []
    for k, (untouched, touched) in enumerate(exact_v):
        rms = float(np.sqrt((untouched**2).mean()))
        noise_v = 0.0 if world.snr_db is None else rms * 10 ** (-world.snr_db / 20)
        span_v = how.adc_headroom * float(np.abs(untouched).max())
        lsb_v = 2 * span_v / 2**bits if bits else 0.0
        many = np.vstack([np.tile(untouched, (how.quiet_frames, 1)), touched])
        noisy, _ = measure(many, noise_v, lsb_v, span_v, seed, f"{role} {k}")
        tares.append(noisy[:-1])
        frames.append(noisy[-1])
        steps.append(lsb_v)
    return np.array(tares), np.array(frames), np.array(steps)
