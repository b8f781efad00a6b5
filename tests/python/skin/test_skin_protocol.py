"""Protocols: their rows, reciprocity found from any table, and a hash that must never change."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eitskin.errors import ConfigError, ProtocolError
from eitskin.skin.protocol import (
    Protocol,
    adjacent,
    in_order,
    opposite,
    protocol_from_table,
    protocol_to_table,
    skip,
    table,
)


@pytest.mark.parametrize(("n", "rows"), [(4, 4), (8, 40), (16, 208), (32, 928)])
def test_adjacent_rows(n, rows):
    protocol = adjacent(n)
    assert protocol.n_rows == rows == n * (n - 3)
    drive, measure = protocol.drive_measure[:, :2], protocol.drive_measure[:, 2:]
    assert ((drive[:, 1] - drive[:, 0].astype(int)) % n == 1).all()
    assert ((measure[:, 1] - measure[:, 0].astype(int)) % n == 1).all()
    assert (drive[:, :, None] != measure[:, None, :]).all()
    assert (np.diff(drive[:, 0].astype(int)) >= 0).all()
    reciprocity = protocol.reciprocal_pairs()
    assert len(reciprocity.first) == rows // 2
    assert (reciprocity.second >= 0).all()
    assert sorted([*reciprocity.first, *reciprocity.second]) == list(range(rows))


def test_adjacent_order_is_fixed():
    rows = adjacent(16).drive_measure.tolist()
    assert rows[:2] == [[0, 1, 2, 3], [0, 1, 3, 4]]
    assert rows[12] == [0, 1, 14, 15]
    assert rows[13] == [1, 2, 3, 4]
    assert rows[25] == [1, 2, 15, 0]
    assert rows[26:28] == [[2, 3, 0, 1], [2, 3, 4, 5]]


def test_adjacent_is_kit4s_table(shared_data):
    with np.load(shared_data / "kit4_dev.npz") as data:
        assert np.array_equal(adjacent(16).drive_measure, data["drive_measure"])


def test_opposite_and_skip():
    across, third = opposite(16), skip(16, 2)
    assert across.n_rows == 16 * 12 and across.drive_measure[0].tolist() == [0, 8, 1, 2]
    folded = across.reciprocal_pairs()
    assert len(folded.first) == 96 and (folded.sign == -1).all()
    assert np.array_equal(skip(16, 0).drive_measure, adjacent(16).drive_measure)
    assert third.drive_measure[0].tolist() == [0, 3, 1, 4] and third.n_rows == 208
    assert len(third.reciprocal_pairs().first) == 104


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: adjacent(3), "out of range"),
        (lambda: adjacent(256), "out of range"),
        (lambda: opposite(15), "even number"),
        (lambda: opposite(4), "even number"),
        (lambda: skip(16, 7), "skip-6; pairs of half"),
        (lambda: skip(16, -1), "to skip-6"),
        (lambda: table(16, []), "shape"),
        (lambda: table(16, [[0, 1, 2]]), "shape"),
        (lambda: table(16, [[0, 1, 2, 3], [0, 1]]), "rows differ in length"),
        (lambda: table(16, [[0, 1, 2, 3], [1, 2, 3, 16]]),
         r"row 1 \(from 0\).*0 to 15; count from 0"),
        (lambda: table(16, [[0, 1, 2, -1]]), r"row 0 \(from 0\)"),
        (lambda: table(16, [[0, 1, 2, 300]]), r"row 0 \(from 0\)"),
        (lambda: table(16, [[0, 0, 2, 3]]), "two different electrodes"),
        (lambda: table(16, [[0, 1, 3, 3]]), "two different electrodes"),
        (lambda: table(16, [[0.5, 1, 2, 3]]), "whole numbers"),
        (lambda: table(16, [[0, 1, 2, 3], [2, 3, 0, 1], [1, 0, 2, 3]]), r"rows 0, 1, 2 \(from 0\)"),
        (lambda: Protocol(16, adjacent(16).drive_measure, 0.0), "current_a"),
        (lambda: Protocol(16, adjacent(16).drive_measure, float("nan")), "current_a"),
        (lambda: in_order(adjacent(16), "by 4"), 'order = "by 4" does not have each of 16 drives'),
        (lambda: in_order(adjacent(16), "by x"), 'use "by K"'),
        (lambda: in_order(adjacent(16), [0, 1, 2]), "each drive once, 0 to 15"),
        (lambda: in_order(adjacent(4), [0, 1, 2, 2]), "each drive once, 0 to 3"),
        (lambda: protocol_from_table({"order": "by 2"}, 8, "x"), "x: protocol: order"),
    ],
)  # fmt: skip
def test_refused(make, message):
    with pytest.raises(ProtocolError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_rows_are_read_only_and_a_copy():
    rows = np.array([[0, 1, 2, 3]])
    protocol = table(4, rows)
    rows[0, 0] = 3
    assert protocol.drive_measure.tolist() == [[0, 1, 2, 3]]
    assert protocol.drive_measure.dtype == np.uint8
    with pytest.raises(ValueError, match="read-only"):
        protocol.drive_measure[0, 0] = 1


def test_hash_is_fnv_1a_of_the_documented_bytes():
    """The firmware computes the same; these values must never change."""
    value = 0xCBF29CE484222325
    for byte in [4, 0, 1, 0, 0, 1, 2, 3]:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    assert table(4, [[0, 1, 2, 3]]).hash == value
    assert adjacent(16).hash == 0x73AA164087184D25
    assert adjacent(16, current_a=5e-3).hash == adjacent(16).hash
    assert adjacent(16).hash != skip(16, 1).hash != opposite(16).hash


def test_reciprocity_with_flips():
    rows = [
        [0, 1, 4, 5], [5, 4, 0, 1], [7, 6, 2, 3], [2, 3, 7, 6], [8, 9, 10, 11], [1, 2, 6, 5],
        [2, 1, 6, 5],
    ]  # fmt: skip
    pairs = table(16, rows).reciprocal_pairs()
    assert pairs.first.tolist() == [0, 2, 4, 5]
    assert pairs.second.tolist() == [1, 3, -1, 6]
    assert pairs.sign.tolist() == [-1, 1, 1, -1]


@settings(max_examples=50, deadline=None)
@given(st.integers(5, 20), st.integers(0, 2**32 - 1))
def test_reciprocity_of_shuffled_and_flipped_tables(n, seed):
    """Fold an adjacent table after its rows were shuffled and its pairs flipped and swapped at
    random."""
    rng = np.random.default_rng(seed)
    rows = adjacent(n).drive_measure.astype(int)
    rows = rows[rng.permutation(len(rows))]
    for pair in (slice(0, 2), slice(2, 4)):
        flip = rng.random(len(rows)) < 0.5
        rows[flip, pair] = rows[flip, pair][:, ::-1]
    protocol = table(n, rows)
    # A made-up reciprocal quantity: symmetric in the pairs and odd in each.
    potential = rng.normal(size=(n, n))
    potential = potential + potential.T
    a, b, c, d = protocol.drive_measure.T
    voltage = potential[c, a] - potential[d, a] - potential[c, b] + potential[d, b]
    pairs = protocol.reciprocal_pairs()
    assert len(pairs.first) == len(rows) // 2
    np.testing.assert_allclose(voltage[pairs.first], pairs.sign * voltage[pairs.second], atol=1e-12)
    assert sorted([*pairs.first, *pairs.second]) == list(range(len(rows)))


@pytest.mark.parametrize(
    ("protocol", "kind"),
    [
        (adjacent(16), {"kind": "adjacent"}),
        (adjacent(5, 2e-3), {"kind": "adjacent"}),
        (opposite(8), {"kind": "opposite"}),
        (skip(16, 3), {"kind": "skip", "skip": 3}),
        (in_order(adjacent(8), "by 3"), {"kind": "adjacent", "order": [0, 3, 6, 1, 4, 7, 2, 5]}),
        (table(6, [[0, 1, 2, 3], [3, 2, 5, 4]]),
         {"kind": "table", "table": [[0, 1, 2, 3], [3, 2, 5, 4]]}),
    ],
)  # fmt: skip
def test_table_round_trip(protocol, kind):
    made = protocol_to_table(protocol)
    assert made == {**kind, "current_a": protocol.current_a}
    again = protocol_from_table(made, protocol.n_electrodes, "here")
    assert again.hash == protocol.hash
    assert np.array_equal(again.drive_measure, protocol.drive_measure)
    assert again.current_a == protocol.current_a
    assert again.drive_order == protocol.drive_order


def test_an_order_changes_when_a_row_is_measured_and_nothing_else():
    plain = adjacent(16)
    by_7 = protocol_from_table({"order": "by 7"}, 16, "x")
    assert by_7.drive_order[:4] == (0, 7, 14, 5) and plain.drive_order == ()
    assert by_7.scan_rows[12:15].tolist() == [12, 91, 92]
    assert by_7.scan_places[91:93].tolist() == [13, 14]
    assert np.array_equal(by_7.scan_rows[by_7.scan_places], np.arange(208))
    assert by_7.hash == plain.hash and np.array_equal(by_7.drive_measure, plain.drive_measure)
    assert in_order(plain, range(16)).drive_order == ()
    lone = in_order(table(6, [[0, 1, 2, 3], [3, 2, 5, 4], [3, 2, 0, 1]]), [1, 0])
    assert lone.scan_rows.tolist() == [1, 2, 0]
    for wrong in (7, [], ["a"], [True]):
        with pytest.raises(ConfigError, match='order must be "by 7" or a list'):
            protocol_from_table({"order": wrong}, 16, "x")
