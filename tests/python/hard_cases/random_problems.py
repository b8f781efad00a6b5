"""Matrices and data by seed."""

from dataclasses import dataclass

import numpy as np
from made_models import made_blob, plain_options
from soundness import Judged, judged

from eitskin.core.results import Options
from eitskin.oracle.lasso import greatest
from eitskin_emulator.core_steps import Choose, Load, Solve, Step
from everywhere import Outcome, on_host

RANK, COLUMNS = 20, 64


@dataclass(frozen=True, eq=False)
class RandomProblem:
    """S (r, n), float32 numbers as float64, and data y (r,) likewise."""

    s: np.ndarray
    y: np.ndarray

    def lambda_max(self, sign: str) -> float:
        return greatest(self.s.T @ self.y, sign)

    def options(self, **changes: object) -> Options:
        return plain_options(self.s, **changes)

    def judged(self, sign: str, one: Outcome) -> Judged:
        return judged(self.s, self.y, sign, one)


def rounded(values: np.ndarray) -> np.ndarray:
    return np.asarray(values).astype(np.float32).astype(np.float64)


def with_data(s: np.ndarray, seed: int, noise: float = 0.05) -> RandomProblem:
    """Data of two columns of ``s``, one up, one down, and noise relative to them."""
    rng, n = np.random.default_rng(seed), s.shape[1]
    first, second = s[:, 3 % n], s[:, 40 % n]
    y = first - 0.7 * second
    size = np.linalg.norm(y) or 1.0
    return RandomProblem(rounded(s), rounded(y + noise * size * rng.standard_normal(len(y))))


def gaussian(seed: int, rank: int = RANK, columns: int = COLUMNS) -> RandomProblem:
    """Unit columns in random directions."""
    s = np.random.default_rng(seed).standard_normal((rank, columns))
    return with_data(s / np.linalg.norm(s, axis=0), seed + 1000)


def smooth(
    seed: int, rank: int = RANK, columns: int = COLUMNS, decay: float = 0.8
) -> RandomProblem:
    """Columns that resemble their neighbours, singular values falling by ``decay``: as a Jacobian's
    do."""
    rng = np.random.default_rng(seed)
    left, _ = np.linalg.qr(rng.standard_normal((rank, rank)))
    place = (np.arange(columns) + 0.5) / columns
    right = np.array([np.cos(np.pi * k * place + rng.uniform(0, 1)) for k in range(rank)])
    return with_data(
        left @ (decay ** np.arange(rank)[:, None] * right) / np.sqrt(columns / 2), seed + 1000
    )


def whitened(seed: int) -> RandomProblem:
    """Orthonormal rows: every eigenvalue of S S' is 1."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((COLUMNS, RANK)))
    return with_data(q.T, seed + 1000)


def asked(problem: RandomProblem, options: Options, **model: object) -> list[Step]:
    """A model of the problem's matrix, ``options``, and its data."""
    return [Load(made_blob(problem.s, **model)), Choose(options), Solve(problem.y[None])]


def optimum_of(problem: RandomProblem, sign: str, share: float = 0.03) -> Judged:
    """By the active set in float64, to a gap of 1e-12 of the start's objective; ``share`` is lambda
    / lambda_max."""
    options = problem.options(
        solver="active-set", sign=sign, iterations=1000, gap_rel=1e-12, lambda_rel=share
    )
    return problem.judged(sign, on_host(asked(problem, options), "float64")[1][0])
