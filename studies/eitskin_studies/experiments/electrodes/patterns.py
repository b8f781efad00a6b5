"""Patterns of drive and measurement for any number of electrodes, all out of one transfer matrix;
and what time they take.

T[d, j] is the voltage of the pair (j, j + 1) while the pair (d, d + 1) drives; a pair (a, b) is the
sum of its neighbours' pairs from a to b - 1, in drive and in measurement alike, so that one solve
of every neighbours' pair serves every pattern.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.skin.protocol import Protocol, adjacent, opposite, skip

PATTERNS: dict[str, Callable[[int], Protocol]] = {
    "adjacent": adjacent,
    "skip 1": partial(skip, skip=1),
    "skip 2": partial(skip, skip=2),
    "skip 4": partial(skip, skip=4),
    "opposite": opposite,
}
FRAME_US, PERIOD_US, SETTLE_US, SWITCH_US = (
    20_800,
    20,
    16,
    3,
)  # of the board: 208 slots of 100 us, at 50 kHz and 1 MS/s


def transfer(electrodes: int) -> Protocol:
    """Every neighbours' pair driven, every neighbours' pair measured: n n rows. No board scans it;
    solvers do."""
    k = np.arange(electrodes)
    pairs = np.column_stack([k, (k + 1) % electrodes])
    return Protocol(
        electrodes,
        np.column_stack([np.repeat(pairs, electrodes, axis=0), np.tile(pairs, (electrodes, 1))]),
    )


def from_transfer(values: FloatArray, protocol: Protocol) -> FloatArray:
    """``values`` (..., n n) in the order of ``transfer`` as the rows of ``protocol``, (..., m)."""
    n, rows = protocol.n_electrodes, protocol.drive_measure.astype(np.int64)
    matrix = values.reshape(-1, n, n)
    pairs, number = np.unique(rows.reshape(-1, 2), axis=0, return_inverse=True)
    number = number.reshape(-1, 2)
    k = np.arange(n)
    sums = (np.mod(k - pairs[:, :1], n) < np.mod(pairs[:, 1:] - pairs[:, :1], n)).astype(np.float64)
    mixed = np.matmul(np.matmul(sums, matrix), sums.T)
    return np.asarray(mixed[:, number[:, 0], number[:, 1]]).reshape(*values.shape[:-1], len(rows))


def unique_rows(protocol: Protocol, every: int = 1) -> Protocol:
    """One row of each reciprocal pair, of every ``every``-th drive."""
    rows = protocol.drive_measure
    _, first = np.unique(rows[:, :2], axis=0, return_index=True)
    drives = rows[np.sort(first)][::every, :2]
    kept = rows[(rows[:, None, :2] == drives[None]).all(axis=2).any(axis=1)]
    thinned = Protocol(protocol.n_electrodes, kept, protocol.current_a)
    return Protocol(
        protocol.n_electrodes, kept[thinned.reciprocal_pairs().first], protocol.current_a
    )


def samples_within(rows: int, frame_us: float = FRAME_US) -> int:
    """Samples of a measurement where ``rows`` are to be measured in ``frame_us``: whole periods
    beside settling and switching, in a slot of whole periods; 0 if not even one period fits."""
    slot_us = int(frame_us / rows / PERIOD_US) * PERIOD_US
    return max(0, (slot_us - SETTLE_US - SWITCH_US) // PERIOD_US * PERIOD_US)


def scan_ms(rows: int, samples: int) -> float:
    """Return the time of a scan of ``rows`` with ``samples`` per measurement."""
    slot_us = -(-(samples + SETTLE_US + SWITCH_US) // PERIOD_US) * PERIOD_US
    return rows * slot_us / 1000


@dataclass(frozen=True, eq=False)
class ScanPattern:
    """The measurements and their length: ``protocol``, ``samples`` of each row, every how many
    drives are left."""

    protocol: Protocol
    samples: int
    every: int = 1

    @property
    def ms(self) -> float:
        """The scan's time."""
        return scan_ms(self.protocol.n_rows, self.samples)


def within_time(protocol: Protocol, frame_us: float = FRAME_US) -> ScanPattern:
    """One row of each reciprocal pair in ``frame_us``, with as many samples as fit; where none fit,
    of fewer drives."""
    every = 1
    while True:
        scan = unique_rows(protocol, every)
        samples = samples_within(scan.n_rows, frame_us)
        if samples:
            return ScanPattern(scan, samples, every)
        every += 1
