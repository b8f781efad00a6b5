"""Many numbers to a few: mean, worst tenth, median, 95th percentile, and how sure the mean is."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Summary:
    """Statistics of ``count`` values, in their own unit; all are NaN if there are no values.

    Attributes:
        mean: arithmetic mean.
        worst_tenth: mean of the worst tenth of the values (at least one), rounded up.
        median: 50th percentile.
        p95: 95th percentile.
        low, high: 95 % percentile-bootstrap interval of the mean.
        count: how many values.
    """

    mean: float
    worst_tenth: float
    median: float
    p95: float
    low: float
    high: float
    count: int


def bootstrap_interval(
    values: npt.ArrayLike, *, seed: int = 0, resamples: int = 2000, level: float = 0.95
) -> tuple[float, float]:
    """Percentile-bootstrap interval of the mean (Efron 1979): the same ``seed`` gives the same
    interval."""
    data = np.asarray(values, dtype=np.float64).reshape(-1)
    if not len(data):
        return math.nan, math.nan
    generator = np.random.default_rng(seed)
    means = np.array(
        [data[generator.integers(0, len(data), len(data))].mean() for _ in range(resamples)]
    )
    low, high = np.quantile(means, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def summarise(values: npt.ArrayLike, *, worst: str = "low", seed: int = 0) -> Summary:
    """Summary of ``values``; ``worst`` says which end is bad: "low" (a score) or "high" (an
    error)."""
    if worst not in ("low", "high"):
        raise ValueError(f"worst must be 'low' or 'high', not {worst!r}")
    data = np.sort(np.asarray(values, dtype=np.float64).reshape(-1))
    if not len(data):
        return Summary(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, 0)
    tenth = math.ceil(len(data) / 10)
    bad = data[:tenth] if worst == "low" else data[-tenth:]
    low, high = bootstrap_interval(data, seed=seed)
    median, p95 = np.quantile(data, [0.5, 0.95])
    return Summary(
        float(data.mean()), float(bad.mean()), float(median), float(p95), low, high, len(data)
    )
