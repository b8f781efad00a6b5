"""Predict the frame of a homogeneous skin: in closed form for a disk (numpy only), otherwise by
finite elements.

The closed form: on a disk of radius R with sheet conductivity s = sigma t, a current I that enters
at the rim point a and leaves evenly along the rim gives u(x) = -I / (pi s) ln|x - a| + const.
Indeed ln|x - a| is harmonic inside, its normal derivative on |x| = R is 1 / (2 R) everywhere except
at a, and a half circle of radius e about a carries (I / (pi s e)) s (pi e) = I. If as much current
leaves as enters, the even parts cancel. This is Neumann's function of the circle with the source on
the rim (see for instance Kellogg, Foundations of Potential Theory, or Barber and Brown, J. Phys. E
17 (1984) 723). An electrode of finite width is treated as an even current density: ln is averaged
over the widths.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import GeometryError, UsageError
from eitskin.skin.skin import Skin

WIDTH_SAMPLES = 8
DEFAULT_WIDTH_PER_PITCH = 0.2


@dataclass(frozen=True, eq=False)
class Homogeneous:
    """The prediction for a homogeneous skin.

    ``transfer_ohm`` (n, n) is the potential at electrode i per ampere into electrode j, up to a
    constant for each row and column. ``source`` describes how it was calculated.
    """

    transfer_ohm: FloatArray
    source: str

    def voltages(self, rows: IntArray, current_a: float = 1.0) -> FloatArray:
        """Return the boundary voltages (m,) of ``rows`` (m, 4), in V. They are rough for rows that
        measure a driving electrode."""
        return voltages_of(self.transfer_ohm, rows) * current_a


def voltages_of(transfer_ohm: FloatArray, rows: IntArray) -> FloatArray:
    """Return the boundary voltages (..., m) per ampere of ``rows`` (..., m, 4), from a transfer
    matrix (n, n)."""
    a, b, c, d = np.moveaxis(np.asarray(rows), -1, 0)
    return np.asarray(
        transfer_ohm[c, a] - transfer_ohm[d, a] - transfer_ohm[c, b] + transfer_ohm[d, b]
    )


def shorted(transfer_ohm: FloatArray, i: int, j: int) -> FloatArray:
    """Return ``transfer_ohm`` (n, n) with electrodes i and j joined by a wire: Z - u u' / (u_i -
    u_j), u = Z (e_i - e_j)."""
    u = transfer_ohm[:, i] - transfer_ohm[:, j]
    return np.asarray(transfer_ohm - np.outer(u, u) / (u[i] - u[j]))


def shorted_frames(transfer_ohm: FloatArray, pairs: IntArray, rows: IntArray) -> FloatArray:
    """Return the boundary voltages (h, m) per ampere of ``rows`` (m, 4) with each of ``pairs`` (h,
    2) joined, as ``shorted`` does."""
    u = transfer_ohm[pairs[:, 0]] - transfer_ohm[pairs[:, 1]]
    across = np.take_along_axis(u, pairs, axis=1)
    a, b, c, d = rows.T
    taken = (u[:, c] - u[:, d]) * (u[:, a] - u[:, b]) / (across[:, :1] - across[:, 1:])
    return np.asarray(voltages_of(transfer_ohm, rows) - taken)


def homogeneous(skin: Skin | None, n_electrodes: int) -> Homogeneous:
    """Return the prediction for ``skin``; without one, for a disk of 1 S sheet conductivity with
    ``n_electrodes`` evenly spaced electrodes.

    Raises:
    UsageError: the skin has another number of electrodes.
    MissingExtraError: the outline is not a disk and the extra ``model`` is not installed.
    """
    if skin is None:
        angles = np.arange(n_electrodes, dtype=np.float64) * (2 * np.pi / n_electrodes)
        width = DEFAULT_WIDTH_PER_PITCH * 2 * np.pi / n_electrodes
        return Homogeneous(disk_transfer(angles, width), "closed form, disk with even electrodes")
    if skin.electrodes.count != n_electrodes:
        raise UsageError(
            f"skin {skin.name!r} has {skin.electrodes.count} electrodes, the frames have"
            f" {n_electrodes}"
        )
    sheet_s = skin.conductivity_s_per_m * skin.thickness_mm * 1e-3
    if skin.outline.diameter_mm is None:
        from eitskin.frames.homogeneous_fem import fem_prediction

        return Homogeneous(fem_prediction(skin).transfer_ohm(), "finite elements")
    radius_mm = skin.outline.diameter_mm / 2
    transfer = (
        disk_transfer(electrode_angles_rad(skin), skin.electrodes.width_mm / radius_mm) / sheet_s
    )
    return Homogeneous(transfer, "closed form, disk")


def resistor_ring(n_electrodes: int, resistance_ohm: float) -> Homogeneous:
    """Return the prediction for a ring of equal resistors, each of ``resistance_ohm`` between
    neighbours. Such a ring stands in for the skin in the first tests of an instrument.

    Between electrodes k apart, k and n - k resistors lie in parallel, together R k (n - k) / n. The
    voltage of a row is a difference of such resistances (Klein and Randic, J. Math. Chem. 12 (1993)
    81).
    """
    apart = np.abs(np.subtract.outer(np.arange(n_electrodes), np.arange(n_electrodes)))
    between = resistance_ohm * apart * (n_electrodes - apart) / n_electrodes
    return Homogeneous(-between / 2, f"a ring of resistors of {resistance_ohm:g} ohm")


def touch_transfer(
    skin: Skin, xy_mm: FloatArray, radius_mm: FloatArray, sign: NDArray[np.int8]
) -> FloatArray:
    """Return the change of the transfer matrix (n, n) by touches, up to a positive factor; as
    ``disk_touch_transfer``, but in mm."""
    if skin.outline.diameter_mm is None:
        from eitskin.frames.homogeneous_fem import fem_prediction

        return fem_prediction(skin).touch_transfer(xy_mm, radius_mm, sign)
    radius = skin.outline.diameter_mm / 2
    return disk_touch_transfer(electrode_angles_rad(skin), xy_mm / radius, radius_mm / radius, sign)


def electrode_angles_rad(skin: Skin) -> FloatArray:
    """Return the angle of each electrode's centre about the centre of a disk, (count,),
    counterclockwise from x."""
    if skin.outline.diameter_mm is None:
        raise GeometryError(f"skin {skin.name!r} is not a disk")
    x, y = skin.electrode_centres_mm().T
    return np.asarray(np.arctan2(y, x))


def disk_transfer(angle_rad: FloatArray, width_rad: float) -> FloatArray:
    """Return the transfer matrix (n, n) of a disk of 1 S sheet conductivity with electrodes
    ``width_rad`` wide at ``angle_rad`` (n,).

    Off the diagonal it is the mean of -ln|x - a| / pi over both widths (midpoint rule). On the
    diagonal it is the same mean over one width for a straight electrode, -(ln w - 3/2) / pi,
    without contact impedance.
    """
    n = len(angle_rad)
    across = (np.arange(WIDTH_SAMPLES) + 0.5) / WIDTH_SAMPLES - 0.5
    offsets = np.subtract.outer(across, across).ravel() * width_rad
    apart = np.subtract.outer(angle_rad, angle_rad)[..., None] + offsets
    chord = np.abs(2 * np.sin(apart / 2))
    chord[np.arange(n), np.arange(n)] = 1.0
    transfer = -np.log(chord).mean(axis=-1) / np.pi
    transfer[np.arange(n), np.arange(n)] = -(np.log(width_rad) - 1.5) / np.pi
    return np.asarray((transfer + transfer.T) / 2)


def disk_touch_transfer(
    angle_rad: FloatArray, xy: FloatArray, radius: FloatArray, sign: NDArray[np.int8]
) -> FloatArray:
    """Return the change (n, n) of a unit disk's transfer matrix by small touches, up to a positive
    factor, for point electrodes.

    Touches at ``xy`` (t, 2) with ``radius`` (t,) and ``sign`` (t,) give the sum of -sign area grad
    u_i . grad u_j.
    """
    rim = np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    away = np.asarray(xy)[:, None, :] - rim[None]
    gradient = -away / np.maximum((away**2).sum(axis=2, keepdims=True), 1e-12)
    return np.asarray(
        -np.einsum("t,tid,tjd->ij", sign * np.asarray(radius) ** 2, gradient, gradient)
    )
