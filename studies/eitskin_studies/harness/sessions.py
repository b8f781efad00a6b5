"""Scenes solved once without noise, and measured as often as wanted: the frames that studies and
trade-offs score by.

Contacts, noise and drift depend on the seed and the role of the touches only, as in
``eitskin.scene.simulate``: a set of the same name has the same frames wherever it is used.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import Mesh
from eitskin.fileio import write_beside
from eitskin.progress import Progress
from eitskin.scene.random_touches import TouchSet, TrueTouch
from eitskin.scene.simulate import Measurement, conductivity_with, measure
from eitskin.scene.streams import stream
from eitskin.scoring.metrics import Raster
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import BASE_SAMPLES
from eitskin_studies.harness.snr import FINE_BITS, FINE_CONVERTER_DB, noise_deviation_v


@dataclass(frozen=True)
class Drift:
    """Changes since the reference was taken: the sheet's conductivity, each contact's impedance and
    the current's amplitude. Each changes uniformly, by up to this fraction of itself."""

    sheet: float
    contact: float
    amplitude: float


@dataclass(frozen=True, eq=False)
class MeasuredFrames:
    """The frames that a configuration gets: ``untouched_v`` (q, m), and ``frames_v`` (k, h, m):
    scene k held for h frames, the last judged."""

    untouched_v: FloatArray
    frames_v: FloatArray


@dataclass(frozen=True, eq=False)
class FrameSession:
    """A set's scenes, solved: ``exact_v`` (k, m) and ``exact_untouched_v`` (m,) V without noise and
    converter."""

    name: str
    protocol: Protocol
    sheet_s_per_m: float
    touches: TouchSet
    exact_v: FloatArray
    exact_untouched_v: FloatArray

    @property
    def scenes(self) -> int:
        """The number of scenes."""
        return len(self.exact_v)

    @cached_property
    def _truths(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _cache(self) -> Any:
        return lru_cache(maxsize=4)(self._measure)

    def truths(self, raster: Raster) -> BoolArray:
        """The true touches of each scene on the cells of ``raster``, (k, p); kept for the last
        raster."""
        kept = self._truths
        if kept.get("raster") is not raster:
            masks = np.array([scene.mask(raster.points_mm) for scene in self.touches.scenes])
            kept.update(raster=raster, masks=masks)
        masks = kept["masks"]
        assert isinstance(masks, np.ndarray)
        return masks

    def measured(
        self, snr_db: float, samples: int = BASE_SAMPLES, scan: str = "full", held: int = 1
    ) -> MeasuredFrames:
        """The frames with noise: sigma = rms(V0) 10^(-snr_db / 20) sqrt(80 / samples), then the
        converter of ``Measurement``, with 16 bits from 70 dB on, where the steps of 12 bits would
        be the noise. A reciprocal scan copies each measured row, with its sign, to the reciprocal
        one. Configurations share the random numbers, so that their differences are paired.
        """
        measured: MeasuredFrames = self._cache(snr_db, samples, scan, held)
        return measured

    def _measure(self, snr_db: float, samples: int, scan: str, held: int) -> MeasuredFrames:
        how = converter_for(snr_db)
        role, seed, untouched = self.touches.role, self.touches.seed, self.exact_untouched_v
        noise_v = noise_deviation_v(untouched, snr_db, samples)
        span_v = how.adc_headroom * float(np.abs(untouched).max())
        lsb_v = 0.0 if how.adc_bits is None else 2 * span_v / 2**how.adc_bits
        converter = (noise_v, lsb_v, span_v, seed)
        untouched_v, _ = measure(
            np.tile(untouched, (how.quiet_frames, 1)), *converter, f"quiet {role}"
        )
        names = [*(f"frame {role}, held {h}" for h in range(held - 1)), f"frame {role}"]
        frames_v = np.stack([measure(self.exact_v, *converter, name)[0] for name in names], axis=1)
        if scan == "reciprocal":
            untouched_v, frames_v = (
                copied(untouched_v, self.protocol),
                copied(frames_v, self.protocol),
            )
        return MeasuredFrames(untouched_v, frames_v)


def converter_for(snr_db: float) -> Measurement:
    """The measurement of ``eitskin compare``, with a finer converter where its steps would be the
    noise."""
    return Measurement(
        snr_db=snr_db, adc_bits=FINE_BITS if snr_db >= FINE_CONVERTER_DB else Measurement.adc_bits
    )


def copied(values_v: FloatArray, protocol: Protocol) -> FloatArray:
    """``values_v`` (..., m) with each pair's second row copied from the first, as a board's
    reciprocal scan does it."""
    fold = protocol.reciprocal_pairs()
    paired = fold.second >= 0
    result = values_v.copy()
    result[..., fold.second[paired]] = fold.sign[paired] * values_v[..., fold.first[paired]]
    return result


@dataclass(eq=False)
class SceneSolver:
    """Solves scenes on one mesh of about ``elements`` elements, nonlinearly; kept in ``folder``
    where one is given, so that a run that goes on need not solve again."""

    skin: Skin
    protocol: Protocol
    elements: int
    folder: Path | None = None

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh, made when it is first asked for."""
        from eitskin.fem.mesh import mesh_for_elements

        return mesh_for_elements(self.skin, self.elements)

    def session(
        self, drawn: TouchSet, progress: Progress, name: str = "", drift: Drift | None = None
    ) -> FrameSession:
        """The set ``drawn`` with the contacts of its own session, +-20 % under its seed and role.

        Raises:
            GeometryError, MissingExtraError: from meshing and solving.
        """
        named = name or drawn.role
        volts = self._kept(named, drawn, progress, drift)
        return FrameSession(
            named, self.protocol, self.skin.conductivity_s_per_m, drawn, volts[1:], volts[0]
        )

    def _kept(
        self, name: str, drawn: TouchSet, progress: Progress, drift: Drift | None
    ) -> FloatArray:
        if self.folder is None:
            return self._solve(name, drawn, progress, drift)
        discs = [[_facts_of(t) for t in s.touches] for s in drawn.scenes]
        place = [
            self.skin.name,
            f"{self.protocol.hash:016x}",
            self.skin.conductivity_s_per_m,
            repr(self.skin.electrodes),
        ]
        facts = [
            drawn.name,
            self.elements,
            None if drift is None else vars(drift),
            discs,
            place,
            repr(self.skin.outline),
        ]
        digest = hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16]
        path = self.folder / f"{name.replace(' ', '-')}-{digest}.npy"
        if path.is_file():
            volts: FloatArray = np.load(path, allow_pickle=False)
            if volts.shape == (len(drawn.scenes) + 1, self.protocol.n_rows):
                return volts
        volts = self._solve(name, drawn, progress, drift)
        self.folder.mkdir(parents=True, exist_ok=True)
        with write_beside(path) as temporary:
            np.save(temporary, volts, allow_pickle=False)
        return volts

    def _solve(
        self, name: str, drawn: TouchSet, progress: Progress, drift: Drift | None
    ) -> FloatArray:
        """The untouched frame, then one a scene: (1 + k, m)."""
        mesh, skin, sheet, seed = self.mesh, self.skin, self.skin.conductivity_s_per_m, drawn.seed
        spread = (
            stream(seed, f"contact {drawn.role}").uniform(-1.0, 1.0, skin.electrodes.count)
            * Measurement.contact_spread
        )
        contact = np.asarray(skin.electrodes.contact_impedance_ohm_m2 * (1.0 + spread))
        forward = ForwardModel(mesh, skin, self.protocol, contact)
        volts = [forward.voltages(np.full(mesh.n_elements, sheet))]
        for k, scene in enumerate(progress(drawn.scenes, f"simulating ({name})")):
            touched = conductivity_with(mesh, scene.touches, sheet)
            if drift is None:
                volts.append(forward.voltages(touched))
                continue
            generator = stream(seed, f"drift {drawn.role}", k)
            sheet_by, amplitude_by = 1 + generator.uniform(-1, 1, 2) * (
                drift.sheet,
                drift.amplitude,
            )
            contact_by = 1 + drift.contact * generator.uniform(-1, 1, len(contact))
            volts.append(amplitude_by * forward.voltages(sheet_by * touched, contact * contact_by))
        return np.array(volts)


def _facts_of(touch: TrueTouch) -> list[float | str]:
    """All that a touch is, for a digest."""
    disc: list[float | str] = [touch.x_mm, touch.y_mm, touch.radius_mm, touch.contrast]
    return disc if touch.shape is None else [*disc, *vars(touch.shape).values()]


def apparent_change_s_per_m_mm2(touch: TrueTouch, sheet_s_per_m: float) -> float:
    """Return the total change by a touch: its disc's area times 2 (c - 1) / (c + 1) of the sheet's
    conductivity, which is how a disc of contrast c answers. A linear method can find no more,
    however strong the contrast."""
    return (
        math.pi
        * touch.radius_mm**2
        * 2
        * (touch.contrast - 1)
        / (touch.contrast + 1)
        * sheet_s_per_m
    )
