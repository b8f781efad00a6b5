"""The problem that every solver solves: minimise |y - S x|^2 / 2 + lambda |x|_1 under a sign rule.

The optimum is found by an active set and FISTA as it is defined; a point is judged by its duality
gap and by how far it violates the conditions of Karush, Kuhn and Tucker.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray

PROGRESS = 1e-12  # of the greatest correlation: a violation below it is rounding
MAX_CHANGES = 10_000  # of the active set; a guard against a loop by rounding


def shrink(v: FloatArray, threshold: float, sign: str) -> FloatArray:
    """argmin over x of (x - v)^2 / 2 + threshold |x|, x >= 0, <= 0 or free by the sign rule."""
    size = np.maximum(np.abs(v) - threshold, 0.0)
    if sign == "increase":
        return np.where(v > 0, size, 0.0)
    if sign == "decrease":
        return np.where(v < 0, -size, 0.0)
    return np.sign(v) * size


def pull(g: FloatArray, sign: str) -> FloatArray:
    """How strongly the correlations ``g`` (n,) ask for a coefficient that the rule allows."""
    return {"increase": g, "decrease": -g, "both": np.abs(g)}[sign]


def greatest(g: FloatArray, sign: str) -> float:
    """The least lambda whose optimum is zero: the greatest pull, not below 0."""
    return max(0.0, float(pull(g, sign).max()))


@dataclass(frozen=True, eq=False)
class Lasso:
    """S (r, n), y (r,), both already projected; lambda; the sign rule."""

    s: FloatArray
    y: FloatArray
    lam: float
    sign: str

    def residual(self, x: FloatArray) -> FloatArray:
        """y - S x (r,)."""
        return np.asarray(self.y - self.s @ x)

    def objective(self, x: FloatArray) -> float:
        """|y - S x|^2 / 2 + lambda |x|_1."""
        r = self.residual(x)
        return 0.5 * float(r @ r) + self.lam * float(np.abs(x).sum())

    def gap(self, x: FloatArray) -> float:
        """Objective at ``x`` less the dual objective at a feasible point, and so at least what
        ``x`` lacks to the optimum.

        The dual is: maximise |y|^2 / 2 - |y - u|^2 / 2 over u with pull(S'u) <= lambda. The
        residual, scaled down until that holds, is such a point.
        """
        r = self.residual(x)
        largest = greatest(self.s.T @ r, self.sign)
        u = r * (self.lam / largest if largest > self.lam else 1.0)
        left = self.y - u
        return self.objective(x) - 0.5 * float(self.y @ self.y - left @ left)

    def violation(self, x: FloatArray) -> float:
        """The greatest violation of the KKT conditions: S'(y - S x) is lambda sign(x) where x is
        not zero and pulls with at most lambda where it is; the sign rule holds."""
        g = self.s.T @ self.residual(x)
        moved = np.abs(g - self.lam * np.sign(x))[x != 0]
        still = pull(g, self.sign)[x == 0] - self.lam
        wrong = {"increase": -x, "decrease": x, "both": np.zeros(1)}[self.sign]
        return float(max(moved.max(initial=0.0), still.max(initial=0.0), wrong.max(initial=0.0)))

    def fista(
        self,
        iterations: int,
        lipschitz: float,
        start: FloatArray | None = None,
        gap: float = 0.0,
        every: int = 1,
    ) -> tuple[FloatArray, int]:
        """Return x (n,) after the given number of iterations of FISTA with steps of 1 / lipschitz,
        and their number. With ``gap`` > 0 there are fewer if the duality gap, which is checked at
        intervals, is at most ``gap``.

        Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183, doi 10.1137/080716542.
        """
        x = np.zeros(self.s.shape[1]) if start is None else start
        z, t = x, 1.0
        for k in range(1, iterations + 1):
            step = z + self.s.T @ self.residual(z) / lipschitz
            x_next = shrink(step, self.lam / lipschitz, self.sign)
            t_next = (1 + np.sqrt(1 + 4 * t**2)) / 2
            z = x_next + (t - 1) / t_next * (x_next - x)
            x, t = x_next, t_next
            if gap > 0 and k % every == 0 and self.gap(x) <= gap:
                return x, k
        return x, iterations

    def optimum(self) -> FloatArray:
        """x (n,) at the optimum, by the active set of Lawson and Hanson (Solving Least Squares
        Problems, 1974, chapter 23) with the linear term lambda."""
        if self.sign != "both":
            turn = -1.0 if self.sign == "decrease" else 1.0
            return turn * _non_negative(turn * self.s, self.y, self.lam)
        halves = _non_negative(np.hstack([self.s, -self.s]), self.y, self.lam)
        return np.asarray(np.subtract(*np.split(halves, 2)))


def _non_negative(s: FloatArray, y: FloatArray, lam: float) -> FloatArray:
    """argmin over x >= 0 of |y - S x|^2 / 2 + lam sum x."""
    x, active = np.zeros(s.shape[1]), np.zeros(s.shape[1], dtype=bool)
    least = PROGRESS * max(float(np.abs(s.T @ y).max()), lam)
    refused: set[int] = set()
    for _ in range(MAX_CHANGES):
        gain = s.T @ (y - s @ x) - lam
        gain[active | np.isin(np.arange(len(x)), list(refused))] = -np.inf
        if not gain.max() > least:
            return x
        new = int(np.argmax(gain))
        active[new] = True
        while active.any():
            columns = s[:, active]
            best, *_ = np.linalg.lstsq(columns.T @ columns, columns.T @ y - lam, rcond=None)
            if best.min() > 0:
                x[active] = best
                break
            now = x[active]
            down = best <= 0
            share = float((now[down] / np.maximum(now[down] - best[down], 1e-300)).min())
            x[active] = np.maximum(now + share * (best - now), 0.0)
            gone = np.flatnonzero(active)[down & (x[active] <= 1e-14 * x.max(initial=0.0))]
            x[gone], active[gone] = 0.0, False
        # a column that went at once cannot improve on the others: rounding had asked for it
        refused = refused | {new} if not active[new] else set()
    return x
