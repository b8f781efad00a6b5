"""Patterns by name: their pairs, how many rows are independent, and what is refused."""

import numpy as np
import pytest

from eitskin.errors import ConfigError, ProtocolError
from eitskin.skin.protocol import (
    adjacent,
    in_order,
    independent_rows,
    opposite,
    pattern,
    pattern_name,
    pattern_names,
    patterns_of_length,
    protocol_from_table,
    require_independent,
    skip,
    table,
)


def test_skip_3_drives_and_measures_pairs_five_electrodes_long():
    rows = pattern(16, "skip-3").drive_measure.astype(int)
    assert rows[0].tolist() == [0, 4, 1, 5] and len(rows) == 208
    assert set(((rows[:, 1] - rows[:, 0]) % 16).tolist()) == {4}
    assert set(((rows[:, 3] - rows[:, 2]) % 16).tolist()) == {4}
    assert all(len(set(row)) == 4 for row in rows.tolist())
    mixed = pattern(16, "skip-3", "adjacent").drive_measure.astype(int)
    assert mixed[0].tolist() == [0, 4, 1, 2] and len(mixed) == 192


@pytest.mark.parametrize("n", [5, 6, 8, 16])
def test_each_pair_of_patterns_keeps_its_name(n):
    for drive in pattern_names(n):
        for measure in pattern_names(n):
            try:
                made = pattern(n, drive, measure)
            except ProtocolError as error:
                assert "leave no" in str(error)
                continue
            usual = "adjacent" if drive == "opposite" else drive
            assert pattern_name(made) == (drive if measure == usual else f"{drive}/{measure}")
            made.reciprocal_pairs()  # at most two rows hold one voltage


def test_the_patterns_of_a_length_are_each_made_once():
    made = list(patterns_of_length(16, 208))
    names = [pattern_name(one) for one in made]
    assert names == ["adjacent", "skip-1", "skip-2", "skip-3", "skip-4", "skip-5", "skip-6"]
    both = pattern(16, "opposite", "opposite")  # of one length with no other pattern
    assert [one.hash for one in patterns_of_length(16, both.n_rows)] == [both.hash]
    assert "skip-1/adjacent" in map(pattern_name, patterns_of_length(16, 192))
    assert len(list(patterns_of_length(64, adjacent(64).n_rows))) == 31  # no mixed ones
    assert not list(patterns_of_length(5, 3))


def test_what_is_no_pattern_is_named_a_table():
    whole = adjacent(16)
    half = table(16, whole.drive_measure[whole.reciprocal_pairs().first])
    assert pattern_name(half) == "adjacent, one row of each reciprocal pair"
    assert pattern_name(table(16, whole.drive_measure[:40])) == "a table of 40 rows"
    assert pattern_name(table(4, [[0, 1, 2, 3], [3, 2, 0, 1]])) == "a table of 2 rows"
    assert pattern_name(in_order(skip(16, 3), "by 7")) == "skip-3"


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("adjacent", 104), ("skip-1", 89), ("skip-2", 104), ("skip-3", 62), ("skip-4", 104),
        ("opposite", 76),
    ],
)  # fmt: skip
def test_rows_are_as_independent_as_the_voltages_of_random_networks(name, count):
    """The same count from the voltages themselves: symmetric matrices with random entries."""
    made, rng = pattern(16, name), np.random.default_rng(1)
    drawn = rng.normal(size=(150, 16, 16))
    transfer = drawn + drawn.transpose(0, 2, 1)
    a, b, c, d = made.drive_measure.astype(int).T
    volts = transfer[:, c, a] - transfer[:, d, a] - transfer[:, c, b] + transfer[:, d, b]
    assert independent_rows(made) == np.linalg.matrix_rank(volts) == count


def test_too_few_independent_rows_are_refused():
    assert require_independent(skip(16, 3), 62) == 62
    with pytest.raises(ProtocolError, match=r"rank 63 .* 62 independent rows of skip-3 .*skip-2"):
        require_independent(skip(16, 3), 63)
    with pytest.raises(ProtocolError, match="one touch needs more than the 2 independent"):
        require_independent(adjacent(4), 0)


@pytest.mark.parametrize(
    ("drive", "measure", "message"),
    [
        ("skip-7", None, "skip-7 is out of range for 16 electrodes; .*half .* opposite"),
        ("adjacent", "skip-9", "skip-9 is out of range"),
        ("skip", None, '"skip" is not known; use adjacent, skip-1'),
        ("adjecent", None, '"adjecent" is not known'),
    ],
)
def test_patterns_that_do_not_exist_are_refused(drive, measure, message):
    with pytest.raises(ProtocolError, match=message):
        pattern(16, drive, measure)
    with pytest.raises(ProtocolError, match="even number"):
        pattern(15, "opposite")


def test_a_description_names_patterns():
    def read(**keys: object) -> str:
        return pattern_name(protocol_from_table(keys, 16, "here"))

    assert read(kind="skip-3") == read(kind="skip", skip=3) == "skip-3"
    assert read(kind="skip-3", measure="adjacent") == "skip-3/adjacent"
    assert read(kind="opposite", measure="opposite") == "opposite/opposite"
    made = protocol_from_table({"kind": "opposite", "order": "by 7"}, 16, "here")
    assert made.hash == opposite(16).hash and made.drive_order[:3] == (0, 7, 14)
    for keys, error, message in (
        ({"kind": "skip-9"}, ProtocolError, "here: .*skip-9 is out of range"),
        ({"kind": "skipp"}, ConfigError, "kind = 'skipp' is not known"),
        ({"measure": "across"}, ConfigError, "measure = 'across' is not known"),
        ({"kind": "table", "measure": "adjacent"}, ConfigError, "measure goes with a pattern"),
    ):
        with pytest.raises(error, match=message):
            read(**keys)
