"""Judging a float32 result by float64 arithmetic on the same numbers: objective, duality gap, and
what rounding may add to each.

With u = 2^-24, a sum of k products of float32 numbers in any order is off by at most k u times the
sum of their magnitudes (Higham, Accuracy and Stability of Numerical Algorithms, 2002, section 3.1,
terms in u^2 left out). The residual y - S x of x with k non-zeros is so off by at most rho = (k +
2) u (|y| + sum_j |x_j| |s_j|) in norm, and a correlation s_j' r of r rows by
|s_j| (rho + r u |r|).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from eitskin.oracle.lasso import greatest
from everywhere import Outcome, as_float32
from margins import Margins

U = 2.0**-24


def objective_of(s: np.ndarray, y: np.ndarray, x: np.ndarray, lam: float) -> float:
    """|y - S x|^2 / 2 + lambda |x|_1."""
    residual = y - s @ x
    return 0.5 * float(residual @ residual) + lam * float(np.abs(x).sum())


@dataclass(frozen=True, eq=False)
class Judged:
    """A point ``x`` of the problem S (r, n), y (r,), lambda, sign rule; all float64 of float32
    numbers."""

    s: np.ndarray
    y: np.ndarray
    lam: float
    sign: str
    x: np.ndarray

    def at_zero(self) -> Judged:
        return replace(self, x=np.zeros_like(self.x))

    @property
    def residual(self) -> np.ndarray:
        return np.asarray(self.y - self.s @ self.x)

    @property
    def objective(self) -> float:
        return objective_of(self.s, self.y, self.x, self.lam)

    @property
    def gap(self) -> float:
        """The duality gap (csrc/src/solve/duality_gap.c has the formula)."""
        r = self.residual
        correlation = self.s.T @ r
        largest = greatest(correlation, self.sign)
        scale = self.lam / largest if largest > self.lam else 1.0
        slack = self.lam * np.abs(self.x) - scale * self.x * correlation
        return 0.5 * (1 - scale) ** 2 * float(r @ r) + float(np.maximum(slack, 0).sum())

    @property
    def rho(self) -> float:
        """Largest error of the residual by rounding, in norm."""
        sizes = np.linalg.norm(self.s, axis=0)
        reach = np.linalg.norm(self.y) + float(np.abs(self.x) @ sizes)
        return (np.count_nonzero(self.x) + 2) * U * float(reach)

    @property
    def objective_rounding(self) -> float:
        """Largest error of the objective by rounding: |r| rho for the residual, and (r + n) u for
        the sums of squares and magnitudes."""
        r, (rank, n) = float(np.linalg.norm(self.residual)), self.s.shape
        return r * self.rho + 0.5 * self.rho**2 + (rank + n + 4) * U * self.objective

    @property
    def gap_rounding(self) -> float:
        """Largest error of the gap by rounding: that of the objective, and two parts from the error
        dc of the correlations. The slacks contribute sum_j |x_j| dc_j. The relative error of s =
        lambda / max c is at most dc / max c, and contributes this share of |r|^2 + sum_j |x_j c_j|.
        """
        r = self.residual
        correlation, norm = self.s.T @ r, float(np.linalg.norm(r))
        off = np.linalg.norm(self.s, axis=0) * (self.rho + self.s.shape[0] * U * norm)
        largest = max(greatest(correlation, self.sign), self.lam, 1e-300)
        scale = min(1.0, float(off.max()) / largest)
        moved = scale * (norm**2 + float(np.abs(self.x * correlation).sum()))
        return self.objective_rounding + float(np.abs(self.x) @ off) + moved


def judged(s: np.ndarray, data: np.ndarray, sign: str, one: Outcome) -> Judged:
    """An outcome of ``Solve`` of ``data`` (r,) with S (r, n) as stored."""
    y = as_float32(data).astype(np.float64)
    return Judged(s, y, float(one.info.lambda_), sign, one.coefficients.astype(np.float64))


def check_sound(margins: Margins, case: str, point: Judged, one: Outcome) -> None:
    """Check what holds for every result, up to rounding: numbers are finite and signs are kept;
    objective, residual and gap are no worse than at the start; and the reported values are those
    that float64 finds for the coefficients."""
    assert one.status == 0 and one.finite()
    within = margins.of(case)
    allowed = {"increase": 1, "decrease": -1}.get(point.sign)
    wrong = 0 if allowed is None else np.count_nonzero(point.x * allowed < 0)
    within("coefficients of the wrong sign", wrong, 0, "pixels")
    start = point.at_zero()
    half, size = max(start.objective, 1e-300), float(np.linalg.norm(point.y)) or 1.0
    rise = max(0.0, point.objective - start.objective) / half
    room = (point.objective_rounding + start.objective_rounding) / half
    within("objective above the start", rise, room, "|y|^2/2")
    length = float(np.linalg.norm(point.residual))
    longer = max(0.0, length - float(np.linalg.norm(point.y))) / size
    allowance = (point.rho + point.s.shape[0] * U * size) / size
    within("residual above the start", longer, allowance, "|y|")
    room = (point.gap_rounding + start.gap_rounding) / half
    within("gap above the start", max(0.0, point.gap - start.gap) / half, room, "|y|^2/2")
    nothing_known = one.info.stop == "macs" and one.info.iterations == 0
    if one.info.stop not in ("zero", "below-threshold", "diverged") and not nothing_known:
        off = abs(one.info.gap - point.gap) / half
        within("reported gap off the true one", off, point.gap_rounding / half, "|y|^2/2")
        off = abs(one.info.residual - length) / size
        within("reported residual off the true one", off, allowance, "|y|")
