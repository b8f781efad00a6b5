"""Alternatives that a user might take, on the same scenes: accuracy, and time on this host.

The scenes "train" and "random" are those of ``eitskin compare`` under the same seed, so that its
numbers stand beside those of configurations.
"""

from collections.abc import Sequence
from time import perf_counter_ns
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.progress import Progress
from eitskin.scene.simulate import Measurement
from eitskin.skin.protocol import Protocol
from eitskin.skin.skin import Skin
from eitskin.tuning.configuration import ELEMENTS
from eitskin_studies.compare.families import Family, Method, Setup, setup_for
from eitskin_studies.compare.methods import baseline_methods
from eitskin_studies.compare.pyeit_method import pyeit_method
from eitskin_studies.compare.run import CompareSettings, compare


def peer_families(setup: Setup) -> Sequence[Family]:
    """The baselines, of plain FISTA only the best, and pyEIT's."""
    *linear, _, _, _, fista = baseline_methods(setup.jacobian, setup.grid)
    return *linear, fista, pyeit_method(setup)


def score_peers(
    skin: Skin, protocol: Protocol, settings: dict[str, Any], progress: Progress
) -> list[dict[str, Any]]:
    """The results of each method at its best parameter ``value``: mean image MIoU with its 95 %
    interval. ``settings``: ``scenes``, ``train_scenes``, ``seed``, ``simulated_elements`` and
    ``snr_db``.

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
    return [
        {
            "name": one.name,
            "value": one.value,
            "mean": one.miou_summary.mean,
            "low": one.miou_summary.low,
            "high": one.miou_summary.high,
        }
        for one in compared.results
    ]


def time_peers(
    skin: Skin, protocol: Protocol, peers: list[dict[str, Any]], dv: FloatArray, rounds: int
) -> list[float]:
    """The median time of a frame on this host in us, of each of ``peers``; eight frames of ``dv``
    (k, m) a round."""
    setup = setup_for(skin, protocol, elements=ELEMENTS)
    return [
        _frame_us(family.make(one["value"]), dv, rounds)
        for family, one in zip(peer_families(setup), peers, strict=True)
    ]


def _frame_us(method: Method, dv: FloatArray, rounds: int) -> float:
    times = []
    for k in range(8 * rounds):
        begun = perf_counter_ns()
        method.reconstruct(dv[k % len(dv)][None])
        times.append((perf_counter_ns() - begun) / 1000)
    return round(float(np.median(times)), 1)
