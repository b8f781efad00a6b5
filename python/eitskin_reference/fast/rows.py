"""What a touch does to one drive's rows, from the model's fields: the numpy reference of
csrc/src/fast/rows.c."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.model.model import Model
from eitskin_reference.constants_table import FAST_SOFT_RADIUS
from eitskin_reference.fast.tracks import summed


@dataclass(frozen=True, eq=False)
class Drive:
    """Rows (r,) of a protocol that are measured while one pair of electrodes is driven."""

    plus: int
    minus: int
    rows: IntArray


def drives_of(model: Model) -> list[Drive]:
    """The protocol's drives, in the order of their first rows."""
    table = model.protocol.drive_measure.astype(np.int64)
    pairs: dict[tuple[int, int], list[int]] = {}
    for row, (plus, minus) in enumerate(table[:, :2].tolist()):
        pairs.setdefault((plus, minus), []).append(row)
    return [Drive(*pair, np.array(rows)) for pair, rows in pairs.items()]


class RowModel:
    """The answer of each row to a touch of strength 1 S/m mm^2, in the model's volts.

    A row's datum changes by -volts strength mean(E_drive . E_measure), the mean over a soft disc:
    each pixel's field counts (1 - d^2 / rho^2)^2 at a distance d below rho, so that the answer has
    a derivative everywhere.

    Raises:
        UsageError: the model has no fields.
    """

    def __init__(self, model: Model) -> None:
        if model.fields is None:
            raise UsageError("fast path: the model has no fields (section FLDS); build it again")
        electrodes, fields = model.protocol.n_electrodes, model.fields
        columns = fields.columns[:, : 2 * electrodes].astype(np.float64)
        self._x, self._y = columns[:, :electrodes], columns[:, electrodes:]
        self._volts, self._table = fields.volts, model.protocol.drive_measure.astype(np.int64)
        self._grid, self.centres_mm = model.grid, model.grid.centres_mm()
        radius = FAST_SOFT_RADIUS * model.defaults.touch_seed_radius_mm
        self._rho2 = radius * radius

    def answer(self, drive: Drive, x_mm: float, y_mm: float) -> tuple[FloatArray, bool]:
        """The rows' answer to a touch there and its derivatives by x and y (3, r), V per S/m mm^2
        and that per mm; and whether the place is on the skin."""
        left, to_x, to_y = self._near(x_mm, y_mm)
        near = np.flatnonzero(left > 0)
        if not len(near):
            return np.zeros((3, len(drive.rows))), False
        left, to_x, to_y = left[near], to_x[near], to_y[near]
        slope = 4 * self._grid.pixel_mm / self._rho2
        weights = np.array([left * left, slope * left * to_x, slope * left * to_y])
        seen = summed(weights[:, :, None] * self.products(drive, near), axis=1)
        sums = summed(weights, axis=1)
        seen[0] *= 1 / sums[0]
        seen[1:] = (seen[1:] - sums[1:, None] * seen[0]) * (1 / sums[0])
        return self._over_rows(drive, seen), True

    def squares(self, drive: Drive, seen: FloatArray, per: FloatArray) -> FloatArray:
        """The sum of squares (k,) of the rows that electrodes' products ``seen`` (k, L) give, each
        times ``per`` (r,)."""
        measure, weight = self._table[drive.rows, 2:], self._volts * per
        differences = seen[:, measure[:, 0]] - seen[:, measure[:, 1]]
        return summed(weight * weight * (differences * differences), axis=1)

    def over_electrodes(self, drive: Drive, u: FloatArray) -> FloatArray:
        """What u'g is by electrode, (L,)."""
        out = np.zeros(self._x.shape[1])
        for (plus, minus), one in zip(self._table[drive.rows, 2:], u, strict=True):
            out[plus] += -self._volts * one
            out[minus] -= -self._volts * one
        return out

    def products(self, drive: Drive, pixels: IntArray) -> FloatArray:
        """E_drive . E of each electrode's current (k, L)."""
        x, y = self._x[pixels], self._y[pixels]
        along_x = x[:, drive.plus] - x[:, drive.minus]
        along_y = y[:, drive.plus] - y[:, drive.minus]
        return np.asarray(along_x[:, None] * x + along_y[:, None] * y)

    def _over_rows(self, drive: Drive, seen: FloatArray) -> FloatArray:
        measure = self._table[drive.rows, 2:]
        return np.asarray(-self._volts * (seen[:, measure[:, 0]] - seen[:, measure[:, 1]]))

    def on_skin(self, x_mm: float, y_mm: float) -> bool:
        """Whether a pixel's centre is near enough to answer."""
        return bool((self._near(x_mm, y_mm)[0] > 0).any())

    def _near(self, x_mm: float, y_mm: float) -> FloatArray:
        """1 - d^2 / rho^2 of each pixel, and where it is from the place, in pixels (3, n)."""
        side = self._grid.pixel_mm
        at = (np.array([x_mm, y_mm]) - self._grid.origin_mm) / side
        to_x, to_y = (self._grid.index + 0.5 - at).T
        left = 1 - side * side / self._rho2 * (to_x * to_x + to_y * to_y)
        return np.array([left, to_x, to_y])
