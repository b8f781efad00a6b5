"""The reference: mean and noise of untouched frames, how it fits the model, and readings that are
left out of it. docs/design/oracle.md, "Reference", has the formulas."""

from dataclasses import replace

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core import constants_table as limits
from eitskin.errors import FrameError
from eitskin.model.model import Model
from eitskin.oracle.folding import Reference, fold_means

DEAD = "all voltages are zero; is the skin driven and connected?"


def robust(values: FloatArray) -> float:
    """The deviation that the upper median of ``values`` >= 0 suggests where they are normal."""
    return limits.ROBUST * float(np.sort(values)[len(values) // 2]) if len(values) else 0.0


def noise_of(frames: FloatArray) -> float:
    """The rms over rows of the standard deviation of ``frames`` (k, rows), V."""
    return float(np.sqrt(frames.var(axis=0, ddof=1).mean()))


def fitted(model: Model, v0: FloatArray, masked: BoolArray, row_gains: bool) -> Reference:
    """A reference ``v0`` (m,) scaled to the model by the norm of its folded rows, and by its row
    gains where they are wanted and the skin may be what differs."""
    folded, _, first, second = fold_means(model, v0, ~masked, model.fold.sign)
    known = first | second
    v, expected = folded[known], model.v_ref_v.astype(float)[known]
    if not np.abs(v).max(initial=0.0) > 0:
        raise FrameError(f"reference frame: {DEAD}")
    correlation = float(v @ expected / (np.linalg.norm(v) * np.linalg.norm(expected)))
    gain = float(np.linalg.norm(expected) / np.linalg.norm(v)) * (-1 if correlation < 0 else 1)
    rms_v = float(np.sqrt(np.mean(v**2)))
    usable = np.where(masked, np.nan, v0)
    plain = Reference(
        usable, rms_v, gain, correlation, np.ones(len(v0)), np.zeros(len(known)), False, usable
    )
    return with_row_gains(model, plain, row_gains)


def with_row_gains(model: Model, ref: Reference, wanted: bool) -> Reference:
    """Row gains: each row's v_ref / (gain v0), within a factor of MAX_ROW_GAIN; 1 if signs differ.
    They stay 1 if the reference is further from the model, or from its own reciprocals, than a skin
    makes it."""
    fold, expected = model.fold, np.full(len(ref.v0), np.nan)
    paired = fold.second >= 0
    expected[fold.first] = model.v_ref_v
    expected[fold.second[paired]] = (fold.sign * model.v_ref_v)[paired]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = expected / (ref.gain * ref.drift_v0)
    same_sign = np.isfinite(ratio) & (ratio > 0)
    gains = np.where(same_sign, np.clip(ratio, 1 / limits.MAX_ROW_GAIN, limits.MAX_ROW_GAIN), 1.0)
    usable = np.isfinite(ref.drift_v0)
    _, apart, first, second = fold_means(model, np.nan_to_num(ref.drift_v0), usable, fold.sign)
    log_gain = np.log(np.where(first, gains[fold.first], gains[fold.second]))
    log_gain[~(first | second)] = np.nan
    both = first & second
    distance = np.sqrt(np.nanmean(log_gain**2))
    reciprocity = np.sqrt(np.mean(apart[both] ** 2)) / ref.rms_v if both.any() else 0.0
    tells = model.model_errors is not None and model.data_kind != "normalised"
    far = tells and bool(distance > limits.MAX_DISTANCE or reciprocity > limits.MAX_RECIPROCITY)
    in_force = (
        tells
        and not far
        and wanted
        and model.model_errors is not None
        and model.model_errors.row_gains
    )
    row_gain = gains if in_force else np.ones_like(gains)
    return replace(ref, row_gain=row_gain, log_gain=log_gain, far=far)


def odd_folds(model: Model, newer: FloatArray, older: FloatArray, used: BoolArray) -> BoolArray:
    """Folds (k,) that changed oddly from ``older`` to ``newer`` (m,): their rows changed
    differently, or where rows are copies they changed at all, by more than the others, than a part
    of the greatest voltage and than a part of their own. None if they are too many for outliers.
    """
    fold = model.fold
    change, size = np.where(used, newer - older, 0.0), np.where(used, np.abs(older), 0.0)
    _, apart, first, second = fold_means(model, change, used, fold.sign)
    apart = np.where(first & second, np.abs(apart), 0.0)
    paired = bool(apart.any())
    both_sides = np.where(fold.second >= 0, fold.second, fold.first)
    larger = np.maximum(np.abs(change[fold.first]), np.abs(change[both_sides]))
    off = apart if paired else larger
    spread, least = (
        (limits.PAIRED, limits.PAIRED_MIN) if paired else (limits.UNPAIRED, limits.UNPAIRED_MIN)
    )
    limit = max(spread * robust(off), least * float(size.max()))
    own = np.maximum(size[fold.first], size[both_sides])
    odd = np.asarray((off > limit) & (off > limits.OWN_MIN * own))
    return odd if odd.sum() <= limits.OUTLIER_MAX else np.zeros_like(odd)


def changed_rows(
    model: Model, newer: FloatArray, older: FloatArray, used: BoolArray, odd: BoolArray
) -> BoolArray:
    """Return which rows (m,) are to blame for the ``odd`` folds (k,): in each fold the row that
    changed more, and also the other one if it changed about as much."""
    change, out = np.where(used, np.abs(newer - older), 0.0), np.zeros(len(newer), dtype=bool)
    for first, second in zip(model.fold.first[odd], model.fold.second[odd], strict=True):
        most = max(change[first], change[second] if second >= 0 else 0.0)
        for row in (first, second):
            partner = second if row == first else first
            other = change[partner] if partner >= 0 else 0.0
            if (
                row >= 0
                and 0 < change[row] <= most
                and change[row] >= limits.CHANGED_AS_MUCH * other
            ):
                out[row] = True
    return out


def without_outliers(
    model: Model, frames: FloatArray, masked: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return the untouched ``frames`` (k, m) with outliers replaced, and which readings were
    replaced (k, m). If the first two frames disagree in a reading, the one that the third frame
    contradicts gets the other's value; in later frames an outlier gets the value of the mean so
    far."""
    done, left, used = frames.copy(), np.zeros(frames.shape, dtype=bool), ~masked
    differ = {
        (new, old): odd_folds(model, frames[new], frames[old], used)
        for new, old in ((1, 0), (2, 0), (2, 1))
    }
    wrong_first = differ[1, 0] & differ[2, 0] & ~differ[2, 1]
    wrong_second = differ[1, 0] & differ[2, 1] & ~differ[2, 0]
    for k, odd in ((0, wrong_first), (1, wrong_second)):
        left[k] = changed_rows(model, frames[1], frames[0], used, odd)
        done[k, left[k]] = frames[1 - k, left[k]]
    for k in range(2, len(frames)):
        mean = done[:k].mean(axis=0)
        odd = odd_folds(model, frames[k], mean, used)
        left[k] = changed_rows(model, frames[k], mean, used, odd)
        done[k, left[k]] = mean[left[k]]
    return done, left
