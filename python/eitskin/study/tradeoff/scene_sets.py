"""Scenes that configurations are judged on: what is touched, solved once without noise, then measured as each would do it.

The sets "train" and "random" are those of ``eitskin compare``: the same scenes, contacts and noise under the same seed.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.errors import GeometryError, UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh
from eitskin.fileio import write_beside
from eitskin.scene.random_touches import Scene, Touch, TouchRules, TouchSet, random_touches, rim_distance_mm, spaced_touches
from eitskin.scene.simulate import Measurement, conductivity_with, measure
from eitskin.scene.streams import stream
from eitskin.skin.outline import Outline
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.study.judge.metrics import Raster, disc_mask
from eitskin.study.tradeoff.configuration import BASE_SAMPLES

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Progress = Callable[[Sequence[Any], str], Iterable[Any]]

TRAIN, HEADLINE = "train", "random"
HEADLINE_DB = 60.0
FINE_CONVERTER_DB, FINE_BITS = 70.0, 16
DRIFT_SHEET, DRIFT_CONTACT, DRIFT_AMPLITUDE = 0.03, 0.1, 0.01


@dataclass(frozen=True)
class SceneSet:
    """What is touched in a set of scenes. ``draw`` takes outline, seed and count; ``drifts``: the skin has changed since the
    reference was taken."""

    text: str
    draw: Callable[[Outline, int, int], TouchSet]
    drifts: bool = False


def _random(role: str, rules: TouchRules | None = None) -> Callable[[Outline, int, int], TouchSet]:
    return lambda outline, seed, count: random_touches(outline, seed, count, role, rules)


def ring_touches(outline: Outline, seed: int, count: int, touches: int, spacing_mm: float, radius_mm: float = 9.0) -> TouchSet:
    """``count`` scenes of ``touches`` equal touches of contrast 5 on a ring, neighbours ``spacing_mm`` apart, place and turn
    random.

    Raises:
        GeometryError: the ring does not fit on the skin.
    """
    role, ring_mm = f"{touches} on a ring of {spacing_mm:g} mm", spacing_mm / (2 * math.sin(math.pi / touches))
    x0, y0, x1, y1 = outline.bounding_box_mm
    scenes = []
    for k in range(count):
        generator = stream(seed, f"touches {role}", k)
        for _ in range(2000):
            centre, turn = generator.uniform((x0, y0), (x1, y1)), generator.uniform(0, 2 * math.pi)
            angles = turn + 2 * math.pi * np.arange(touches) / touches
            places = centre + ring_mm * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            if rim_distance_mm(outline, places).min() >= radius_mm + 4.0:
                break
        else:
            raise GeometryError(f"{touches} touches of {radius_mm:g} mm, {spacing_mm:g} mm apart, do not fit on this skin")
        scenes.append(Scene(f"{role}-s{seed}-{k}", tuple(Touch(float(x), float(y), radius_mm, 5.0) for x, y in places)))
    return TouchSet(role, seed, tuple(scenes))


SETS: dict[str, SceneSet] = {
    TRAIN: SceneSet("1 to 3 random touches, for choosing t and the scale of force", _random("train")),
    HEADLINE: SceneSet("1 to 3 random touches, radius 6 to 12 mm, contrast 3 to 10", _random("test")),
    "single": SceneSet("one such touch", _random("single", TouchRules(count=(1, 1)))),
    "pairs": SceneSet("two touches of radius 9 mm, centres 27 mm apart", lambda o, s, n: ring_touches(o, s, n, 2, 27.0)),
    "three": SceneSet("three random touches", _random("three", TouchRules(count=(3, 3)))),
    "six apart": SceneSet(
        "six touches of radius 9 mm, centres at least 45 mm apart", lambda o, s, n: spaced_touches(o, s, n, 6, 5.0)
    ),
    "six close": SceneSet(
        "six touches of radius 9 mm on a ring, neighbours 27 mm apart", lambda o, s, n: ring_touches(o, s, n, 6, 27.0)
    ),
    "light": SceneSet(
        "one or two light presses, radius 5 to 8 mm, contrast 1.3 to 2",
        _random("light", TouchRules(count=(1, 2), radius_mm=(5.0, 8.0), contrast=(1.3, 2.0))),
    ),
    "drift": SceneSet(
        "as random; since the reference the sheet changed by up to 3 %, each contact by 10 %, the amplitude by 1 %",
        _random("drift"),
        drifts=True,
    ),
}


@dataclass(frozen=True, eq=False)
class Measured:
    """What a configuration gets: ``quiet_v`` (q, m), and ``frames_v`` (k, h, m): scene k held for h frames, the last judged."""

    quiet_v: FloatArray
    frames_v: FloatArray


@dataclass(frozen=True, eq=False)
class Session:
    """A set's scenes, solved: ``exact_v`` (k, m) and ``exact_quiet_v`` (m,) V without noise and converter."""

    name: str
    protocol: Protocol
    sheet_s_per_m: float
    touches: TouchSet
    exact_v: FloatArray
    exact_quiet_v: FloatArray

    @property
    def scenes(self) -> int:
        """How many."""
        return len(self.exact_v)

    @cached_property
    def _truths(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _cache(self) -> Any:
        return lru_cache(maxsize=4)(self._measure)

    def truths(self, raster: Raster) -> BoolArray:
        """The true discs of each scene on the cells of ``raster``, (k, p); kept for the last raster."""
        kept = self._truths
        if kept.get("raster") is not raster:
            scenes = self.touches.scenes
            masks = np.array([disc_mask(raster.points_mm, scene.centres_mm(), scene.radii_mm()) for scene in scenes])
            kept.update(raster=raster, masks=masks)
        masks = kept["masks"]
        assert isinstance(masks, np.ndarray)
        return masks

    def measured(self, snr_db: float, samples: int, scan: str, held: int) -> Measured:
        """The frames with noise: sigma = rms(V0) 10^(-snr_db / 20) sqrt(80 / samples), then the converter of ``Measurement``,
        with 16 bits from 70 dB on, where the steps of 12 bits would be the noise. A reciprocal scan copies each measured row,
        with its sign, to the reciprocal one. Configurations share the random numbers, so that their differences are paired."""
        measured: Measured = self._cache(snr_db, samples, scan, held)
        return measured

    def _measure(self, snr_db: float, samples: int, scan: str, held: int) -> Measured:
        how = converter_for(snr_db)
        role, seed, quiet = self.touches.role, self.touches.seed, self.exact_quiet_v
        noise_v = float(np.sqrt((quiet**2).mean())) * 10 ** (-snr_db / 20) * math.sqrt(BASE_SAMPLES / samples)
        span_v = how.adc_headroom * float(np.abs(quiet).max())
        lsb_v = 0.0 if how.adc_bits is None else 2 * span_v / 2**how.adc_bits
        converter = (noise_v, lsb_v, span_v, seed)
        quiet_v, _ = measure(np.tile(quiet, (how.quiet_frames, 1)), *converter, f"quiet {role}")
        names = [*(f"frame {role}, held {h}" for h in range(held - 1)), f"frame {role}"]
        frames_v = np.stack([measure(self.exact_v, *converter, name)[0] for name in names], axis=1)
        if scan == "reciprocal":
            quiet_v, frames_v = copied(quiet_v, self.protocol), copied(frames_v, self.protocol)
        return Measured(quiet_v, frames_v)


def converter_for(snr_db: float) -> Measurement:
    """The measurement of ``eitskin compare``, with a finer converter where its steps would be the noise."""
    return Measurement(snr_db=snr_db, adc_bits=FINE_BITS if snr_db >= FINE_CONVERTER_DB else Measurement.adc_bits)


def copied(values_v: FloatArray, protocol: Protocol) -> FloatArray:
    """``values_v`` (..., m) with each pair's second row copied from the first, as a board's reciprocal scan does it."""
    fold = protocol.reciprocal_pairs()
    paired = fold.second >= 0
    result = values_v.copy()
    result[..., fold.second[paired]] = fold.sign[paired] * values_v[..., fold.first[paired]]
    return result


class Workshop:
    """Solves the scenes of sets, once: kept in ``folder`` where one is given, so that a run that goes on need not solve again."""

    def __init__(self, skin: Skin, protocol: Protocol, seed: int, elements: int, folder: Path | None = None) -> None:
        self.skin, self.protocol, self.seed, self.elements, self.folder = skin, protocol, seed, elements, folder
        self._sessions: dict[tuple[str, int], Session] = {}
        self._mesh: Mesh | None = None

    def session(self, name: str, count: int, progress: Progress) -> Session:
        """``count`` scenes of the set ``name``.

        Raises:
            UsageError, GeometryError, MissingExtraError: from drawing, meshing and solving.
        """
        if name not in SETS:
            raise UsageError(f"no set of scenes is named {name!r}; known are {', '.join(SETS)}")
        if (name, count) not in self._sessions:
            drawn = SETS[name].draw(self.skin.outline, self.seed, count)
            volts = self._kept(name, count, drawn, progress)
            self._sessions[name, count] = Session(name, self.protocol, self.skin.conductivity_s_per_m, drawn, volts[1:], volts[0])
        return self._sessions[name, count]

    def _kept(self, name: str, count: int, drawn: TouchSet, progress: Progress) -> FloatArray:
        if self.folder is None:
            return self._solve(name, drawn, progress)
        discs = [[list(vars(t).values()) for t in s.touches] for s in drawn.scenes]
        facts = [drawn.name, self.elements, SETS[name].drifts, discs]
        digest = hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]
        path = self.folder / f"{name.replace(' ', '-')}-{digest}.npy"
        if path.is_file():
            volts: FloatArray = np.load(path, allow_pickle=False)
            if volts.shape == (count + 1, self.protocol.n_rows):
                return volts
        volts = self._solve(name, drawn, progress)
        self.folder.mkdir(parents=True, exist_ok=True)
        with write_beside(path) as temporary:
            np.save(temporary, volts, allow_pickle=False)
        return volts

    def _solve(self, name: str, drawn: TouchSet, progress: Progress) -> FloatArray:
        """The quiet frame, then one a scene, (1 + k, m), solved nonlinearly with the contacts of the set's own session."""
        from eitskin.fem.mesh import mesh_for_elements

        if self._mesh is None:
            self._mesh = mesh_for_elements(self.skin, self.elements)
        mesh, skin, sheet = self._mesh, self.skin, self.skin.conductivity_s_per_m
        spread = stream(self.seed, f"contact {drawn.role}").uniform(-1.0, 1.0, skin.electrodes.count) * Measurement.contact_spread
        contact = np.asarray(skin.electrodes.contact_impedance_ohm_m2 * (1.0 + spread))
        forward = ForwardModel(mesh, skin, self.protocol, contact)
        volts = [forward.voltages(np.full(mesh.n_elements, sheet))]
        for k, scene in enumerate(progress(drawn.scenes, f"simulating ({name})")):
            touched = conductivity_with(mesh, scene.touches, sheet)
            if not SETS[name].drifts:
                volts.append(forward.voltages(touched))
                continue
            generator = stream(self.seed, f"drift {drawn.role}", k)
            sheet_by, amplitude_by = 1 + generator.uniform(-1, 1, 2) * (DRIFT_SHEET, DRIFT_AMPLITUDE)
            contact_by = 1 + DRIFT_CONTACT * generator.uniform(-1, 1, len(contact))
            volts.append(amplitude_by * forward.voltages(sheet_by * touched, contact * contact_by))
        return np.array(volts)


def apparent_change_s_per_m_mm2(touch: Touch, sheet_s_per_m: float) -> float:
    """What a touch changes in all: its disc's area times 2 (c - 1) / (c + 1) of the sheet's conductivity, which is how a disc of
    contrast c answers. A linear method can find no more, however strong the contrast."""
    return math.pi * touch.radius_mm**2 * 2 * (touch.contrast - 1) / (touch.contrast + 1) * sheet_s_per_m

