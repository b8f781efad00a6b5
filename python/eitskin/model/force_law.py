"""The law that gives the force of a touch from its strength and place: reading and using the
optional section LOAD of a model (docs/guide/calibration.md)."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.core.constants_table import MAX_GAIN
from eitskin.errors import ModelError

HEAD = struct.Struct("<IIfff12x")
MAX_POINTS, MAX_ORDER = 64, 4
# in float32, as the C core compares
MIN_RADIUS_MM, HUGE = float(np.float32(1e-6)), float(np.float32(1e30))
MAX_REACH, MAX_COEFFICIENT = 1e3, 1e6


def terms_of(order: int) -> list[tuple[int, int]]:
    """Return the powers (a, b) of u and v in the order of the coefficients: 1, u, v, u^2, u v,
    v^2..."""
    return [(degree - b, b) for degree in range(order + 1) for b in range(degree + 1)]


def monomials(u: FloatArray, v: FloatArray, order: int) -> FloatArray:
    """Return the value of each of :func:`terms_of` at (u, v), both (k,): (k, t)."""
    return np.stack([u**a * v**b for a, b in terms_of(order)], axis=1)


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """A calibrated law.

    ``strength`` (p,) in S/m mm^2 and ``force_n`` (p,) in N are the table for a gain of 1; both
    ascend from 0. ``gain`` (t,) holds the coefficients of :func:`terms_of` (``order``) in u = x /
    ``radius_mm``, v = y / ``radius_mm``; it is valid up to ``reach`` = sqrt(u^2 + v^2).
    ``uncertainty`` is relative: 95 % of the forces that were left out of the fit were predicted
    within it. All values are float32.
    """

    strength: npt.NDArray[np.float32]
    force_n: npt.NDArray[np.float32]
    gain: npt.NDArray[np.float32]
    order: int
    radius_mm: float
    reach: float
    uncertainty: float

    def gains_at(self, place_mm: FloatArray) -> FloatArray:
        """Return the factor for strengths at places (k, 2): the polynomial, limited to 1/4 to 4.
        Beyond ``reach`` it keeps the value that it has at ``reach`` in the same direction."""
        u, v = np.asarray(place_mm).T / self.radius_mm
        away = np.hypot(u, v)
        inward = np.where(away > self.reach, self.reach / np.maximum(away, 1e-300), 1.0)
        value = monomials(u * inward, v * inward, self.order) @ self.gain.astype(np.float64)
        return np.asarray(np.clip(value, 1 / MAX_GAIN, MAX_GAIN))

    def forces_at(self, place_mm: FloatArray, strength: FloatArray) -> FloatArray:
        """Return the forces (k,) in N of touches of ``strength`` (k,) S/m mm^2 at places (k, 2).
        Beyond the table its last slope continues, up to twice its greatest force. The result is
        that of eits_force_n in csrc/src/model/force.c."""
        corrected = np.abs(strength) * self.gains_at(place_mm)
        s, n = self.strength.astype(np.float64), self.force_n.astype(np.float64)
        k = np.clip(np.searchsorted(s, corrected), 1, len(s) - 1)
        return np.asarray(
            np.minimum(
                n[k - 1] + (corrected - s[k - 1]) / (s[k] - s[k - 1]) * (n[k] - n[k - 1]), 2 * n[-1]
            )
        )


def encode_force_law(law: ForceLaw) -> bytes:
    head = HEAD.pack(len(law.strength), law.order, law.radius_mm, law.reach, law.uncertainty)
    content = head + b"".join(
        part.astype("<f4").tobytes() for part in (law.strength, law.force_n, law.gain)
    )
    decode_force_law(content, "calibration")
    return content


def decode_force_law(content: bytes, where: str) -> ForceLaw:
    """Return the law in the section LOAD; ``where`` names the file in errors.

    Raises:
        ModelError: a length or a number is out of range.
    """
    wrong = ModelError(
        f"{where}: holds a calibration (section 'LOAD') that is out of range; calibrate again"
    )
    if len(content) < HEAD.size:
        raise wrong
    points, order, radius_mm, reach, uncertainty = HEAD.unpack_from(content)
    in_range = (
        2 <= points <= MAX_POINTS
        and order <= MAX_ORDER
        and MIN_RADIUS_MM <= radius_mm <= HUGE
        and 0 <= reach <= MAX_REACH
        and 0 <= uncertainty <= HUGE
    )
    if not in_range or len(content) != HEAD.size + 4 * (2 * points + len(terms_of(order))):
        raise wrong
    strength, force_n, gain = np.split(
        np.frombuffer(content, dtype="<f4", offset=HEAD.size), [points, 2 * points]
    )
    for ascending in (strength, force_n):
        if ascending[0] != 0 or not ascending[-1] <= HUGE or not (np.diff(ascending) > 0).all():
            raise wrong
    if not (np.abs(gain) <= MAX_COEFFICIENT).all():
        raise wrong
    return ForceLaw(strength, force_n, gain, order, radius_mm, reach, uncertainty)
