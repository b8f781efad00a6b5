"""From voltages to folded data: differences to the reference, and means of reciprocal rows."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.core.constants_table import FOLD_ROUNDING, MAX_RATIO, RATIO_DEFINED
from eitskin.model.model import Model


@dataclass(frozen=True, eq=False)
class Reference:
    """The untouched skin: ``v0`` (m,) V, NaN without one; ``rms_v`` of the folded v0; ``gain``,
    model volts per measured volt; ``row_gain`` (m,); ``noise_v`` and ``lambda_noise``, 0 if they
    were not learned; ``log_gain`` (k,), the logarithm of v_ref / v0, NaN without v0; ``far``: the
    instrument differs from the model, not the skin; ``drift_v0``: v0 as the drift's direction has
    it."""

    v0: FloatArray
    rms_v: float
    gain: float
    correlation: float
    row_gain: FloatArray
    log_gain: FloatArray
    far: bool
    drift_v0: FloatArray
    noise_v: float = 0.0
    lambda_noise: float = 0.0


@dataclass(frozen=True, eq=False)
class Folded:
    """Folded data ``d`` (k,), 0 without a row; what its rows differ by (k,), 0 if one is in use or
    one is a copy; and which rows are in use (k,)."""

    d: FloatArray
    apart: FloatArray
    first: BoolArray
    second: BoolArray

    @property
    def known(self) -> BoolArray:
        """Folds with data."""
        return np.asarray(self.first | self.second)

    @property
    def both(self) -> BoolArray:
        """Folds with both rows."""
        return np.asarray(self.first & self.second)


def fold_means(
    model: Model, rows: FloatArray, used: BoolArray, sign: IntArray | int
) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """The mean (k,) over the used rows of each fold, 0 without one; the second row's value times
    ``sign`` less from the first's; and which are used."""
    fold = model.fold
    first, second = used[fold.first], (fold.second >= 0) & used[fold.second]
    one = np.where(first, rows[fold.first], 0.0)
    other = np.where(second, sign * rows[fold.second], 0.0)
    count = np.maximum(first.astype(int) + second, 1)
    return (one + other) / count, one - other, first, second


def fold_frame(
    model: Model, frame: FloatArray, ref: Reference, unusable: BoolArray, kind: str
) -> Folded:
    """The data of ``kind`` of a frame (m,) V, in model volts or without unit where normalised."""
    small = np.abs(np.nan_to_num(ref.v0)) < RATIO_DEFINED * ref.rms_v
    used = ~unusable & ~(small & (kind != "difference"))
    v, v0 = np.where(used, frame, 1.0), np.where(used, ref.v0, 1.0)
    scale = ref.gain * ref.row_gain
    datum = {
        "difference": scale * (v - v0),
        "normalised": (v - v0) / v0,
        "log-ratio": scale * v0 * np.log(np.clip(v / v0, 1 / MAX_RATIO, MAX_RATIO)),
    }[kind]
    sign = 1 if kind == "normalised" else model.fold.sign
    d, apart, first, second = fold_means(model, datum, used, sign)
    size = 1.0 if kind == "normalised" else np.abs(scale * v0)[model.fold.first]
    told = first & second & (np.abs(apart) > FOLD_ROUNDING * size)
    return Folded(d, np.where(told, apart, 0.0), first, second)


def gain_drift(model: Model, ref: Reference, folded: Folded) -> FloatArray:
    """Return the direction in the folded data (k,) of a common factor on all voltages."""
    if model.data_kind == "normalised":
        return folded.known.astype(float)
    used = np.zeros(len(ref.drift_v0), dtype=bool)
    used[model.fold.first[folded.first]] = True
    used[model.fold.second[folded.second]] = True
    rows = ref.gain * ref.row_gain * np.nan_to_num(ref.drift_v0)
    return fold_means(model, rows, used, model.fold.sign)[0]
