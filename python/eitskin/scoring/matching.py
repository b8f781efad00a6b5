"""Match found touches with true ones: the optimal matching within a gate."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray

GATE_MM = 10.0
WANTED_SIGNS = {"increase": (1,), "decrease": (-1,), "both": (1, -1)}


@dataclass(frozen=True)
class Matching:
    """The result of matching found touches with true ones.

    ``pairs`` are (true index, found index) in the order of the true touches, and ``distances_mm``
    are their distances. ``misses`` and ``false_touches`` count the true and found touches without a
    partner.
    """

    pairs: tuple[tuple[int, int], ...]
    distances_mm: tuple[float, ...]
    misses: int
    false_touches: int

    @property
    def hits(self) -> int:
        """The number of true touches that were found."""
        return len(self.pairs)

    @property
    def exact(self) -> bool:
        """Return whether every true touch was found within the gate, and nothing else."""
        return self.misses == 0 and self.false_touches == 0


def match(true_mm: npt.ArrayLike, found_mm: npt.ArrayLike, gate_mm: float = GATE_MM) -> Matching:
    """Match true positions (k, 2) with found ones (l, 2), or both in space (3): the matching has as
    many pairs within the gate as possible, and of such matchings the least sum of distances.

    One assignment problem does both. A pair beyond the gate costs more than all pairs within it
    could together, so that a pair is never given up for shorter distances elsewhere.
    """
    given = [np.asarray(one, dtype=np.float64) for one in (true_mm, found_mm)]
    dimensions = next((one.shape[1] for one in given if one.ndim == 2 and one.shape[1]), 2)
    true, found = (one.reshape(-1, dimensions) for one in given)
    distance = np.sqrt(((true[:, None, :] - found[None, :, :]) ** 2).sum(axis=2))
    cost = np.where(distance <= gate_mm, distance, gate_mm * (min(distance.shape) + 1.0))
    if len(true) > len(found):
        assigned = sorted((i, j) for j, i in enumerate(assign(cost.T)))
    else:
        assigned = list(enumerate(assign(cost)))
    pairs = tuple((i, j) for i, j in assigned if distance[i, j] <= gate_mm)
    return Matching(
        pairs,
        tuple(float(distance[pair]) for pair in pairs),
        len(true) - len(pairs),
        len(found) - len(pairs),
    )


def assign(cost: FloatArray) -> list[int]:
    """Return the column assigned to each row of ``cost`` (k, l), k <= l: different columns with the
    least sum of costs.

    The method is shortest augmenting paths with potentials (R. Jonker and A. Volgenant, Computing
    38 (1987) 325-340, doi 10.1007/BF02278710).
    """
    columns = range(cost.shape[1])
    values: list[list[float]] = cost.tolist()
    of_row, of_column = [0.0] * len(values), [0.0] * len(columns)  # potentials
    row_at = [-1] * len(columns)  # the row that each column is assigned to
    for start in range(len(values)):
        least, before = [math.inf] * len(columns), [-1] * len(columns)
        done: list[int] = []
        reached, last = 0.0, -1
        while last < 0 or row_at[last] >= 0:
            row = start if last < 0 else row_at[last]
            for k in columns:
                through = reached + values[row][k] - of_row[row] - of_column[k]
                if k not in done and through < least[k]:
                    least[k], before[k] = through, last
            last = min((k for k in columns if k not in done), key=least.__getitem__)
            reached = least[last]
            done.append(last)
        of_row[start] += reached
        for k in done[:-1]:
            of_row[row_at[k]] += reached - least[k]
            of_column[k] -= reached - least[k]
        while last >= 0:
            row_at[last] = start if before[last] < 0 else row_at[before[last]]
            last = before[last]
    return sorted(columns, key=lambda k: (row_at[k] < 0, row_at[k]))[: len(values)]
