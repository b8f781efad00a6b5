"""What a user might take instead, on the same scenes: accuracy, and time on this host.

The scenes "train" and "random" are those of ``eitskin compare`` under the same seed, so that its
numbers stand beside those of configurations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from time import perf_counter_ns
from typing import Any

import numpy as np

from eitskin.scene.simulate import Measurement
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import ELEMENTS
from eitskin_studies.compare.families import Family, Method, Setup
from eitskin_studies.compare.methods import baseline_methods
from eitskin_studies.compare.pyeit_method import pyeit_method
from eitskin_studies.compare.run import CompareSettings, compare
from eitskin_studies.harness.sessions import Progress


@dataclass(frozen=True)
class Peer:
    """A method at its best parameter: mean image MIoU with its 95 % interval, and the median time
    of a frame in us."""

    name: str
    mean: float
    low: float
    high: float
    host_us: float


def peer_families(setup: Setup) -> Sequence[Family]:
    """The baselines and pyEIT's."""
    return *baseline_methods(setup.jacobian, setup.grid), pyeit_method(setup)


def measure_peers(
    skin: Skin, protocol: Protocol, settings: dict[str, Any], rounds: int, progress: Progress
) -> list[dict[str, Any]]:
    """Every :class:`Peer` as JSON values. ``settings``: ``scenes``, ``train_scenes``, ``seed``,
    ``simulated_elements`` and ``snr_db``; frames are timed ``rounds`` times eight.

    Raises:
        UsageError, GeometryError, MissingExtraError: as ``compare``.
    """
    how = dict(settings)
    measurement = Measurement(snr_db=how.pop("snr_db"))
    compared = compare(
        skin,
        protocol,
        CompareSettings(measurement=measurement, elements=ELEMENTS, **how),
        families=peer_families,
        progress=progress,
    )
    dv = compared.test.differences_v()
    peers = []
    for family, result in zip(peer_families(compared.setup), compared.results, strict=True):
        score = result.miou_summary
        us = _frame_us(family.make(result.value), dv, rounds)
        peers.append(asdict(Peer(result.name, score.mean, score.low, score.high, us)))
    return peers


def _frame_us(method: Method, dv: np.ndarray[Any, Any], rounds: int) -> float:
    times = []
    for k in range(max(8 * rounds, 1)):
        frame = dv[k % len(dv)][None]
        begun = perf_counter_ns()
        method.reconstruct(frame)
        times.append((perf_counter_ns() - begun) / 1000)
    return round(float(np.median(times)), 1)
