"""The accuracy of counts and places: fractions with Wilson intervals, errors with bootstrap
intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin_studies.harness.thresholds import match_all

NORMAL_95 = 1.959964
RESAMPLES = 1000


@dataclass(frozen=True)
class Share:
    """``hits`` of ``count``; ``low`` and ``high``: the 95 % Wilson interval (Wilson 1927); nan of
    none."""

    hits: int
    count: int
    mean: float
    low: float
    high: float


def share(hits: int, count: int) -> Share:
    """With its interval."""
    if count == 0:
        return Share(0, 0, math.nan, math.nan, math.nan)
    z, p = NORMAL_95**2 / count, hits / count
    middle = (p + z / 2) / (1 + z)
    half = math.sqrt(z * p * (1 - p) + z * z / 4) / (1 + z)
    return Share(hits, count, p, max(0.0, middle - half), min(1.0, middle + half))


def share_of(truth: Sequence[bool] | BoolArray) -> Share:
    """Return the share of truth values that are true."""
    values = np.asarray(truth, dtype=np.bool_)
    return share(int(values.sum()), len(values))


@dataclass(frozen=True)
class Quantile:
    """A quantile of errors in mm, and its 95 % percentile-bootstrap interval; nan of none."""

    value: float
    low: float
    high: float


def quantile(values: Sequence[float], at: float, seed: int = 0) -> Quantile:
    """At ``at`` of 1."""
    data = np.asarray(values, dtype=np.float64)
    if not len(data):
        return Quantile(math.nan, math.nan, math.nan)
    drawn = np.random.default_rng(seed).integers(0, len(data), (RESAMPLES, len(data)))
    low, high = np.quantile(np.quantile(data[drawn], at, axis=1), [0.025, 0.975])
    return Quantile(float(np.quantile(data, at)), float(low), float(high))


@dataclass(frozen=True)
class Score:
    """The counts of one method on one cell at one SNR.

    Attributes:
        exact: scenes with every touch within 10 mm, and nothing else.
        right: scenes with the right number, wherever.
        recall: touches found within 10 mm.
        false_a_scene: found touches that are none.
        median_mm, p95_mm: position error of hits.
        kmac, most_kmac: thousand multiply-accumulates a frame, mean and most; nan where the method
            is not the core.
    """

    exact: Share
    right: Share
    recall: Share
    false_a_scene: float
    median_mm: Quantile
    p95_mm: Quantile
    kmac: float
    most_kmac: float


def score(
    truths_mm: Sequence[FloatArray], found_mm: Sequence[FloatArray], macs: Sequence[int] = ()
) -> Score:
    """Return the counts of scenes from their true and found places."""
    matchings = match_all(truths_mm, found_mm)
    errors = [d for m in matchings for d in m.distances_mm]
    hits = sum(m.hits for m in matchings)
    return Score(
        share_of([m.exact for m in matchings]),
        share_of([m.misses == m.false_touches for m in matchings]),
        share(hits, hits + sum(m.misses for m in matchings)),
        sum(m.false_touches for m in matchings) / max(len(matchings), 1),
        quantile(errors, 0.5),
        quantile(errors, 0.95),
        float(np.mean(macs)) / 1e3 if macs else math.nan,
        max(macs) / 1e3 if macs else math.nan,
    )


def auc(values: npt.ArrayLike, truth: npt.ArrayLike) -> float:
    """Area under the ROC curve: how often a true one has the greater value than a false one, halves
    for equals (Mann and Whitney 1947); nan without either."""
    v, t = np.asarray(values, dtype=np.float64), np.asarray(truth, dtype=np.bool_)
    true, false = np.sort(v[t]), v[~t]
    if not len(true) or not len(false):
        return math.nan
    above = len(true) - np.searchsorted(true, false, side="right")
    equal = np.searchsorted(true, false, side="right") - np.searchsorted(true, false, side="left")
    return float((above + equal / 2).sum() / (len(true) * len(false)))


def roc(values: npt.ArrayLike, truth: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """False and true rates as the bar falls, from (0, 0) to (1, 1)."""
    v, t = np.asarray(values, dtype=np.float64), np.asarray(truth, dtype=np.bool_)
    order = np.argsort(-v, kind="stable")
    rates = [
        np.concatenate([[0.0], np.cumsum(hit) / max(int(hit.sum()), 1)])
        for hit in (~t[order], t[order])
    ]
    return rates[0], rates[1]
