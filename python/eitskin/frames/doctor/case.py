"""The case that the checks work on: the frames in one order, the prediction to compare them with,
and which rows can be trusted."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.config import first_few
from eitskin.frames.frames import Frames
from eitskin.frames.homogeneous import Homogeneous, voltages_of
from eitskin.skin.skin import Skin

GROUP = 12
SAME = 1e-6


@dataclass(frozen=True, eq=False)
class Case:
    """The ``frames`` (voltages may be NaN) and the transfer matrix ``transfer_ohm`` (n, n) to
    compare them with, for the electrodes that ``rows`` (m, 4) name.

    ``trusted`` (m,) marks the rows that no earlier check has found unusable. With ``magnitude`` the
    signs are unknown. ``prediction`` is that of the healthy skin; ``transfer_ohm`` differs from its
    matrix if electrodes are joined.
    """

    frames: Frames
    skin: Skin | None
    prediction: Homogeneous
    transfer_ohm: FloatArray
    rows: IntArray
    trusted: BoolArray
    magnitude: bool = False

    @property
    def n_electrodes(self) -> int:
        return self.frames.protocol.n_electrodes

    @property
    def reference(self) -> FloatArray:
        """The mean untouched frame (m,), 0 if it is not finite."""
        with np.errstate(invalid="ignore", over="ignore"):
            return np.asarray(
                np.nan_to_num(self.frames.reference_voltage_v.mean(axis=0), posinf=0.0, neginf=0.0)
            )

    @property
    def predicted(self) -> FloatArray:
        """The predicted homogeneous frame (m,) per ampere."""
        return voltages_of(self.transfer_ohm, self.rows)

    @property
    def joined(self) -> bool:
        """Return whether two electrodes were found joined, so that single rows are predicted only
        roughly."""
        return self.transfer_ohm is not self.prediction.transfer_ohm

    def expected(self) -> FloatArray:
        """Return the homogeneous frame (m,) in volts as these rows would measure it; see
        ``calibrated``."""
        return calibrated(self.reference, self.predicted, self.trusted)

    def row(self, number: int) -> str:
        """Return a name such as "row 17 [1, 2, 8, 9]"."""
        return f"row {number} {self.rows[number].tolist()}"


def strength_groups(size: FloatArray, usable: BoolArray) -> list[IntArray]:
    """Sort the ``usable`` rows (m,) by ``size`` (m,) and split them into groups of at least GROUP;
    equal sizes stay together.

    On a round skin the rows of a group are equal by symmetry.
    """
    order = np.flatnonzero(usable)[np.argsort(size[usable], kind="stable")]
    cuts = [0]
    for k in range(1, len(order)):
        apart = size[order[k]] > size[order[k - 1]] * (1 + SAME)
        if k - cuts[-1] >= GROUP and len(order) - k >= GROUP and apart:
            cuts.append(k)
    return [order[a:b] for a, b in pairwise([*cuts, len(order)]) if b > a]


def calibrated(measured: FloatArray, predicted: FloatArray, trusted: BoolArray) -> FloatArray:
    """Return ``predicted`` (m,) scaled to ``measured`` (m,) by robust ratios, so that only single
    rows stand out.

    The ratio of a group of similar rows (``strength_groups``) is the median of measured / predicted
    over its ``trusted`` rows; between groups it is interpolated over log |predicted|. This absorbs
    the deviation of a real tank, which differs for near and far pairs.
    """
    size = np.abs(predicted)
    usable = trusted & (size > SAME * size.max(initial=0.0))
    if usable.sum() < GROUP:
        usable = size > 0
    groups = strength_groups(size, usable)
    if not groups:
        return np.zeros_like(predicted)
    middles = [float(np.median(np.log(size[group]))) for group in groups]
    ratios = [float(np.median(measured[group] / predicted[group])) for group in groups]
    return np.asarray(predicted * np.interp(np.log(np.maximum(size, 1e-300)), middles, ratios))


def rms(values: FloatArray) -> float:
    """Return the root mean square, or 0 for an empty array."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


def robust_spread(values: FloatArray) -> float:
    """Return 1.4826 times the median distance from the median, which is the standard deviation if
    the values are normal."""
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if values.size else 0.0


def cosine(a: FloatArray, b: FloatArray) -> float:
    """Return the cosine between two frames, or 0 if one is all zero."""
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / norm if norm > 0 else 0.0


def correlation(a: FloatArray, b: FloatArray) -> float:
    """Return Pearson's correlation, or 0 if one is constant."""
    return cosine(a - a.mean(), b - b.mean()) if a.size else 0.0


def short_list(rows: Any) -> str:
    """Return row numbers for a sentence, truncated after eight."""
    return first_few(numbers(rows), 8)


def numbers(array: Any) -> list[int]:
    """Return row numbers as plain integers, for evidence."""
    return [int(value) for value in np.asarray(array).ravel()]
