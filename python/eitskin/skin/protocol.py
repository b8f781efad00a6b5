"""The protocol of a scan: which pair drives the current and which pair is measured, row by row.

Electrodes are numbered from 0. A row is [I+, I-, V+, V-]: the current enters at I+ and leaves at
I-, and the boundary voltage is phi(V+) - phi(V-). By reciprocity, row [V+, V-, I+, I-] has the same
voltage; swapping the electrodes of a pair flips the sign.

Consecutive rows with the same driving pair form a drive. Drives are measured in the order of
``drive_order``, and the rows within a drive as listed. The order changes when a row is measured,
but not its place in a frame.

A pattern names how far apart the electrodes of a pair are: adjacent pairs are (e, e + 1), skip-n
pairs (e, e + n + 1), opposite pairs (e, e + half the electrodes).
"""

import re
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import gcd, isfinite
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import IntArray
from eitskin.config import check_keys, choice, integer, number
from eitskin.errors import ConfigError, ProtocolError
from eitskin.skin.electrodes import MAX_COUNT, MIN_COUNT

TableArray = npt.NDArray[np.uint8]

KINDS = ("adjacent", "skip-N", "opposite", "skip", "table")
PATTERNS_HELP = "adjacent, skip-1, skip-2, ..., or opposite"
SKIP = re.compile(r"skip-(-?\d{1,3})")
MIN_INDEPENDENT = 3  # rows: the place and the strength of one touch
MIXED_ELECTRODES = 32  # up to this number, patterns that measure otherwise than they drive are made
MAX_GRAM_ROWS = 3000  # folded rows whose independence is computed, within a few seconds
DEFAULT_CURRENT_A = 1e-3
MAX_ROWS = 0xFFFF


@dataclass(frozen=True, eq=False)
class Reciprocity:
    """The rows that are equal by reciprocity. Folded row k combines row ``first[k]`` with
    ``sign[k]`` times row ``second[k]``; a row without a partner has ``second[k]`` = -1.

    All three are (k,) int64; ``first`` ascends, and every row of the table is in exactly one folded
    row.
    """

    first: IntArray
    second: IntArray
    sign: IntArray


@dataclass(frozen=True, eq=False)
class Protocol:
    """A scan of m rows (m, 4) [I+, I-, V+, V-] with one drive current. ``drive_order`` lists the
    drives in the order of measurement; () keeps the order of the table.

    Raises:
        ProtocolError: no rows, too many, an electrode that does not exist, a pair of one electrode,
            a bad current, or an order that does not have each drive once.
    """

    n_electrodes: int
    drive_measure: TableArray
    current_a: float = DEFAULT_CURRENT_A
    drive_order: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not MIN_COUNT <= self.n_electrodes <= MAX_COUNT:
            raise ProtocolError(
                f"protocol: {self.n_electrodes} electrodes is out of range; use {MIN_COUNT} to"
                f" {MAX_COUNT}"
            )
        if not (isfinite(self.current_a) and self.current_a > 0):
            raise ProtocolError(f"protocol: current_a = {self.current_a:g} must be above 0")
        object.__setattr__(
            self, "drive_measure", _checked_rows(self.drive_measure, self.n_electrodes)
        )
        order, drives = tuple(int(k) for k in self.drive_order), len(self.drive_starts)
        if order and sorted(order) != list(range(drives)):
            raise ProtocolError(
                f"protocol: the order must have each drive once, 0 to {drives - 1}, not"
                f" {list(order)[:8]}{' ...' if len(order) > 8 else ''}"
            )
        object.__setattr__(self, "drive_order", () if order == tuple(range(drives)) else order)

    @property
    def drive_starts(self) -> IntArray:
        """The first row of each drive (d,)."""
        pairs = self.drive_measure[:, :2]
        return np.flatnonzero(np.r_[True, (pairs[1:] != pairs[:-1]).any(axis=1)])

    @property
    def scan_rows(self) -> IntArray:
        """The rows (m,) in the order in which they are measured."""
        if not self.drive_order:
            return np.arange(self.n_rows)
        runs = np.split(np.arange(self.n_rows), self.drive_starts[1:])
        return np.concatenate([runs[k] for k in self.drive_order])

    @property
    def scan_places(self) -> IntArray:
        """The place of each row (m,) in the order of measurement; 0 is measured first."""
        return np.argsort(self.scan_rows)

    @property
    def n_rows(self) -> int:
        """The number of voltages in a frame, m."""
        return len(self.drive_measure)

    @property
    def hash(self) -> int:
        """The 64-bit FNV-1a hash over u16le n_electrodes, u16le m, then the bytes of the rows. The
        current and the order are not included."""
        value = 0xCBF29CE484222325
        for byte in (
            struct.pack("<HH", self.n_electrodes, self.n_rows) + self.drive_measure.tobytes()
        ):
            value = ((value ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
        return value

    def reciprocal_pairs(self) -> Reciprocity:
        """Find the rows that hold the same voltage, from the table alone: pairs may be swapped,
        flipped or repeated.

        Raises:
            ProtocolError: more than two rows hold the same voltage.
        """
        groups: dict[tuple[tuple[int, int], ...], list[int]] = {}
        signs: list[int] = []
        for row, (a, b, c, d) in enumerate(self.drive_measure.tolist()):
            pairs = sorted([(min(a, b), max(a, b)), (min(c, d), max(c, d))])
            groups.setdefault(tuple(pairs), []).append(row)
            signs.append((1 if a < b else -1) * (1 if c < d else -1))
        for rows in groups.values():
            if len(rows) > 2:
                listed = ", ".join(map(str, rows))
                raise ProtocolError(
                    f"protocol: rows {listed} (from 0) all hold the same voltage by reciprocity;"
                    " keep at most two"
                )
        members = list(groups.values())
        first = [rows[0] for rows in members]
        second = [rows[1] if len(rows) == 2 else -1 for rows in members]
        sign = [signs[rows[0]] * signs[rows[-1]] for rows in members]
        return Reciprocity(*(np.array(one, dtype=np.int64) for one in (first, second, sign)))


def adjacent(n: int, current_a: float = DEFAULT_CURRENT_A) -> Protocol:
    """Return the adjacent protocol: drive (d, d+1) and measure every (k, k+1) that shares no
    electrode with it, k ascending from 0; n (n - 3) rows.

    Raises:
        ProtocolError: ``n`` is out of range.
    """
    return skip(n, 0, current_a)


def opposite(n: int, current_a: float = DEFAULT_CURRENT_A) -> Protocol:
    """Return the opposite protocol: drive (d, d + n/2) and measure every (k, k+1) that shares no
    electrode with it, k ascending from 0; n (n - 4) rows.

    Raises:
        ProtocolError: ``n`` is odd, below 6 or out of range.
    """
    return pattern(n, "opposite", current_a=current_a)


def skip(n: int, skip: int, current_a: float = DEFAULT_CURRENT_A) -> Protocol:
    """Return the skip protocol: drive and measure pairs (d, d + 1 + skip) that share no electrode;
    skip = 0 is adjacent.

    Raises:
        ProtocolError: ``n`` is out of range, or the pair does not span less than half the
            electrodes.
    """
    return pattern(n, f"skip-{skip}", current_a=current_a)


def pattern(
    n: int, drive: str, measure: str | None = None, current_a: float = DEFAULT_CURRENT_A
) -> Protocol:
    """Return the protocol that drives pairs of the pattern ``drive`` and measures those of
    ``measure``, both ascending from electrode 0, without rows that measure at a driven electrode.

    Without ``measure`` skip patterns measure as they drive, and opposite drives are measured with
    adjacent pairs. An opposite pair stands in the table in both directions; if both patterns are
    opposite, only in one, as more than two rows would hold the same voltage.

    Raises:
        ProtocolError: ``n`` is out of range, a pattern is not known or not possible for ``n``
            electrodes, or no row is left.
    """
    if not MIN_COUNT <= n <= MAX_COUNT:
        raise ProtocolError(
            f"protocol: {n} electrodes is out of range; use {MIN_COUNT} to {MAX_COUNT}"
        )
    step, measure_step = _span(drive, n), _span(measure or _measured_with(drive), n)
    pairs = n // 2 if 2 * step == 2 * measure_step == n else n
    rows = _drive_and_measure(n, step, measure_step, pairs)
    if not len(rows):
        raise ProtocolError(
            f"protocol: {drive} drives of {n} electrodes leave no {measure or drive} pair without"
            " a driven electrode; use another pattern or more electrodes"
        )
    return Protocol(n, rows, current_a)


def pattern_names(n: int) -> tuple[str, ...]:
    """Return the patterns that are possible for ``n`` electrodes, narrow pairs first."""
    skips = tuple(f"skip-{k}" for k in range(1, (n - 1) // 2))
    return ("adjacent", *skips, *(("opposite",) if n % 2 == 0 and n >= 6 else ()))


def patterns_of_length(n: int, n_rows: int) -> Iterator[Protocol]:
    """Yield the different protocols of ``n_rows`` rows that patterns make, each once: first those
    that measure as is usual for their drives, then, up to ``MIXED_ELECTRODES`` electrodes, every
    other combination of a drive and a measuring pattern."""
    names = pattern_names(n)
    named: list[tuple[str, str | None]] = [(name, None) for name in names]
    if n <= MIXED_ELECTRODES:
        named += [(drive, measure) for drive in names for measure in names]
    seen: set[int] = set()
    for drive, measure in named:
        try:
            made = pattern(n, drive, measure)
        except ProtocolError:  # no row is left
            continue
        if made.n_rows == n_rows and made.hash not in seen:
            seen.add(made.hash)
            yield made


def pattern_name(protocol: Protocol) -> str:
    """Return the name of the protocol's pattern: "skip-3", or "skip-3/adjacent" for drive and
    measurement, or a description of its table if no pattern has these rows."""
    n, rows = protocol.n_electrodes, protocol.drive_measure.astype(np.int64)
    spans = [set(((rows[:, k + 1] - rows[:, k]) % n).tolist()) for k in (0, 2)]
    names = [_name_of(span.pop(), n) if len(span) == 1 else None for span in spans]
    if names[0] is not None and names[1] is not None:
        name = names[0] if names[1] == _measured_with(names[0]) else f"{names[0]}/{names[1]}"
        try:
            made = pattern(n, names[0], names[1])
        except ProtocolError:
            return f"a table of {len(rows)} rows"
        if np.array_equal(made.drive_measure, rows):
            return name
        unique = made.drive_measure[made.reciprocal_pairs().first]
        if np.array_equal(unique, rows):
            return f"{name}, one row of each reciprocal pair"
    return f"a table of {len(rows)} rows"


def independent_rows(protocol: Protocol) -> int:
    """Return how many rows no linear combination of the others replaces, whatever the skin.

    The voltages of a reciprocal skin are a symmetric form of drive and measuring pair, so this is
    the rank of the symmetrised products of the two. Above ``MAX_GRAM_ROWS`` folded rows it is not
    computed, and the bound min(folded rows, n (n - 1) / 2) is returned.
    """
    n, first = protocol.n_electrodes, protocol.reciprocal_pairs().first
    most = min(len(first), n * (n - 1) // 2)
    if len(first) > MAX_GRAM_ROWS:
        return most
    rows, k = protocol.drive_measure[first].astype(np.int64), np.arange(len(first))
    pairs = np.zeros((2, len(first), n))
    for one, columns in zip(pairs, (rows[:, :2], rows[:, 2:]), strict=True):
        one[k, columns[:, 0]], one[k, columns[:, 1]] = 1.0, -1.0
    drive, measure = pairs
    crossed = drive @ measure.T
    gram = (drive @ drive.T) * (measure @ measure.T) + crossed * crossed.T
    values = np.linalg.eigvalsh(gram)
    return min(most, int((values > 1e-9 * values[-1]).sum()))


def require_independent(protocol: Protocol, rank: int) -> int:
    """Return ``independent_rows`` if they are enough for ``rank`` (0: for one touch).

    Raises:
        ProtocolError: they are not; the error says why, and which patterns have more.
    """
    independent = independent_rows(protocol)
    if independent >= max(rank, MIN_INDEPENDENT):
        return independent
    folded, n = len(protocol.reciprocal_pairs().first), protocol.n_electrodes
    asked = f"rank {rank} is more than" if rank > independent else "one touch needs more than"
    full = [
        name
        for name in pattern_names(n)
        if name != "opposite" and gcd(_span(name, n), n) == 1 and n * (n - 3) // 2 > independent
    ]
    remedy = [f"a rank up to {independent}"] if independent >= MIN_INDEPENDENT else []
    remedy += [f"{', '.join(full)} ({n * (n - 3) // 2})"] if full else ["more electrodes"]
    raise ProtocolError(
        f"protocol: {asked} the {independent} independent rows of {pattern_name(protocol)} on {n}"
        f" electrodes; {protocol.n_rows} rows are {folded} when reciprocal ones are folded, and"
        f" {independent} when sums of others are left out; use {' or '.join(remedy)}"
    )


def table(n: int, rows: npt.ArrayLike, current_a: float = DEFAULT_CURRENT_A) -> Protocol:
    """Return a protocol with the given ``rows`` (m, 4) [I+, I-, V+, V-].

    Raises:
        ProtocolError: the rows are not valid (``Protocol``), or more than two hold the same
            voltage.
    """
    try:
        given = np.asarray(rows)
    except ValueError:
        raise ProtocolError(
            "protocol: the table's rows differ in length; each must be [I+, I-, V+, V-]"
        ) from None
    protocol = Protocol(n, given, current_a)
    protocol.reciprocal_pairs()
    return protocol


def in_order(protocol: Protocol, order: str | Iterable[int]) -> Protocol:
    """Return ``protocol`` with its drives measured in ``order``: either their numbers, or "by K",
    which measures drive K j modulo their count at place j.

    Raises:
        ProtocolError: the order does not have each drive exactly once.
    """
    if isinstance(order, str):
        drives = len(protocol.drive_starts)
        word, _, number = order.partition(" ")
        step = int(number) if word == "by" and number.isdecimal() and number.isascii() else 0
        if step < 1 or gcd(step, drives) != 1:
            raise ProtocolError(
                f'protocol: order = "{order}" does not have each of {drives} drives once; use "by'
                ' K", K a whole number without a divisor that they have, or a list of all drives'
            )
        order = [step * k % drives for k in range(drives)]
    return replace(protocol, drive_order=tuple(order))


def protocol_from_table(toml_table: Mapping[str, Any], n_electrodes: int, where: str) -> Protocol:
    """Return the protocol in a parsed TOML table; ``where`` names its source in errors. An empty
    table gives the adjacent protocol."""
    check_keys(toml_table, ("kind", "measure", "skip", "table", "current_a", "order"), where)
    kind, measure = (_pattern_word(toml_table, key, where) for key in ("kind", "measure"))
    kind = kind or "adjacent"
    for key in ("skip", "table"):
        if key in toml_table and kind != key:
            raise ConfigError(f'{where}: {key} goes with kind = "{key}", but kind is "{kind}"')
    if measure is not None and kind == "table":
        raise ConfigError(f'{where}: measure goes with a pattern, but kind is "table"')
    current_a = number(
        toml_table, "current_a", DEFAULT_CURRENT_A, where, low=0, high=1, open_low=True
    )
    try:
        if kind == "table":
            made = table(n_electrodes, _rows_of_table(toml_table, where), current_a)
        else:
            if kind == "skip":
                kind = f"skip-{integer(toml_table, 'skip', None, where, low=0, high=MAX_COUNT)}"
            made = pattern(n_electrodes, kind, measure, current_a)
        order = toml_table.get("order")
        return made if order is None else in_order(made, _checked_order(order, where))
    except ProtocolError as error:
        raise ProtocolError(f"{where}: {error}") from None


def _pattern_word(toml_table: Mapping[str, Any], key: str, where: str) -> str | None:
    word = toml_table.get(key)
    if isinstance(word, str) and SKIP.fullmatch(word):
        return word
    names = KINDS if key == "kind" else KINDS[:3]
    return choice(toml_table, key, None, names, where) if word is not None else None


def _checked_order(order: Any, where: str) -> str | list[int]:
    if isinstance(order, str) or (
        isinstance(order, list) and order and all(type(one) is int for one in order)
    ):
        return order
    raise ConfigError(f'{where}: order must be "by 7" or a list of all drives, not {order!r}')


def protocol_to_table(protocol: Protocol) -> dict[str, Any]:
    """Return a table from which ``protocol_from_table`` makes a protocol with the same rows; it
    uses the name of a kind if one fits."""
    rest: dict[str, Any] = {"current_a": protocol.current_a}
    if protocol.drive_order:
        rest["order"] = list(protocol.drive_order)
    for name, made in _named(protocol.n_electrodes):
        if np.array_equal(made.drive_measure, protocol.drive_measure):
            return {**name, **rest}
    return {"kind": "table", "table": protocol.drive_measure.tolist(), **rest}


def _named(n: int) -> Iterable[tuple[dict[str, Any], Protocol]]:
    yield {"kind": "adjacent"}, adjacent(n)
    if n % 2 == 0 and n >= 6:
        yield {"kind": "opposite"}, opposite(n)
    for skipped in range(1, (n - 1) // 2):
        yield {"kind": "skip", "skip": skipped}, skip(n, skipped)


def _measured_with(drive: str) -> str:
    """Return the pattern with which drives are measured if none is named."""
    return "adjacent" if drive == "opposite" else drive


def _span(name: str, n: int) -> int:
    """Return by how many electrodes the second of a pair is further than the first."""
    if name == "opposite":
        if n % 2 or n < 6:
            raise ProtocolError(
                f"protocol: opposite pairs need an even number of at least 6 electrodes, not {n}"
            )
        return n // 2
    word = SKIP.fullmatch("skip-0" if name == "adjacent" else name)
    if word is None:
        raise ProtocolError(f'protocol: pattern "{name}" is not known; use {PATTERNS_HELP}')
    skipped = int(word[1])
    if skipped < 0 or 2 * (1 + skipped) >= n:
        opposite = "; pairs of half the electrodes are opposite" if 2 * (1 + skipped) == n else ""
        raise ProtocolError(
            f"protocol: skip-{skipped} is out of range for {n} electrodes; use skip-0 (adjacent) to"
            f" skip-{(n - 1) // 2 - 1}{opposite}"
        )
    return 1 + skipped


def _name_of(span: int, n: int) -> str | None:
    if 2 * span >= n:
        return "opposite" if 2 * span == n and n >= 6 else None
    return "adjacent" if span == 1 else f"skip-{span - 1}"


def _drive_and_measure(n: int, drive_step: int, measure_step: int, pairs: int) -> TableArray:
    k = np.arange(pairs)
    drive = np.column_stack([k, (k + drive_step) % n])
    measure = np.column_stack([k, (k + measure_step) % n])
    rows = np.column_stack([np.repeat(drive, pairs, axis=0), np.tile(measure, (pairs, 1))])
    apart = (rows[:, :2, None] != rows[:, None, 2:]).all(axis=(1, 2))
    return np.asarray(rows[apart], dtype=np.uint8)


def _rows_of_table(toml_table: Mapping[str, Any], where: str) -> list[list[int]]:
    rows = toml_table.get("table")
    if not isinstance(rows, list):
        raise ConfigError(f'{where}: kind = "table" needs table = [[I+, I-, V+, V-], ...]')
    for k, row in enumerate(rows):
        if not (isinstance(row, list) and len(row) == 4 and {*map(type, row)} == {int}):
            raise ConfigError(
                f"{where}: table row {k} (from 0) must be four whole numbers, not {row!r}"
            )
    return rows


def _checked_rows(rows: npt.ArrayLike, n: int) -> TableArray:
    given = np.asarray(rows)
    if given.ndim != 2 or given.shape[1:] != (4,) or not 1 <= len(given) <= MAX_ROWS:
        raise ProtocolError(
            f"protocol: the table's shape is {given.shape}; it must be (m, 4), m from 1 to"
            f" {MAX_ROWS}, [I+, I-, V+, V-]"
        )
    if given.dtype.kind not in "iu":
        raise ProtocolError(
            "protocol: the table must hold whole numbers, electrodes counted from 0"
        )
    outside = np.flatnonzero(((given < 0) | (given >= n)).any(axis=1))
    if len(outside):
        row = int(outside[0])
        raise ProtocolError(
            f"protocol: row {row} (from 0) is {given[row].tolist()}, but the electrodes are 0 to"
            f" {n - 1}; count from 0"
        )
    same = np.flatnonzero((given[:, 0] == given[:, 1]) | (given[:, 2] == given[:, 3]))
    if len(same):
        row = int(same[0])
        raise ProtocolError(
            f"protocol: row {row} (from 0) is {given[row].tolist()}: a pair needs two different"
            " electrodes"
        )
    checked = np.ascontiguousarray(given, dtype=np.uint8).copy()
    checked.flags.writeable = False
    return checked
