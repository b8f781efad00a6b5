"""The frame of a homogeneous skin, predicted: closed form for a disk (numpy only), else finite
elements.

Closed form. On a disk of radius R with sheet conductivity s = sigma t, a current I that enters at
the rim point a and leaves evenly along the rim gives u(x) = -I / (pi s) ln|x - a| + const: ln|x -
a| is harmonic inside, its normal derivative on |x| = R is 1 / (2 R) everywhere but at a, and a half
circle of radius e about a carries (I / (pi s e)) s (pi e) = I. With as much current out as in, the
even parts cancel. This is Neumann's function of the circle with the source on the rim (for instance
Kellogg, Foundations of Potential Theory, or Barber and Brown, J. Phys. E 17 (1984) 723). An
electrode of finite width is taken as an even current density: averages of ln over widths.
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
    """What a homogeneous skin would measure.

    ``transfer_ohm`` (n, n): potential at electrode i per ampere into j, up to a constant for each
    row and column. ``source`` says how it was computed.
    """

    transfer_ohm: FloatArray
    source: str

    def voltages(self, rows: IntArray, current_a: float = 1.0) -> FloatArray:
        """The boundary voltages (m,) of ``rows`` (m, 4), in volts; rough where a row measures a
        driving electrode."""
        return voltages_of(self.transfer_ohm, rows) * current_a


def voltages_of(transfer_ohm: FloatArray, rows: IntArray) -> FloatArray:
    """Boundary voltages (..., m) per ampere for ``rows`` (..., m, 4), from a transfer matrix (n,
    n)."""
    a, b, c, d = np.moveaxis(np.asarray(rows), -1, 0)
    return np.asarray(
        transfer_ohm[c, a] - transfer_ohm[d, a] - transfer_ohm[c, b] + transfer_ohm[d, b]
    )


def shorted(transfer_ohm: FloatArray, i: int, j: int) -> FloatArray:
    """``transfer_ohm`` (n, n) with i and j joined by a wire: Z - u u' / (u_i - u_j), u = Z (e_i -
    e_j)."""
    u = transfer_ohm[:, i] - transfer_ohm[:, j]
    return np.asarray(transfer_ohm - np.outer(u, u) / (u[i] - u[j]))


def shorted_frames(transfer_ohm: FloatArray, pairs: IntArray, rows: IntArray) -> FloatArray:
    """Boundary voltages (h, m) per ampere of ``rows`` (m, 4) with each of ``pairs`` (h, 2) joined:
    as ``shorted``."""
    u = transfer_ohm[pairs[:, 0]] - transfer_ohm[pairs[:, 1]]
    across = np.take_along_axis(u, pairs, axis=1)
    a, b, c, d = rows.T
    taken = (u[:, c] - u[:, d]) * (u[:, a] - u[:, b]) / (across[:, :1] - across[:, 1:])
    return np.asarray(voltages_of(transfer_ohm, rows) - taken)


def homogeneous(skin: Skin | None, n_electrodes: int) -> Homogeneous:
    """The prediction for ``skin``, or for a disk of 1 S sheet conductivity with ``n_electrodes``
    even electrodes.

    Raises:
        UsageError: the skin has another number of electrodes.
        MissingExtraError: the outline is no disk and the extra ``model`` is not installed.
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
    """What a ring of equal resistors gives, each of ``resistance_ohm`` between neighbours: what
    stands in for the skin when an instrument is tried first.

    Between electrodes k apart lie k and n - k resistors side by side, R k (n - k) / n together; a
    row's voltage is a difference of such resistances (Klein and Randic, J. Math. Chem. 12 (1993)
    81).
    """
    apart = np.abs(np.subtract.outer(np.arange(n_electrodes), np.arange(n_electrodes)))
    between = resistance_ohm * apart * (n_electrodes - apart) / n_electrodes
    return Homogeneous(-between / 2, f"a ring of resistors of {resistance_ohm:g} ohm")


def touch_transfer(
    skin: Skin, xy_mm: FloatArray, radius_mm: FloatArray, sign: NDArray[np.int8]
) -> FloatArray:
    """How touches change the transfer matrix (n, n), up to a positive factor: as
    ``disk_touch_transfer``, in mm."""
    if skin.outline.diameter_mm is None:
        from eitskin.frames.homogeneous_fem import fem_prediction

        return fem_prediction(skin).touch_transfer(xy_mm, radius_mm, sign)
    radius = skin.outline.diameter_mm / 2
    return disk_touch_transfer(electrode_angles_rad(skin), xy_mm / radius, radius_mm / radius, sign)


def electrode_angles_rad(skin: Skin) -> FloatArray:
    """Angle of each electrode's centre about the centre of a disk, (count,), counterclockwise from
    x."""
    if skin.outline.diameter_mm is None:
        raise GeometryError(f"skin {skin.name!r} is no disk")
    x, y = skin.electrode_centres_mm().T
    return np.asarray(np.arctan2(y, x))


def disk_transfer(angle_rad: FloatArray, width_rad: float) -> FloatArray:
    """Transfer matrix (n, n) of a disk of 1 S sheet conductivity, electrodes ``width_rad`` wide at
    ``angle_rad`` (n,).

    Off the diagonal the mean of -ln|x - a| / pi over both widths (midpoint rule); on it the same
    mean over one width for a straight electrode, -(ln w - 3/2) / pi, contact impedance left out.
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
    """Change (n, n) of a unit disk's transfer matrix by small touches, up to a positive factor,
    point electrodes.

    Touches at ``xy`` (t, 2) with ``radius`` (t,) and ``sign`` (t,): the sum of -sign area grad u_i
    . grad u_j.
    """
    rim = np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    away = np.asarray(xy)[:, None, :] - rim[None]
    gradient = -away / np.maximum((away**2).sum(axis=2, keepdims=True), 1e-12)
    return np.asarray(
        -np.einsum("t,tid,tjd->ij", sign * np.asarray(radius) ** 2, gradient, gradient)
    )
