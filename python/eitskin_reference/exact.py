"""Active set of the numpy reference: the C core's rules, written for reading.

csrc/src/solve/active_set.c says where the method is from. The columns' products are solved with
again at each step; the core keeps a factor of them up to date.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin_reference.constants_table import (
    EPSILON,
    INDEPENDENT,
    LOOKS_NEARBY,
    MAX_RISE,
    MAX_STALLS,
    TOLERANCE_EPSILONS,
    WORTHWHILE,
)
from eitskin_reference.fista import fista
from eitskin_reference.problem import Problem, SolveResult


@dataclass
class Held:
    """The columns of the active set in the order they came, with coefficient, sign and pull
    (correlation less lambda sign)."""

    columns: list[int] = field(default_factory=list)
    x: list[float] = field(default_factory=list)
    sign: list[float] = field(default_factory=list)
    pull: list[float] = field(default_factory=list)

    def take(self, column: int, x: float, sign: float, pull: float) -> None:
        """Append one."""
        self.columns.append(column)
        self.x.append(x)
        self.sign.append(sign)
        self.pull.append(pull)

    def drop(self, place: int) -> None:
        """Leave one out."""
        del self.columns[place], self.x[place], self.sign[place], self.pull[place]

    def spread(self, n: int) -> FloatArray:
        """Coefficients (n,) of all columns."""
        whole = np.zeros(n)
        whole[self.columns] = self.x
        return whole


class ActiveSet:
    """One solve by the active set."""

    def __init__(self, problem: Problem, options: Options, grid: Grid, lipschitz: float) -> None:
        self.p, self.options, self.held, self.lipschitz = problem, options, Held(), lipschitz
        self.most = min(len(problem.y) - len(problem.basis), problem.n)
        self.tolerance = (
            TOLERANCE_EPSILONS * EPSILON * np.sqrt(lipschitz) * float(np.linalg.norm(problem.y))
        )
        self.near = neighbours(grid)
        self.nearby = np.zeros(problem.n + 1, dtype=bool)  # the last is no pixel

    def _left(self, j: int) -> tuple[float, float, FloatArray]:
        """The square of column ``j``'s part that counts (0: rounding), what the columns held leave
        of it, and the combination of them that comes nearest to it."""
        seen, held = self.p.seen[:, j], self.p.seen[:, self.held.columns]
        square = float(seen @ seen)
        if not square > INDEPENDENT * float(self.p.s[:, j] @ self.p.s[:, j]):
            return 0.0, 0.0, np.zeros(0)
        nearest = np.linalg.solve(held.T @ held, held.T @ seen)
        rest = seen - held @ nearest
        return square, float(rest @ rest), np.asarray(nearest, dtype=np.float64)

    def _begin(self, start: FloatArray) -> None:
        for j in map(int, np.flatnonzero(start)):
            if len(self.held.columns) < self.most:
                square, left, _ = self._left(j)
                if square > 0 and left > INDEPENDENT * square:
                    self.held.take(j, float(start[j]), float(np.sign(start[j])), 0.0)

    def _exchange(self, sign: float, pull: float, nearest: FloatArray) -> float:
        """Move along what leaves S x as it is until a coefficient is zero; 0 where that does not
        lower the objective."""
        held = self.held
        direction = -sign * nearest
        slope = sign * pull + float(direction @ np.array(held.pull))
        reach = [
            x / -d if d * s < 0 else np.inf
            for x, d, s in zip(held.x, direction, held.sign, strict=True)
        ]
        place = int(np.argmin(reach)) if reach else 0
        if not slope > 0 or not reach or reach[place] == np.inf:
            return 0.0
        held.x = [x + reach[place] * d for x, d in zip(held.x, direction, strict=True)]
        shortest = float(reach[place])
        held.drop(place)
        return shortest

    def _add(self, j: int, gradient: float) -> bool:
        """Take column ``j`` in; False where that failed half way."""
        sign = 1.0 if gradient > 0 else -1.0
        pull, x = gradient - sign * self.p.lam, 0.0
        while True:
            square, left, nearest = self._left(j)
            if not square > 0:
                return True
            if len(self.held.columns) < self.most and left > INDEPENDENT * square:
                self.held.take(j, sign * x, sign, pull)
                return True
            count = len(self.held.columns)
            x += self._exchange(sign, pull, nearest)
            if len(self.held.columns) == count:
                break
        if x != 0:
            self.held.take(j, sign * x, sign, pull)
        return x == 0

    def _settle(self) -> bool:
        """Newton's steps to the optimum of the columns held; whether anything moved."""
        held, moved = self.held, False
        while held.columns:
            seen = self.p.seen[:, held.columns]
            step = np.linalg.solve(seen.T @ seen, np.array(held.pull))
            x, sign = np.array(held.x), np.array(held.sign)
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = np.where(sign * (x + step) > 0, 2.0, np.where(x == 0, 0.0, -x / step))
            share = min(1.0, float(reach.min()))
            held.x, held.pull = list(x + share * step), list((1 - share) * np.array(held.pull))
            moved = moved or share > 0
            out = [k for k in range(len(reach)) if reach[k] <= share]
            for k in reversed(out):
                held.drop(k)
            if not out:
                break
        return moved

    def _missing(self, gradient: FloatArray) -> list[int]:
        """Columns to take in, greatest correlation first: the peaks of those beyond lambda that are
        not held."""
        beyond = {"increase": gradient, "decrease": -gradient, "both": np.abs(gradient)}[
            self.p.sign
        ]
        padded = np.append(beyond, -np.inf)
        others = padded[self.near]
        higher = (others > beyond[:, None]) | (
            (others == beyond[:, None]) & (self.near < np.arange(self.p.n)[:, None])
        )
        peaks = np.flatnonzero((beyond > self.p.lam + self.tolerance) & ~higher.any(axis=1))
        return [int(j) for j in peaks[np.argsort(-beyond[peaks], kind="stable")]]

    def _take_in(self, columns: list[int], gradient: FloatArray) -> tuple[bool, bool]:
        """Take ``columns`` in and step to the optimum with them; whether anything moved, and
        whether that failed half way."""
        before = self.held.spread(self.p.n)
        failed = any(not self._add(j, float(gradient[j])) for j in columns)
        moved = not failed and self._settle()
        return moved or bool((self.held.spread(self.p.n) != before).any()), failed

    def _look_nearby(self, objective: float) -> tuple[float, bool, bool]:
        """Columns beside those held so far, if the last step was worth it: objective, whether any
        moved, whether it failed."""
        p, held = self.p, self.held
        residual = p.residual(held.spread(p.n))
        now = 0.5 * float(residual @ residual) + p.lam * float(np.abs(held.x).sum())
        if not now < objective * (1 - WORTHWHILE):
            return objective, False, False
        self.nearby[held.columns] = True
        self.nearby[self.near[held.columns]] = True
        gradient = np.where(self.nearby[:-1], p.s.T @ residual, 0.0)
        held.pull = [
            float(gradient[j]) - s * p.lam for j, s in zip(held.columns, held.sign, strict=True)
        ]
        gradient[held.columns] = 0.0
        missing = self._missing(gradient)
        return (now, *self._take_in(missing, gradient)) if missing else (now, False, False)

    def run(self, start: FloatArray | None) -> SolveResult:
        """Rounds until something ends them; if they fail, FISTA continues."""
        p, o, held = self.p, self.options, self.held
        if start is not None:
            self._begin(start)
        c, gradient = p.check_gap(held.spread(p.n))
        if start is not None and not c.objective < p.ceiling:
            self.held = held = Held()
            c, gradient = p.check_gap(np.zeros(p.n))
        rounds, stalls = 0, 0
        while True:
            if o.gap_rel > 0 and c.gap <= o.gap_rel * p.scale:
                return SolveResult(held.spread(p.n), rounds, "gap", c, 0)
            if rounds == o.iterations:
                return SolveResult(held.spread(p.n), rounds, "iterations", c, 0)
            held.pull = [
                float(gradient[j]) - s * p.lam for j, s in zip(held.columns, held.sign, strict=True)
            ]
            pull, before = max(map(abs, held.pull), default=0.0), c.objective
            gradient[held.columns] = 0.0
            missing = self._missing(gradient)
            if stalls == MAX_STALLS or (not missing and pull <= self.tolerance):
                return SolveResult(held.spread(p.n), rounds, "optimum", c, 0)
            rounds += 1
            moved, failed = self._take_in(missing[: 1 if stalls else None], gradient)
            objective, looks, more = c.objective, 0, moved and not failed
            while more and looks < LOOKS_NEARBY:
                objective, more, failed = self._look_nearby(objective)
                looks, more = looks + 1, more and not failed
            if moved:
                c, gradient = p.check_gap(held.spread(p.n))
            if failed or not c.objective <= before * (1 + MAX_RISE):
                x = held.spread(p.n) if c.objective <= p.ceiling else np.zeros(p.n)
                if rounds == o.iterations:
                    return SolveResult(x, rounds, "iterations", p.check_gap(x)[0], 0)
                left = replace(o, iterations=o.iterations - rounds)
                more = fista(p.s, p.y, p.lam, self.lipschitz, left, p.basis, x)
                return replace(more, iterations=rounds + more.iterations)
            stalls = 0 if c.objective < before * (1 - EPSILON) else stalls + 1
            stalls = stalls if moved else MAX_STALLS


def neighbours(grid: Grid) -> IntArray:
    """The up to eight neighbours of each kept pixel (n, 8); n where there is none."""
    number = np.pad(grid.number, 1, constant_values=-1)
    rows, columns = np.nonzero(number >= 0)
    order = np.argsort(number[rows, columns])
    rows, columns = rows[order], columns[order]
    around = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)]
    near = np.stack([number[rows + dy, columns + dx] for dy, dx in around], axis=1)
    return np.where(near < 0, grid.n_pixels, near).astype(np.int64)
