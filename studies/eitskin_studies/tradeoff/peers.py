"""Other methods on the scenes, the scans and the noise of the configurations: accuracy, and time on
this host.

Each method takes the parameter and the threshold t that are best on the training scenes of the same
scan and SNR. A half scan copies each row to its reciprocal one, for all methods.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scoring import metrics
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import ELEMENTS
from eitskin_studies.compare.families import Family, Method, Setup, setup_for
from eitskin_studies.compare.methods import (
    CONVERGED_RATIOS,
    baseline_methods,
    plain_fista,
    total_variation,
)
from eitskin_studies.compare.pyeit_method import pyeit_method
from eitskin_studies.harness.sessions import FrameSession
from eitskin_studies.harness.summary import summarise
from eitskin_studies.harness.thresholds import best_threshold, miou_curves

SLOW_US = 20_000  # a method that takes longer is timed on a tenth of the frames


@dataclass(frozen=True)
class Scan:
    """How frames are measured: ``name`` in tables; ``scan`` and ``samples`` of a configuration."""

    name: str
    scan: str
    samples: int


SCANS = (
    Scan("full scan, 80 samples", "full", 80),
    Scan("full scan, 20 samples", "full", 20),
    Scan("half scan, 80 samples", "reciprocal", 80),
    Scan("half scan, 20 samples", "reciprocal", 20),
)


def peer_families(setup: Setup) -> Sequence[Family]:
    """The baselines, of plain FISTA the non-negative one with 300 and with 3,000 iterations, total
    variation, and pyEIT's Gauss-Newton."""
    *linear, _, _, _, fista = baseline_methods(setup.jacobian, setup.grid)
    converged = plain_fista(setup.jacobian, 3000, signed=False, ratios=CONVERGED_RATIOS)
    variation = total_variation(setup.jacobian, setup.grid)
    return *linear, fista, converged, variation, pyeit_method(setup)


class Peers:
    """The other methods of one skin, made once."""

    def __init__(self, skin: Skin, protocol: Protocol) -> None:
        setup = setup_for(skin, protocol, elements=ELEMENTS)
        self._scorer = metrics.judge_for(skin.outline, setup.grid)
        self._families = {
            family.make(family.values[0]).name: family for family in peer_families(setup)
        }
        self._made: dict[tuple[str, float], Method] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The methods, in the order of tables."""
        return tuple(self._families)

    def score(
        self, name: str, train: FrameSession, test: FrameSession, scan: Scan, snr_db: float
    ) -> dict[str, Any]:
        """Return a method's parameter and threshold, chosen on ``train``, and its image MIoU on
        ``test``: mean, 95 % interval, mean of the worst 10 %."""
        best = (-1.0, 0.0, 0.0)
        truths = train.truths(self._scorer.raster)
        for value in self._families[name].values:
            curves = miou_curves(
                self._scorer, self._images(name, value, train, scan, snr_db), truths
            )
            score = float(curves.mean(axis=0).max())
            if score > best[0] + 1e-12:
                best = (score, value, best_threshold(curves))
        _, value, threshold = best
        images = self._images(name, value, test, scan, snr_db)
        truths = test.truths(self._scorer.raster)
        of = summarise(miou_curves(self._scorer, images, truths, [threshold])[:, 0])
        shown = {"mean": of.mean, "low": of.low, "high": of.high, "worst_tenth": of.worst_tenth}
        return {
            "name": name,
            "scan": scan.name,
            "snr_db": snr_db,
            "value": value,
            "threshold": threshold,
            **{key: round(one, 4) for key, one in shown.items()},
        }

    def _method(self, name: str, value: float) -> Method:
        """A method at a value, made once: pyEIT's takes seconds."""
        if (name, value) not in self._made:
            self._made[name, value] = self._families[name].make(value)
        return self._made[name, value]

    def _images(
        self, name: str, value: float, session: FrameSession, scan: Scan, snr_db: float
    ) -> FloatArray:
        method = self._method(name, value)
        return np.asarray(method.reconstruct(differences_v(session, scan, snr_db)))

    def time(
        self, name: str, value: float, session: FrameSession, scan: Scan, snr_db: float, rounds: int
    ) -> dict[str, float]:
        """Return the time of a frame on this host in us, a frame at a time over ``rounds`` rounds
        of eight: median, and that of the slowest frame."""
        method = self._method(name, value)
        dv = differences_v(session, scan, snr_db)[:8]
        slow = _frame_us(method, dv[:1]) > SLOW_US
        times = np.array(
            [
                [_frame_us(method, one[None]) for one in dv]
                for _ in range(max(rounds // 10, 1) if slow else rounds)
            ]
        )
        medians = np.median(times, axis=0)
        return {
            "host_us": round(float(np.median(times)), 1),
            "host_most_us": round(float(medians.max()), 1),
        }


def differences_v(session: FrameSession, scan: Scan, snr_db: float) -> FloatArray:
    """Difference frames (k, m) of a session, in V."""
    measured = session.measured(snr_db, scan.samples, scan.scan, 1)
    return np.asarray(measured.frames_v[:, -1] - measured.untouched_v.mean(axis=0))


def _frame_us(method: Method, dv: FloatArray) -> float:
    begun = perf_counter_ns()
    method.reconstruct(dv)
    return (perf_counter_ns() - begun) / 1000
