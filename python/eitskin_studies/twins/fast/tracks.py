"""Touches followed from drive to drive by an extended Kalman filter: the numpy reference of
csrc/src/fast/tracks.c.

Of each touch x, y (mm), strength (S/m mm^2), vx, vy (mm/s). One covariance for all of them, since
touches share rows (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
Navigation, Wiley 2001, ch. 10).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import (
    FAST_DRIVE_S,
    FAST_MODEL_ERROR,
    FAST_SPEED_NOISE,
    FAST_STRENGTH_NOISE,
)

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
X, Y, C, VX, VY, SIZE = range(6)


def lower_solve(factor: FloatArray, right: FloatArray) -> FloatArray:
    """L^-1 times ``right`` (r,) or (r, k), L the lower triangle ``factor`` (r, r)."""
    out = right.copy()
    for i in range(len(factor)):
        out[i] = (out[i] - factor[i, :i] @ out[:i]) / factor[i, i]
    return out


@dataclass(frozen=True, eq=False)
class Innovation:
    """A drive's rows against what was expected: the factor L (r, r) of their covariance S = L L',
    ``white`` (r,) = L^-1 e, zero where a row is not in use, and ``moved`` (5 k, r) = P H'."""

    factor: FloatArray
    white: FloatArray
    moved: FloatArray
    e: FloatArray

    @property
    def chi2(self) -> float:
        """e' S^-1 e."""
        return float(self.white @ self.white)


class Tracks:
    """States (k, 5), their covariance (5 k, 5 k), and each touch's greatest strength (k,)."""

    def __init__(self) -> None:
        self.state, self.p, self.peak = np.zeros((0, SIZE)), np.zeros((0, 0)), np.zeros(0)

    def __len__(self) -> int:
        return len(self.peak)

    def predict(self, dt_s: float) -> None:
        """``dt_s`` on: places follow speeds, and all grows less sure."""
        step = np.eye(SIZE)
        step[X, VX] = step[Y, VY] = dt_s
        f, drives = np.kron(np.eye(len(self)), step), dt_s / FAST_DRIVE_S
        self.state, self.p = self.state @ step.T, f @ self.p @ f.T
        for k in range(len(self)):
            noise = np.array([0, 0, FAST_STRENGTH_NOISE * self.peak[k], *[FAST_SPEED_NOISE] * 2])
            at = np.arange(SIZE) + SIZE * k
            self.p[at, at] += noise**2 * drives

    def loosened(self, strength: float, place_mm: float) -> FloatArray:
        """The covariance (5 k, 5 k) where each touch may have changed by these at once, the
        strength as a fraction of its greatest."""
        p = self.p.copy()
        for k in range(len(self)):
            at = np.arange(3) + SIZE * k
            p[at, at] += np.array([place_mm, place_mm, strength * self.peak[k]]) ** 2
        return p

    def innovation(
        self, z: FloatArray, used: BoolArray, sigma: float, answers: FloatArray
    ) -> Innovation:
        """``z`` (r,), where it is ``used`` (r,), its noise, and each touch's answers (k, 3, r)."""
        strength = self.state[:, C]
        given = strength[:, None] * answers[:, 0]
        e = np.where(used, z - given.sum(axis=0), 0.0)
        variance = sigma**2 + np.where(used, ((FAST_MODEL_ERROR * given) ** 2).sum(axis=0), 0.0)
        h = np.zeros((len(z), len(self), SIZE))
        h[:, :, C] = answers[:, 0].T
        for axis in (X, Y):
            h[:, :, axis] = (strength[:, None] * answers[:, 1 + axis]).T
        rows = np.where(used[:, None, None], h, 0.0).reshape(len(z), -1)
        moved = self.p @ rows.T
        factor = np.asarray(np.linalg.cholesky(rows @ moved + np.diag(variance)), np.float64)
        return Innovation(factor, lower_solve(factor, e), moved, e)

    def update(self, seen: Innovation) -> None:
        """Believe the rows."""
        gain = lower_solve(seen.factor, seen.moved.T).T
        self.state = self.state + (gain @ seen.white).reshape(-1, SIZE)
        self.p = self.p - gain @ gain.T

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
