"""The current patterns that must be solved for a protocol, and how the voltages of its rows follow
from them."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.skin.protocol import Protocol


@dataclass(frozen=True, eq=False)
class Patterns:
    """The P solved patterns of a protocol with m rows, and the Q different pairs that drive or
    measure in it.

    Pattern p drives 1 A into ``solved[p, 0]`` and out of ``solved[p, 1]``. Pair q is the sum of the
    patterns weighted by ``mix[q]`` (Q, P). Row r drives ``drive_sign[r]`` times pair ``drive[r]``
    and measures ``measure_sign[r]`` times pair ``measure[r]``; ``voltage_pairs`` (m, 2) are its
    electrodes V+ and V-. All values are per ampere.
    """

    solved: IntArray
    mix: FloatArray
    drive: IntArray
    drive_sign: FloatArray
    measure: IntArray
    measure_sign: FloatArray
    voltage_pairs: IntArray

    @property
    def mixes(self) -> bool:
        """True if any pair is not simply one of the solved patterns."""
        return len(self.mix) != len(self.solved) or not np.array_equal(
            self.mix, np.eye(len(self.mix))
        )

    def right_hand_sides(self, n_electrodes: int) -> FloatArray:
        """Return the currents in A into each electrode, (L, P)."""
        currents = np.zeros((n_electrodes, len(self.solved)))
        columns = np.arange(len(self.solved))
        currents[self.solved[:, 0], columns] += 1.0
        currents[self.solved[:, 1], columns] -= 1.0
        return currents

    def voltages(self, electrodes: FloatArray) -> FloatArray:
        """Return the boundary voltages (m,) in V per A for the electrode potentials (L, P) of the
        patterns."""
        potentials = electrodes @ self.mix.T if self.mixes else electrodes
        plus, minus = self.voltage_pairs[:, 0], self.voltage_pairs[:, 1]
        return np.asarray(
            (potentials[plus, self.drive] - potentials[minus, self.drive]) * self.drive_sign
        )


def patterns_for(protocol: Protocol) -> Patterns:
    """Choose the patterns of ``protocol``: one for each different pair; or, if there are more pairs
    than electrodes, pairs of neighbours, whose sums give all other pairs."""
    rows = protocol.drive_measure.astype(np.int64)
    m, n = len(rows), protocol.n_electrodes
    pairs = rows.reshape(-1, 2)
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    keys, number = np.unique(low * n + high, return_inverse=True)
    distinct = np.column_stack(np.divmod(keys, n))
    sign = np.where(pairs[:, 0] == low, 1.0, -1.0).reshape(m, 2)
    number = number.reshape(m, 2)
    if len(distinct) <= n:
        solved, mix = distinct, np.eye(len(distinct))
    else:
        k = np.arange(n - 1)
        solved = np.column_stack([k, k + 1])
        mix = ((distinct[:, :1] <= k) & (k < distinct[:, 1:])).astype(np.float64)
    return Patterns(solved, mix, number[:, 0], sign[:, 0], number[:, 1], sign[:, 1], rows[:, 2:])
