"""How even an untouched skin's frame is: adjacent frames folded to drives by relative positions,
and what that shows."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FrameError
from eitskin.skin.protocol import Protocol


@dataclass(frozen=True, eq=False)
class Fold:
    """Rows of an adjacent scan by drive and relative position: entry (d, p) is ``sign`` times the
    voltage of ``row``, measured p + 2 electrodes on from drive (d, d + 1); both (n, n - 3)."""

    row: IntArray
    sign: IntArray

    def of(self, voltage_v: FloatArray) -> FloatArray:
        """(..., n, n - 3) of frames (..., m) V."""
        return np.asarray(self.sign * voltage_v[..., self.row])


def fold_for(protocol: Protocol) -> Fold:
    """The fold of an adjacent scan, whatever the order of its rows and the polarity of its pairs.

    Raises:
        FrameError: a pair is not of neighbours, or a measurement is missing or repeated.
    """
    n = protocol.n_electrodes
    (drive, drive_sign), (measure, measure_sign) = (
        _pairs(protocol.drive_measure[:, columns].astype(np.int64), n)
        for columns in ([0, 1], [2, 3])
    )
    position = (measure - drive) % n - 2
    row, sign = np.full((n, n - 3), -1, dtype=np.int64), np.ones((n, n - 3), dtype=np.int64)
    usable = (position >= 0) & (position < n - 3)
    row[drive[usable], position[usable]] = np.flatnonzero(usable)
    sign[drive[usable], position[usable]] = (drive_sign * measure_sign)[usable]
    if not usable.all() or protocol.n_rows != row.size or (row < 0).any():
        raise FrameError(
            f"uniformity: {protocol.n_rows} rows are not one for each of {n} adjacent drives and"
            f" {n - 3} positions; use an adjacent scan"
        )
    return Fold(row, sign)


@dataclass(frozen=True)
class Uniformity:
    """The uniformity of one frame, in percent.

    Attributes:
        spread: standard deviation over drives / mean over drives, the mean of all positions;
            ``worst`` that of the worst one.
        reciprocity: rms of the differences of reciprocal rows / rms of all.
        mirror: rms of the differences of mirrored positions of one drive / rms of all: a disk's
            curves are symmetric.
        deviation: rms of all deviations from the mean over drives / rms of all.
    """

    spread: float
    worst: float
    reciprocity: float
    mirror: float
    deviation: float


def uniformity(voltage_v: FloatArray, protocol: Protocol, fold: Fold) -> Uniformity:
    """Return the uniformity of a frame (m,) V."""
    folded, pairs = fold.of(voltage_v), protocol.reciprocal_pairs()
    level = _rms(folded)
    spread = folded.std(axis=0) / np.abs(folded.mean(axis=0))
    both = pairs.second >= 0
    apart = voltage_v[pairs.first[both]] - pairs.sign[both] * voltage_v[pairs.second[both]]
    return Uniformity(
        spread=100 * float(spread.mean()),
        worst=100 * float(spread.max()),
        reciprocity=100 * _rms(apart) / level,
        mirror=100 * _rms(folded - folded[:, ::-1]) / level,
        deviation=100 * _rms(folded - folded.mean(axis=0)) / level,
    )


def deviations_percent(folded: FloatArray) -> FloatArray:
    """Each value's distance from the mean over drives, percent of that mean, (n, n - 3): above 0 if
    larger in size."""
    mean = folded.mean(axis=0)
    return np.asarray(100 * (folded / mean - 1))


def _pairs(given: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """The first electrode of each pair (m, 2) of neighbours, and -1 if the pair is turned round."""
    ahead = (given[:, 1] - given[:, 0]) % n
    if not np.isin(ahead, (1, n - 1)).all():
        row = int(np.argmin(np.isin(ahead, (1, n - 1))))
        raise FrameError(
            f"uniformity: row {row} (from 0) has the pair {given[row].tolist()}; use an adjacent"
            " scan"
        )
    turned = ahead == n - 1
    return np.where(turned, given[:, 1], given[:, 0]), np.where(turned, -1, 1)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
