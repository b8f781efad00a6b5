"""Touches followed from drive to drive by an extended Kalman filter: the numpy reference of
csrc/src/fast/tracks.c.

Of each touch x, y (mm), strength (S/m mm^2), vx, vy (mm/s). One covariance for all of them, since
touches share rows (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, Wiley 2001, ch. 10).
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin_reference.constants_table import (
    FAST_DRIVE_S,
    FAST_MODEL_ERROR,
    FAST_SPEED_NOISE,
    FAST_STRENGTH_NOISE,
)

X, Y, C, VX, VY, SIZE = range(6)


def summed(terms: FloatArray, axis: int = 0) -> FloatArray:
    """Their sum along ``axis``, one after another as C adds them; BLAS has an order of its own."""
    if terms.shape[axis] == 0:
        return np.asarray(terms.sum(axis=axis))
    return np.asarray(np.add.accumulate(terms, axis=axis).take(-1, axis=axis))


def dot(a: FloatArray, b: FloatArray) -> float:
    """a'b of two vectors, in order."""
    return float(summed(a * b))


def lower_solve(factor: FloatArray, right: FloatArray) -> FloatArray:
    """L^-1 times ``right`` (r,) or (r, k), L the lower triangle ``factor`` (r, r)."""
    out = right.copy()
    for i in range(len(factor)):
        out[i] = (out[i] - summed((factor[i, :i] * out[:i].T).T)) / factor[i, i]
    return out


def lower_solve_back(factor: FloatArray, right: FloatArray) -> FloatArray:
    """L'^-1 times ``right`` (r,)."""
    out = right.copy()
    for i in reversed(range(len(factor))):
        out[i] /= factor[i, i]
        out[:i] -= factor[i, :i] * out[i]
    return out


def lower_factor(s: FloatArray, otherwise: float) -> FloatArray:
    """L with L L' = ``s`` (r, r); a pivot that is not positive is ``otherwise``."""
    factor = np.zeros_like(s)
    for j in range(len(s)):
        left = s[j:, j] - summed(factor[j:, :j] * factor[j, :j], axis=1)
        factor[j, j] = np.sqrt(left[0] if left[0] > 0 else otherwise)
        factor[j + 1 :, j] = left[1:] / factor[j, j]
    return factor


@dataclass(frozen=True, eq=False)
class Innovation:
    """A drive's rows against what was expected: the factor L (r, r) of their covariance S = L L',
    ``white`` (r,) = L^-1 e, zero where a row is not in use, and ``moved`` (r, 5 k) = H P."""

    factor: FloatArray
    white: FloatArray
    moved: FloatArray
    e: FloatArray

    @property
    def chi2(self) -> float:
        """e' S^-1 e."""
        return dot(self.white, self.white)


class Tracks:
    """States (k, 5), their covariance (5 k, 5 k), and each touch's greatest strength (k,)."""

    def __init__(self) -> None:
        self.state, self.p, self.peak = np.zeros((0, SIZE)), np.zeros((0, 0)), np.zeros(0)

    def __len__(self) -> int:
        return len(self.peak)

    def predict(self, dt_s: float) -> None:
        """``dt_s`` on: places follow speeds, and all grows less sure."""
        drives, p = dt_s / FAST_DRIVE_S, self.p
        at = SIZE * np.arange(len(self))
        self.state[:, [X, Y]] += dt_s * self.state[:, [VX, VY]]
        for axis in (X, Y):
            p[at + axis] += dt_s * p[at + VX + axis]
        for axis in (X, Y):
            p[:, at + axis] += dt_s * p[:, at + VX + axis]
        p[at + C, at + C] += (FAST_STRENGTH_NOISE * self.peak) ** 2 * drives
        for speed in (VX, VY):
            p[at + speed, at + speed] += FAST_SPEED_NOISE**2 * drives

    def loosened(self, strength: float, place_mm: FloatArray) -> FloatArray:
        """The covariance (5 k, 5 k) where each touch may have changed by these at once, the
        strength as a fraction of its greatest, the place by its own of ``place_mm`` (k,)."""
        p = self.p.copy()
        for k in range(len(self)):
            at = np.arange(3) + SIZE * k
            p[at, at] += np.array([place_mm[k], place_mm[k], strength * self.peak[k]]) ** 2
        return p

    def innovation(
        self, z: FloatArray, used: BoolArray, sigma: float, answers: FloatArray
    ) -> Innovation:
        """``z`` (r,), where it is ``used`` (r,), its noise, and each touch's answers (k, 3, r)."""
        strength = self.state[:, C]
        given = strength[:, None] * answers[:, 0]
        e = np.where(used, z - summed(given), 0.0)
        error = summed((FAST_MODEL_ERROR * given) ** 2)
        slopes = strength[:, None, None] * answers[:, 1:]
        h = np.where(used, np.concatenate([slopes, answers[:, :1]], axis=1), 0.0)  # (k, 3, r)
        moved = np.zeros((len(z), len(self.p)))
        for k in range(len(self)):
            for way in (X, Y, C):
                moved += h[k, way][:, None] * self.p[SIZE * k + way]
        seen = moved.reshape(len(z), len(self), SIZE)[:, :, :3].transpose(1, 2, 0)
        s = summed(summed(h[:, :, :, None] * seen[:, :, None, :], axis=1))
        at = np.arange(len(z))
        s[at, at] = sigma * sigma + np.where(used, s[at, at] + error, 0.0)
        factor = lower_factor(s, sigma * sigma)
        return Innovation(factor, lower_solve(factor, e), moved, e)

    def update(self, seen: Innovation) -> None:
        """Believe the rows."""
        left, state = seen.moved.copy(), self.state.reshape(-1)
        for i, white in enumerate(seen.white):
            w = left[i] / seen.factor[i, i]
            left[i + 1 :] -= seen.factor[i + 1 :, i, None] * w
            state += white * w
            self.p -= w[:, None] * w

    def add(self, state: FloatArray, p: FloatArray) -> None:
        """A touch of ``state`` (5,) and covariance ``p`` (5, 5)."""
        whole = np.zeros((len(self.p) + SIZE,) * 2)
        whole[:-SIZE, :-SIZE], whole[-SIZE:, -SIZE:] = self.p, p
        self.state, self.p = np.vstack([self.state, state]), whole
        self.peak = np.append(self.peak, abs(state[C]))

    def remove(self, k: int) -> None:
        """Forget touch ``k``."""
        at = np.arange(SIZE) + SIZE * k
        self.p = np.delete(np.delete(self.p, at, 0), at, 1)
        self.state, self.peak = np.delete(self.state, k, 0), np.delete(self.peak, k)
