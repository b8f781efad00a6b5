"""Channel orders: counts, permutations, and matching rows up to direction and reciprocity."""

import numpy as np
import pytest

from eitskin.errors import FrameError, UsageError
from eitskin.frames.orders import (
    ORDERS,
    electrode_map,
    match_rows,
    relabel,
    source_table,
    swap_map,
    touching,
)
from eitskin.skin.protocol import adjacent, opposite, skip, table

PROTOCOLS = (adjacent(16), opposite(16), skip(16, 2), adjacent(8))


@pytest.mark.parametrize("protocol", PROTOCOLS, ids=("adjacent", "opposite", "skip2", "adjacent8"))
def test_every_order_holds_every_row_of_the_protocol(protocol):
    n = protocol.n_electrodes
    for order in ORDERS:
        count = n * n if order.endswith("-all") else protocol.n_rows
        rows = source_table(order, protocol)
        assert len(rows) == count
        match = match_rows(rows, protocol.drive_measure)
        assert np.array_equal(rows[match.index] * 1, protocol.drive_measure)
        assert (match.sign == 1).all()


def test_rotating_order_starts_behind_the_drive():
    rows = source_table("rotating", adjacent(16)).reshape(16, 13, 4)
    for drive in range(16):
        assert rows[drive, :, 2].tolist() == [(drive + 2 + k) % 16 for k in range(13)]
        assert rows[drive, :, 3].tolist() == [(drive + 3 + k) % 16 for k in range(13)]


def test_rows_match_turned_and_reciprocal_with_their_sign():
    source = np.array([[1, 0, 2, 3], [4, 5, 0, 1], [7, 6, 1, 0]])
    wanted = np.array([[0, 1, 2, 3], [0, 1, 4, 5], [0, 1, 6, 7], [1, 0, 3, 2]])
    match = match_rows(source, wanted)
    assert match.index.tolist() == [0, 1, 2, 0]
    assert match.sign.tolist() == [-1, 1, 1, -1]
    with pytest.raises(FrameError, match=r"1 of the protocol's 1 rows .*\[0, 2, 4, 6\]"):
        match_rows(source, np.array([[0, 2, 4, 6]]))


def test_a_row_itself_is_preferred_to_its_likes():
    both = np.array([[2, 3, 0, 1], [1, 0, 3, 2], [0, 1, 2, 3]])
    assert match_rows(both, both).index.tolist() == [0, 1, 2]


def test_electrode_maps():
    assert electrode_map(8, 3).tolist() == [3, 4, 5, 6, 7, 0, 1, 2]
    assert electrode_map(8, 3, mirror=True).tolist() == [3, 2, 1, 0, 7, 6, 5, 4]
    assert swap_map(6, [(1, 4)]).tolist() == [0, 4, 2, 3, 1, 5]
    assert swap_map(6, [(1, 4), (4, 5)]).tolist() == [0, 5, 2, 3, 1, 4]
    assert relabel(np.array([[0, 1, 2, 3]]), electrode_map(8, 3, True)).tolist() == [[3, 2, 1, 0]]
    assert touching(np.array([[0, 1, 2, 3], [4, 5, 6, 7]]), [3, 9]).tolist() == [True, False]
    for pair in ((1, 1), (0, 6), (-1, 2)):
        with pytest.raises(UsageError, match="two different electrodes of 0 to 5"):
            swap_map(6, [pair])


def test_unknown_orders_and_uneven_tables_are_refused():
    with pytest.raises(UsageError, match="'spiral' is not known"):
        source_table("spiral", adjacent(8))
    with pytest.raises(UsageError, match="table file"):
        source_table("fixed-all", table(8, [[0, 1, 2, 3], [0, 1, 3, 5]]))
