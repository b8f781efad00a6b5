"""Storage: how far from the truth each type may be, and what pads it."""

import numpy as np
import pytest

from eitskin.model.storage import STORAGES, store, stride_for

GENERATOR = np.random.default_rng(22)
MATRIX = GENERATOR.normal(size=(13, 40)) * np.geomspace(1, 1e-3, 40)
MATRIX[:, 17] = 0.0


@pytest.mark.parametrize(
    ("rank", "stride"), [(1, 8), (7, 8), (8, 8), (9, 16), (64, 64), (104, 104)]
)
def test_stride_is_the_rank_rounded_up_to_eight(rank, stride):
    assert stride_for(rank) == stride


@pytest.mark.parametrize("storage", STORAGES)
def test_columns_are_padded_with_zeros(storage):
    stored = store(MATRIX, storage)
    assert stored.columns.shape == (40, 16)
    assert not stored.columns[:, 13:].any()
    assert stored.decode(13).shape == MATRIX.shape


@pytest.mark.parametrize("storage", ["f32", "f16"])
def test_floats_are_the_nearest(storage):
    """f16: within half a step."""
    stored = store(MATRIX, storage)
    step = np.maximum(2.0 ** (np.floor(np.log2(np.maximum(np.abs(MATRIX), 1e-30))) - 10), 2.0**-24)
    assert stored.scale is None
    assert (np.abs(stored.decode(13) - MATRIX) <= 0.5 * step).all()
    if storage == "f32":
        assert (stored.decode(13) == MATRIX.astype(np.float32)).all()


@pytest.mark.parametrize(("storage", "top"), [("i16", 32767), ("i8", 127)])
def test_integers_are_within_half_a_step_of_their_column(storage, top):
    stored = store(MATRIX, storage)
    assert stored.scale is not None and stored.scale.shape == (40,)
    peak = np.abs(MATRIX).max(axis=0)
    used = peak > 0
    assert stored.scale[used] == pytest.approx(peak[used] / top, rel=1e-7)
    assert (np.abs(stored.columns).max(axis=1)[used] == top).all()
    error = np.abs(stored.decode(13) - MATRIX)
    assert (error <= 0.5 * stored.scale * (1 + 1e-6)).all()
    assert error.max() > 0.4 * stored.scale[used].max()
    assert stored.scale[17] == 1 and not stored.decode(13)[:, 17].any()  # a column of zeros
