"""The numpy reference of the row gains in csrc/src/frame/reference.c: what makes the reference the
model's own, row by row."""

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.model.model import Model
from eitskin_reference.constants_table import MAX_DISTANCE, MAX_RECIPROCITY, MAX_ROW_GAIN


def row_gains(
    model: Model, usable: BoolArray, v0: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """What each row's data are multiplied by (m,), from a reference ``v0`` (m,) in the model's
    volts and where it is ``usable`` (m,); how far each fold is from the model, log(v_ref / v0)
    (k,), NaN where it has none; and whether that is the instrument's doing and not the skin's: it
    is too far, or too far from reciprocity. Then the gains are all 1."""
    fold, expected = model.fold, np.full(len(v0), np.nan)
    paired = fold.second >= 0
    expected[fold.first] = model.v_ref_v
    expected[fold.second[paired]] = (fold.sign * model.v_ref_v)[paired]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = expected / v0
    told = usable & (ratio > 0) & np.isfinite(ratio)
    gains = np.where(told, np.clip(np.where(told, ratio, 1), 1 / MAX_ROW_GAIN, MAX_ROW_GAIN), 1.0)
    first, second = usable[fold.first], paired & usable[fold.second]
    logs = np.log(np.where(first, gains[fold.first], gains[fold.second]))
    logs[~(first | second)] = np.nan
    both = first & second
    apart = (v0[fold.first] - fold.sign * v0[fold.second])[both]
    folded = np.where(first, v0[fold.first], 0) + np.where(second, fold.sign * v0[fold.second], 0)
    mean = (folded / np.maximum(first.astype(int) + second, 1))[first | second]
    distance, size = np.sqrt(np.nanmean(logs**2)), np.sqrt(np.mean(mean**2))
    reciprocity = np.sqrt(np.mean(apart**2)) / size if both.any() else 0.0
    fits = distance <= MAX_DISTANCE and reciprocity <= MAX_RECIPROCITY
    return gains if fits else np.ones_like(gains), logs, not fits
