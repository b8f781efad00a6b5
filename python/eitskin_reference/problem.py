"""The problem that the numpy reference's solvers share, float64: minimise |Q (y - S x)|^2 / 2 +
lambda |x|_1."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_reference.constants_table import BASIS_TOLERANCE, MAX_RISE


def shrink(v: FloatArray, threshold: float, sign: str) -> FloatArray:
    """The proximal step of threshold |x|_1 under the sign rule."""
    up, down = np.maximum(v - threshold, 0.0), np.minimum(v + threshold, 0.0)
    if sign == "increase":
        return up
    return down if sign == "decrease" else up + down


def greatest(g: FloatArray, sign: str) -> float:
    """The greatest correlation under the sign rule, not below 0."""
    value = {"increase": g.max(), "decrease": -g.min(), "both": np.abs(g).max()}[sign]
    return max(0.0, float(value))


def project(v: FloatArray, basis: FloatArray) -> FloatArray:
    """``v`` (r,) without its part in the span of the orthonormal rows of ``basis`` (k, r)."""
    return v - basis.T @ (basis @ v)


def orthonormal(
    candidates: Iterable[FloatArray], rank: int, least: float = BASIS_TOLERANCE
) -> FloatArray:
    """An orthonormal basis (k, r) of the span of ``candidates`` (each (r,)), in their order; not of
    those of whose square others have all but ``least``."""
    rows = np.zeros((0, rank))
    for candidate in candidates:
        before = float(candidate @ candidate)
        v = project(project(candidate, rows), rows)
        after = float(v @ v)
        if len(rows) < rank and before > 0 and after > least * before:
            rows = np.vstack([rows, v / np.sqrt(after)])
    return rows


class Certificate(NamedTuple):
    """Duality gap, objective and |residual| at a point."""

    gap: float
    objective: float
    residual: float


def check_gap(
    s: FloatArray,
    y: FloatArray,
    x: FloatArray,
    sx: FloatArray,
    lam: float,
    sign: str,
    basis: FloatArray,
) -> Certificate:
    """Duality gap, objective and |residual| at ``x``; the formula is in
    csrc/src/solve/duality_gap.c."""
    residual = project(y - sx, basis)
    correlation = s.T @ residual
    largest = greatest(correlation, sign)
    scale = lam / largest if largest > lam else 1.0
    slack = np.maximum(lam * np.abs(x) - scale * x * correlation, 0.0)
    squared = float(residual @ residual)
    gap = 0.5 * (1 - scale) ** 2 * squared + float(slack.sum())
    return Certificate(gap, 0.5 * squared + lam * float(np.abs(x).sum()), squared**0.5)


@dataclass(frozen=True, eq=False)
class Problem:
    """S (r, n), data y (r,), lambda, sign rule, and the directions that the model_mismatch ignores,
    orthonormal rows (k, r)."""

    s: FloatArray
    y: FloatArray
    lam: float
    sign: str
    basis: FloatArray

    @property
    def n(self) -> int:
        """Coefficients."""
        return int(self.s.shape[1])

    @property
    def scale(self) -> float:
        """|y|^2 / 2: the objective at zero."""
        return 0.5 * float(self.y @ self.y)

    @property
    def ceiling(self) -> float:
        """What the objective may not exceed, with room for rounding."""
        return self.scale * (1 + MAX_RISE)

    @cached_property
    def seen(self) -> FloatArray:
        """Q S, (r, n)."""
        return self.s - self.basis.T @ (self.basis @ self.s)

    def residual(self, x: FloatArray) -> FloatArray:
        """Q (y - S x)."""
        return project(self.y - self.s @ x, self.basis)

    def check_gap(self, x: FloatArray) -> tuple[Certificate, FloatArray]:
        """The certificate at ``x`` and the correlation of every column."""
        certificate = check_gap(self.s, self.y, x, self.s @ x, self.lam, self.sign, self.basis)
        return certificate, self.s.T @ self.residual(x)


@dataclass(frozen=True, eq=False)
class SolveResult:
    """Coefficients ``x`` (n,), and how it went; the certificate is that of ``x``."""

    x: FloatArray
    iterations: int
    stop: str
    certificate: Certificate
    step_halvings: int
