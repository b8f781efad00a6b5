"""Outliers in reference frames, in numpy: the rules of csrc/src/diagnostics/reference_outliers.c,
written for reading."""

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.skin.protocol import Reciprocity
from eitskin_reference.constants_table import (
    CHANGED_AS_MUCH,
    OUTLIER_MAX,
    OWN_MIN,
    PAIRED,
    PAIRED_MIN,
    UNPAIRED,
    UNPAIRED_MIN,
)
from eitskin_reference.diagnostics import robust


def odd_rows(
    newer: FloatArray, older: FloatArray, fold: Reciprocity, used: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Folds (k,) whose rows do not agree on how ``newer`` (m,) differs from ``older``, none where
    they are too many to be outliers; and the rows (m,) of those that changed most."""
    change = np.where(used, newer - older, 0.0)
    has_second = fold.second >= 0
    both = has_second & used[fold.first] & used[fold.second]
    first, second = change[fold.first], np.where(has_second, fold.sign * change[fold.second], 0.0)
    paired = np.where(both, np.abs(first - second), 0.0)
    greater = np.maximum(np.abs(first), np.abs(second))
    largest = float(np.abs(older[used]).max(initial=0.0))
    rows = np.zeros(len(newer), dtype=np.bool_)
    if paired.any():
        off, limit = paired, max(PAIRED * robust(paired), PAIRED_MIN * largest)
    else:
        off, limit = greater, max(UNPAIRED * robust(greater), UNPAIRED_MIN * largest)
    size = np.where(used, np.abs(older), 0.0)
    own = np.maximum(size[fold.first], np.where(has_second, size[fold.second], 0.0))
    odd = (off > limit) & (off > OWN_MIN * own)
    if odd.sum() > OUTLIER_MAX:
        odd[:] = False
    rows[
        fold.first[odd & (np.abs(first) > 0) & (np.abs(first) >= CHANGED_AS_MUCH * np.abs(second))]
    ] = True
    rows[
        fold.second[
            odd & (np.abs(second) > 0) & (np.abs(second) >= CHANGED_AS_MUCH * np.abs(first))
        ]
    ] = True
    return odd, rows


def clean(frames: FloatArray, fold: Reciprocity, used: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Quiet ``frames`` (k, m) with readings that nothing else bears out replaced, and which (k, m):
    one of the first two by the other where a third tells, later ones by the mean so far."""
    done, left = frames.copy(), np.zeros(frames.shape, dtype=np.bool_)
    (between, rows), (first, _), (second, _) = (
        odd_rows(frames[new], frames[old], fold, used) for new, old in ((1, 0), (2, 0), (2, 1))
    )
    for k, odd in ((0, between & first & ~second), (1, between & second & ~first)):
        mine = np.zeros(len(rows), dtype=np.bool_)
        mine[fold.first[odd]] = True
        mine[fold.second[odd & (fold.second >= 0)]] = True
        left[k] = mine & rows
        done[k, left[k]] = frames[1 - k, left[k]]
    for k in range(2, len(frames)):
        so_far = done[:k].mean(axis=0)
        left[k] = odd_rows(frames[k], so_far, fold, used)[1]
        done[k, left[k]] = so_far[left[k]]
    return done, left
