"""Orders of rows: how others list the rows of a protocol and number electrodes, and how their rows
are matched to ours."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, IntArray
from eitskin.errors import FrameError, UsageError
from eitskin.skin.protocol import Protocol

GROUND = -1  # in place of V-: the row is the potential of V+ against ground
ORDERS = ("fixed", "rotating", "fixed-all", "rotating-all")

# The names under which a row may be found, best first: as it is, with both pairs reversed, with one
# pair reversed (sign -1); then the same for its reciprocal.
PREFERENCE = tuple(
    ([columns[k] for k in flip], sign)
    for columns in ((0, 1, 2, 3), (2, 3, 0, 1))
    for flip, sign in (((0, 1, 2, 3), 1), ((1, 0, 3, 2), 1), ((1, 0, 2, 3), -1), ((0, 1, 3, 2), -1))
)


@dataclass(frozen=True, eq=False)
class RowMatch:
    """The places of the wanted rows in a source: wanted row r equals row ``index[r]`` of the
    source, minus its row ``minus[r]`` unless this is -1, times ``sign[r]`` (all (m,) int64)."""

    index: IntArray
    minus: IntArray
    sign: IntArray

    def taken_from(self, frames: AnyArray) -> AnyArray:
        """Return the wanted rows (..., m) of ``frames`` (..., rows)."""
        values = frames[..., self.index]
        if (self.minus >= 0).any():
            values = values - np.where(self.minus >= 0, frames[..., self.minus], 0.0)
        return np.asarray(values * self.sign)

    @property
    def used(self) -> IntArray:
        """The rows of the source that are used, ascending."""
        return np.unique(np.concatenate([self.index, self.minus[self.minus >= 0]]))

    def filled(self, row: int, other: int) -> "RowMatch":
        """Return the match with ``row`` taken from where ``other`` is."""
        index, minus, sign = self.index.copy(), self.minus.copy(), self.sign.copy()
        for places in (index, minus, sign):
            places[row] = places[other]
        return RowMatch(index, minus, sign)


def source_table(order: str, protocol: Protocol, *, potentials: bool = False) -> IntArray:
    """Return the rows [I+, I-, V+, V-] of ``protocol`` as a source in ``order`` lists them, (rows,
    4).

    With "fixed" the measuring pairs of each drive ascend from electrode 0 (this project's order).
    With "rotating" they ascend from the drive's I+ onwards, modulo the number of electrodes. The
    suffix "-all" includes pairs that touch a driving electrode. With ``potentials`` a row is the
    potential of one electrode against ground, for all electrodes of each drive in this order.

    Raises:
        UsageError: the order is not known, or does not fit the protocol.
    """
    if order not in ORDERS:
        raise UsageError(
            f"order {order!r} is not known; use one of {', '.join(ORDERS)}, or table with a table"
            " file"
        )
    rows = np.asarray(protocol.drive_measure, dtype=np.int64)
    if potentials:
        rows = _electrodes_of_drives(rows, protocol.n_electrodes)
    elif order.endswith("-all"):
        rows = _with_driven_pairs(rows, protocol.n_electrodes)
    if not order.startswith("rotating"):
        return rows
    block = np.cumsum(np.r_[0, (np.diff(rows[:, :2], axis=0) != 0).any(axis=1)])
    turn = (rows[:, 2] - rows[:, 0]) % protocol.n_electrodes
    return np.asarray(rows[np.lexsort((turn, block))])


def match_rows(source: IntArray, wanted: IntArray) -> RowMatch:
    """Find each row of ``wanted`` (m, 4) in ``source`` (rows, 4); either pair may be reversed.

    A row that is not in the source is the difference of two potentials of its drive if the source
    has these, and otherwise taken from its reciprocal (drive and measuring pair exchanged).

    Raises:
        FrameError: the source has neither.
    """
    pairs = np.flatnonzero(np.asarray(source)[:, 3] != GROUND)
    place: dict[tuple[int, int, int, int], tuple[int, int]] = {}
    for columns, sign in PREFERENCE:
        for row, key in zip(pairs.tolist(), source[pairs][:, columns].tolist(), strict=True):
            place.setdefault(tuple(key), (row, sign))
    potential: dict[tuple[int, int, int], int] = {}
    for row in np.flatnonzero(np.asarray(source)[:, 3] == GROUND).tolist():
        potential.setdefault(tuple(source[row, :3].tolist()), row)
    wanted_rows = [tuple(row) for row in np.asarray(wanted).tolist()]
    found = [_found(row, place, potential) for row in wanted_rows]
    absent = [row for row, hit in zip(wanted_rows, found, strict=True) if hit is None]
    if absent:
        raise FrameError(
            f"{len(absent)} of the protocol's {len(found)} rows are not in the source, first"
            f" {list(absent[0])} [I+, I-, V+, V-]; keep the source's own table with"
            "  --protocol table"
        )
    hits = np.array([hit for hit in found if hit is not None], dtype=np.int64).reshape(-1, 3)
    return RowMatch(hits[:, 0], hits[:, 1], hits[:, 2])


def _found(
    row: tuple[int, ...],
    place: dict[tuple[int, int, int, int], tuple[int, int]],
    potential: dict[tuple[int, int, int], int],
) -> tuple[int, int, int] | None:
    """Return index, minus and sign of a wanted row as in RowMatch, or None."""
    a, b, c, d = row
    if (hit := place.get((a, b, c, d))) is not None:
        return hit[0], -1, hit[1]
    if not potential:
        return None
    for i, j, k, m in ((a, b, c, d), (c, d, a, b)):
        for drive, sign in (((i, j), 1), ((j, i), -1)):
            plus, minus = (potential.get((*drive, electrode)) for electrode in (k, m))
            if plus is not None and minus is not None:
                return plus, minus, sign
    return None


def electrode_map(n: int, rotate: int = 0, mirror: bool = False) -> IntArray:
    """Return our number of each source electrode, (n,): source 0 is our ``rotate``, and the next
    ones count up, or down with ``mirror``."""
    steps = np.arange(n, dtype=np.int64)
    return np.asarray((rotate - steps if mirror else rotate + steps) % n)


def swap_map(n: int, pairs: Iterable[Sequence[int]]) -> IntArray:
    """Return the map (n,) that exchanges the electrodes of each of ``pairs``, one pair after the
    other."""
    mapped = np.arange(n, dtype=np.int64)
    for pair in pairs:
        if len(set(pair)) != 2 or not all(0 <= electrode < n for electrode in pair):
            raise UsageError(
                f"swap {','.join(map(str, pair))}: name two different electrodes of 0 to {n - 1}"
            )
        i, j = pair
        mapped = np.where(mapped == i, j, np.where(mapped == j, i, mapped))
    return mapped


def relabel(rows: IntArray, electrodes: IntArray) -> IntArray:
    """Return ``rows`` (m, 4) with every electrode e replaced by ``electrodes[e]``; GROUND
    stays."""
    given = np.asarray(rows)
    return np.where(given == GROUND, GROUND, electrodes[given])


def touching(rows: IntArray, electrodes: Iterable[int]) -> BoolArray:
    """Return which rows (m,) use any of ``electrodes``."""
    return np.asarray(np.isin(rows, list(electrodes)).any(axis=1))


def _electrodes_of_drives(rows: IntArray, n: int) -> IntArray:
    places = np.sort(np.unique(rows[:, :2], axis=0, return_index=True)[1])
    drives = np.repeat(rows[places, :2], n, axis=0)
    electrode = np.tile(np.arange(n), len(places))
    return np.column_stack([drives, electrode, np.full(len(drives), GROUND)])


def _with_driven_pairs(rows: IntArray, n: int) -> IntArray:
    step = (rows[:, 3] - rows[:, 2]) % n
    if len(set(step.tolist())) != 1:
        raise UsageError(
            "an order with all pairs goes only with adjacent, opposite or skip; give a table file"
            " instead"
        )
    places = np.sort(np.unique(rows[:, :2], axis=0, return_index=True)[1])
    k = np.arange(n)
    drives = rows[places, :2]
    pairs = np.column_stack([k, (k + step[0]) % n])
    return np.column_stack([np.repeat(drives, n, axis=0), np.tile(pairs, (len(drives), 1))])
