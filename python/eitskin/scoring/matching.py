"""Which found touch is which true one: optimal matching within a gate, and what it leaves over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.errors import missing_extra

GATE_MM = 10.0


@dataclass(frozen=True)
class Matching:
    """How found touches were paired with true ones.

    Attributes:
        pairs: (true index, found index) of each hit, in the order of the true touches.
        distances_mm: the position error of each hit.
        misses: true touches that nothing was paired with.
        false_touches: found touches that no true one was paired with.
    """

    pairs: tuple[tuple[int, int], ...]
    distances_mm: tuple[float, ...]
    misses: int
    false_touches: int

    @property
    def hits(self) -> int:
        """How many true touches were found."""
        return len(self.pairs)

    @property
    def exact(self) -> bool:
        """Every true touch found within the gate, and nothing else."""
        return self.misses == 0 and self.false_touches == 0


def match(true_mm: npt.ArrayLike, found_mm: npt.ArrayLike, gate_mm: float = GATE_MM) -> Matching:
    """Pair true positions (k, 2) with found ones (l, 2): as many pairs within the gate as possible,
    then the nearest.

    One assignment problem does both: a pair beyond the gate costs more than all pairs within it
    could together, so that a pair is never given up for shorter distances elsewhere.

    Raises:
        MissingExtraError: scipy is absent.
    """
    try:
        from scipy.optimize import linear_sum_assignment
    except ImportError:
        raise missing_extra("model", "scipy") from None
    true = np.asarray(true_mm, dtype=np.float64).reshape(-1, 2)
    found = np.asarray(found_mm, dtype=np.float64).reshape(-1, 2)
    distance = np.sqrt(((true[:, None, :] - found[None, :, :]) ** 2).sum(axis=2))
    cost = np.where(distance <= gate_mm, distance, gate_mm * (min(distance.shape) + 1.0))
    rows, columns = linear_sum_assignment(cost)
    pairs = tuple(
        (int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] <= gate_mm
    )
    return Matching(
        pairs,
        tuple(float(distance[pair]) for pair in pairs),
        len(true) - len(pairs),
        len(found) - len(pairs),
    )
