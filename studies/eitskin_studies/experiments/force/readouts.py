"""Readings of a frame as the strength of its press: an image's peak or integral, or the
touch's strength off the grid."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Reconstruction
from eitskin.model.build import BuildSettings, Linearisation, linearise, make_model
from eitskin.model.model import Model
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.solve.batch import Batch
from eitskin_studies.compare.baselines import PlainFista
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS
from eitskin_studies.harness.sessions import FrameSession

FISTA_ITERATIONS, FISTA_RATIO = 30, 0.03
PEAK, INTEGRAL, IMAGE_PEAK, IMAGE_INTEGRAL, TOUCH = (
    "plain FISTA 30, peak", "plain FISTA 30, integral",
    "eitskin image, peak", "eitskin image, integral", "eitskin touch, strength",
)  # fmt: skip
LOG_INTEGRAL, LOG_TOUCH = "log-ratio image, integral", "log-ratio touch, strength"
READOUTS = (PEAK, INTEGRAL, IMAGE_PEAK, IMAGE_INTEGRAL, TOUCH, LOG_INTEGRAL, LOG_TOUCH)


@dataclass(frozen=True, eq=False)
class Readout:
    """The readings of k frames: ``value`` (k,), NaN if nothing was found; ``place_mm`` (k, 2)
    where; ``macs`` a frame, 0: not counted."""

    value: FloatArray
    place_mm: FloatArray
    macs: float


@dataclass(frozen=True)
class Instruments:
    """All that reads: one linearisation, on a mesh of its own, for the plain method and for the
    core's two models."""

    skin: Skin
    protocol: Protocol

    @cached_property
    def linear(self) -> Linearisation:
        return linearise(self.skin, self.protocol, elements=MODEL_ELEMENTS)

    @cached_property
    def models(self) -> dict[str, Model]:
        """By kind of data."""
        kinds = ("difference", "log-ratio")
        return {
            kind: make_model(self.skin, self.protocol, self.linear, BuildSettings(data_kind=kind))
            for kind in kinds
        }

    @property
    def radius_mm(self) -> float:
        """The size of the image, by which ``eitskin calibrate`` measures places."""
        return float(np.hypot(*self.linear.grid.centres_mm().T).max())

    def batch(self, kind: str, untouched_v: FloatArray) -> Batch:
        """The core with a reference."""
        batch = Batch(self.models[kind], threads=1)
        batch.tare(untouched_v)
        return batch

    def read(self, session: FrameSession, snr_db: float) -> dict[str, Readout]:
        """Every readout of every frame of ``session`` at ``snr_db``."""
        measured = session.measured(snr_db)
        frames, untouched = measured.frames_v[:, -1], measured.untouched_v
        centres, area = self.linear.grid.centres_mm(), self.linear.grid.pixel_mm**2
        fista = PlainFista(self.linear.jacobian, FISTA_ITERATIONS, FISTA_RATIO, signed=True)
        plain = fista.reconstruct(frames - untouched.mean(axis=0))
        peaks = centres[np.abs(plain).argmax(axis=1)]
        found = {
            PEAK: Readout(plain.max(axis=1), peaks, 0.0),
            INTEGRAL: Readout(plain.sum(axis=1) * area, peaks, 0.0),
        }
        for kind, names in (
            ("difference", (IMAGE_INTEGRAL, TOUCH)),
            ("log-ratio", (LOG_INTEGRAL, LOG_TOUCH)),
        ):
            results = [
                result
                for result in self.batch(kind, untouched).each(frames)
                if isinstance(result, Reconstruction)
            ]
            assert len(results) == len(frames)
            images = np.array([result.solver_image for result in results], dtype=np.float64)
            places = centres[np.abs(images).argmax(axis=1)]
            solve = float(np.mean([result.info.macs for result in results]))
            both = solve + float(np.mean([result.info.touch_macs for result in results]))
            if kind == "difference":
                found[IMAGE_PEAK] = Readout(images.max(axis=1), places, solve)
            found[names[0]] = Readout(images.sum(axis=1) * area, places, solve)
            touch = np.array([_strongest(result) for result in results], dtype=np.float64)
            found[names[1]] = Readout(touch[:, 0], touch[:, 1:], both)
        return {name: found[name] for name in READOUTS}


def _strongest(result: Reconstruction) -> tuple[float, float, float]:
    if not result.touches:
        return np.nan, np.nan, np.nan
    touch = result.touches[0]
    return touch.strength_s_per_m_mm2, touch.x_mm, touch.y_mm


def as_lists(readouts: Mapping[str, Readout]) -> dict[str, object]:
    """Return lists for the store; NaN becomes null."""

    def plain(values: FloatArray) -> list[object]:
        return [None if v != v else v for v in values.tolist()]

    return {
        name: {
            "value": plain(r.value),
            "x": plain(r.place_mm[:, 0]),
            "y": plain(r.place_mm[:, 1]),
            "macs": r.macs,
        }
        for name, r in readouts.items()
    }


def from_lists(lists: Mapping[str, Mapping[str, Any]]) -> dict[str, Readout]:
    """From the store."""

    def array(values: list[float | None]) -> FloatArray:
        return np.array([np.nan if v is None else v for v in values], dtype=np.float64)

    return {
        name: Readout(
            array(one["value"]), np.column_stack([array(one["x"]), array(one["y"])]), one["macs"]
        )
        for name, one in lists.items()
    }
