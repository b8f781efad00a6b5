"""Every method's numbers: at fixed parameters and threshold, and at its best."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scoring import metrics
from eitskin_studies.experiments.algorithms.candidates import Candidate
from eitskin_studies.experiments.algorithms.measure import (
    Arrays,
    ChosenParameter,
    Field,
    choose,
    judged,
    shown,
    tuning_curves,
)
from eitskin_studies.experiments.algorithms.scenes import NUMBERS
from eitskin_studies.harness.summary import Summary, summarise
from eitskin_studies.harness.thresholds import THRESHOLDS, best_threshold

FIXED_THRESHOLD = 0.1


@dataclass(frozen=True, eq=False)
class AlgorithmResult:
    """A method on all sets.

    Attributes:
        chosen: on the tuning scenes.
        fixed, best: of each set of test scenes, by the number of touches: at the fixed value, and
            at the chosen one.
        fixed_t: the t that the tuning scenes prefer at the fixed value.
        low_t_range: least and greatest mean MIoU on the tuning scenes at FIXED_THRESHOLD, over
            every value tried.
        shown: the scenes of the pictures, at the chosen value; ``shown_fixed`` at the fixed one.
    """

    candidate: Candidate
    chosen: ChosenParameter
    fixed: dict[int, Arrays]
    best: dict[int, Arrays]
    fixed_t: float
    low_t_range: tuple[float, float]
    shown: Arrays
    shown_fixed: Arrays

    def at_fixed(self, number: int | None = None, t: float = FIXED_THRESHOLD) -> Summary:
        """MIoU at the fixed value and ``t``; None takes all test scenes."""
        return _summary(tuple(column(_joined(self.fixed, number, metrics.LOOKUP), t)))

    def at_best(self, number: int | None = None, lookup: str = metrics.LOOKUP) -> Summary:
        """MIoU at the chosen value and the t that was chosen for ``lookup``."""
        return _summary(
            tuple(column(_joined(self.best, number, lookup), self.chosen.thresholds[lookup]))
        )

    def at_each_own(self) -> Summary:
        """MIoU at the chosen value where each test image takes the t that is best for it: no fair
        number, but a bound."""
        return _summary(tuple(_joined(self.best, None, metrics.LOOKUP).max(axis=1)))

    def curve(self, fixed: bool) -> FloatArray:
        """Mean MIoU of all test scenes at each threshold, (T,)."""
        return np.asarray(
            _joined(self.fixed if fixed else self.best, None, metrics.LOOKUP).mean(axis=0)
        )

    def position_mm(self, number: int) -> float:
        """Median distance of the touches found; nan if none is."""
        distances_mm = self.best[number]["distances_mm"]
        return float(np.median(distances_mm)) if len(distances_mm) else math.nan

    def exact_count(self, number: int) -> float:
        """Share of scenes with every touch found and nothing else."""
        return float(self.best[number]["exact"].mean())

    @property
    def kmacs(self) -> float:
        """Thousand multiply-accumulates a frame at the chosen value, the mean over all test
        scenes."""
        return float(np.concatenate([one["macs"] for one in self.best.values()]).mean()) / 1e3


def column(curves: FloatArray, t: float) -> FloatArray:
    """Return the MIoU at ``t`` (k,) from that at each of ``THRESHOLDS`` (k, T)."""
    return np.asarray(curves[:, THRESHOLDS.index(t)])


def result_of(field: Field, candidate: Candidate) -> AlgorithmResult:
    """Return all results of a method; results that are kept are read."""
    chosen = choose(field, candidate)
    tuned = {
        value: tuning_curves(field, candidate, value)[metrics.LOOKUP] for value in candidate.values
    }
    low_t = [float(curve[THRESHOLDS.index(FIXED_THRESHOLD)]) for curve in tuned.values()]
    return AlgorithmResult(
        candidate=candidate,
        chosen=chosen,
        fixed={number: judged(field, candidate, candidate.fixed, number) for number in NUMBERS},
        best={
            number: judged(field, candidate, chosen.value, number, chosen.touch_threshold)
            for number in NUMBERS
        },
        fixed_t=best_threshold(tuned[candidate.fixed][None]),
        low_t_range=(min(low_t), max(low_t)),
        shown=shown(field, candidate, chosen.value, chosen.touch_threshold),
        shown_fixed=shown(field, candidate, candidate.fixed, chosen.touch_threshold),
    )


@lru_cache(maxsize=1024)
def _summary(values: tuple[float, ...]) -> Summary:
    """The same scenes stand in tables, pictures and data; resampling takes its time."""
    return summarise(values)


def _joined(of_number: dict[int, Arrays], number: int | None, lookup: str) -> FloatArray:
    wanted = of_number.values() if number is None else [of_number[number]]
    return np.concatenate([one[lookup] for one in wanted])
