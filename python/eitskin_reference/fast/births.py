"""New touches by a matched filter over the drives that wait for an explanation: the numpy reference
of csrc/src/fast/births.c.

Each drive has a strength of its own, since a touch that lands grows from drive to drive; only the
place is common (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin_reference.constants_table import (
    FAST_ANSWERS,
    FAST_APART_MM,
    FAST_DAMPING,
    FAST_MAX_STEP_MM,
    FAST_PAIR_DRIVES,
    FAST_PAIR_HELD,
    FAST_SETTLED_MM,
    FAST_SHORTER,
    FAST_SINGULAR,
    FAST_STARTS,
    FAST_STEPS,
    FAST_SUDDEN,
)
from eitskin_reference.fast.rows import Drive, RowModel
from eitskin_reference.fast.tracks import (
    dot,
    lower_factor,
    lower_solve,
    lower_solve_back,
    summed,
)


@dataclass(frozen=True, eq=False)
class Held:
    """A drive that waits, by its place in the scan: its rows ``white`` (r,) with the factor L (r,
    r) that whitened them, which are in ``use`` (r,), and whether it was news."""

    drive: Drive
    white: FloatArray
    factor: FloatArray
    use: BoolArray
    news: bool
    number: int

    @property
    def rows(self) -> int:
        """How many are in use."""
        return int(self.use.sum())

    @property
    def sudden(self) -> bool:
        """Much is unexplained: if it waits first, a touch may have landed within it."""
        return dot(self.white, self.white) > FAST_SUDDEN


@dataclass(frozen=True, eq=False)
class Fit:
    """Touches at ``places`` (k, 2) mm as they explain j drives that wait.

    Attributes:
        strength: in each drive (j, k).
        left: what they leave of each drive's chi^2 (j,).
        score: what they explain of it.
        own: what each does beside the other (k,).
        h, b: the normal equations of moving them (2 k, 2 k) and (2 k,).
        variance: of the strengths in the last drive (k,).
    """

    places: FloatArray
    strength: FloatArray
    left: FloatArray
    score: float
    own: FloatArray
    h: FloatArray
    b: FloatArray
    variance: FloatArray


def inverted(h: FloatArray) -> FloatArray | None:
    """The inverse of a symmetric matrix (n, n); None where it is not well above zero."""
    diagonal = np.diag(h)
    if not (diagonal > 0).all():
        return None
    scale = 1 / np.sqrt(diagonal)
    factor = lower_factor(h * scale[:, None] * scale, np.nan)
    pivots = np.diag(factor)
    if not (pivots * pivots > FAST_SINGULAR).all():
        return None
    half = lower_solve(factor, np.diag(scale))
    return summed(half[:, :, None] * half[:, None, :])


def apart(places: FloatArray, place: FloatArray) -> BoolArray:
    """Which ``places`` (k, 2) are further than FAST_APART_MM from ``place`` (2,)."""
    x, y = (places - place).T
    return np.asarray(x * x + y * y > FAST_APART_MM * FAST_APART_MM)


def strengths(answers: FloatArray, white: FloatArray, sign: float) -> FloatArray:
    """The least squares of ``white`` (r,) by ``answers`` (k, r), k one or two, none of the wrong
    ``sign``, (k,)."""
    gram = [dot(g, g) for g in answers]
    toward = [sign * dot(g, white) for g in answers]
    alone = [a / g if g > 0 and a > 0 else 0.0 for a, g in zip(toward, gram, strict=True)]
    if len(answers) == 2:
        cross, both = dot(answers[0], answers[1]), gram[0] * gram[1]
        det = both - cross * cross
        first = gram[1] * toward[0] - cross * toward[1]
        second = gram[0] * toward[1] - cross * toward[0]
        if det > FAST_SINGULAR * both and first >= 0 and second >= 0:
            alone = [first / det, second / det]
        else:
            alone[0 if alone[0] * toward[0] < alone[1] * toward[1] else 1] = 0.0
    return sign * np.array(alone)


class Births:
    """Looks for touches in drives that wait. ``cells`` (n,) are the pixels that are tried first."""

    def __init__(self, model: RowModel, cells: IntArray, sign: float) -> None:
        self.model, self.cells, self.sign = model, cells, sign
        self._kept: dict[int, FloatArray] = {}
        self.begin()

    def begin(self) -> None:
        """A wait begins: nothing is in the map."""
        self.score, self._last, self._turn = np.zeros(len(self.cells)), np.zeros((0, 2)), 0
        self._beside = np.zeros(len(self.cells))

    def add(self, one: Held) -> None:
        """A drive enters the map."""
        self.score = self.score + self._explained_at_cells(one, np.zeros((0, 2)))

    def one(self, held: list[Held]) -> list[Fit]:
        """Fits of one touch from the map's greatest cells, the best first."""
        fits = self._refined(held, self.score, np.zeros((0, 2)))
        self._last = np.array([fit.places[0] for fit in fits]).reshape(-1, 2)
        return fits

    def map_beside(self, held: list[Held], first: FloatArray) -> None:
        """The map of a second touch beside one at ``first`` (1, 2)."""
        self._beside = np.zeros(len(self.cells))
        for one in held[-FAST_PAIR_DRIVES:]:
            self._beside = self._beside + self._explained_at_cells(one, first)

    def two(self, held: list[Held], first: FloatArray) -> list[Fit]:
        """Fits of that second touch, the best first."""
        return self._refined(held[-FAST_PAIR_HELD:], self._beside, first)

    def _refined(self, held: list[Held], score: FloatArray, places: FloatArray) -> list[Fit]:
        starts = self._peaks(score, places)
        spend = max(1, FAST_ANSWERS // (len(held) * (1 + len(places))))
        steps = [spend // 2 + (spend % 2 if k == self._turn else 0) for k in range(len(starts))]
        self._turn = 1 - self._turn
        for k, start in enumerate(starts if not len(places) else []):
            near = ~apart(self._last, start)
            if near.any():  # where the last search has come to
                start[:] = self._last[int(np.argmax(near))]
            else:  # which takes a step's work to look at
                steps[k] -= steps[k] > 0
        fits = [
            self._refine(held, np.vstack([places, start]), min(FAST_STEPS, number))
            for start, number in zip(starts, steps, strict=True)
        ]
        return sorted((fit for fit in fits if fit is not None), key=lambda fit: -fit.score)

    def _explained_at_cells(self, one: Held, places: FloatArray) -> FloatArray:
        """About what a touch at each cell (n,) would explain of a drive's chi^2, beside one at
        ``places`` (0 or 1, 2): with the diagonal of the factor where squares are asked for."""
        seen, per = self._at_cells(one.drive), one.use / np.diag(one.factor)
        left, own = one.white, self.model.squares(one.drive, seen, per)
        for place in places:
            known = np.where(one.use, self.model.answer(one.drive, *place)[0][0], 0.0)
            white = lower_solve(one.factor, known)
            energy, over = dot(white, white), known * per * per
            shared = summed(seen * self.model.over_electrodes(one.drive, over), axis=1)
            if dot(over, known) > 0:
                own = own - shared * shared / dot(over, known)
            if energy > 0:
                left = left - dot(white, left) / energy * white
        toward = self.model.over_electrodes(one.drive, lower_solve_back(one.factor, left))
        along = self.sign * summed(seen * toward, axis=1)
        tells = (along > 0) & (own > 0)
        return np.where(tells, along * along / np.where(tells, own, 1.0), 0.0)

    def _at_cells(self, drive: Drive) -> FloatArray:
        """E_drive . E of each electrode at the cells (n, L)."""
        first = int(drive.rows[0])
        if first not in self._kept:
            self._kept[first] = self.model.products(drive, self.cells)
        return self._kept[first]

    def _peaks(self, score: FloatArray, places: FloatArray) -> FloatArray:
        """The greatest cells, apart from each other and from ``places``, (c, 2) mm."""
        score, centres = score.copy(), self.model.centres_mm[self.cells]
        found = np.zeros((0, 2))
        for place in places:
            score[~apart(centres, place)] = 0.0
        while len(found) < FAST_STARTS and score.max() > 0:
            best = centres[int(np.argmax(score))]
            score[~apart(centres, best)] = 0.0
            found = np.vstack([found, best])
        return found

    def fit(self, held: list[Held], places: FloatArray) -> Fit | None:
        """How ``places`` (k, 2) explain ``held``; None where one is off the skin."""
        k, j = len(places), len(held)
        strength, left, own = np.zeros((j, k)), np.zeros(j), np.zeros(k)
        h, b, score, variance = np.zeros((2 * k, 2 * k)), np.zeros(2 * k), 0.0, np.zeros(k)
        for n, one in enumerate(held):
            seen = [self.model.answer(one.drive, *place) for place in places]
            if not all(there for _, there in seen):
                return None
            answers = np.array(
                [lower_solve(one.factor, np.where(one.use, raw, 0.0).T).T for raw, _ in seen]
            )
            g, slopes = answers[:, 0], answers[:, 1:]
            c = strengths(g, one.white, self.sign)
            rest, energy = one.white.copy(), dot(one.white, one.white)
            for i in range(k):
                rest -= c[i] * g[i]
            strength[n], left[n] = c, dot(rest, rest)
            score += energy - left[n]
            for i in range(k):
                without = energy
                if k == 2:  # what the other leaves alone
                    other = g[1 - i]
                    alone = strengths(other[None], one.white, self.sign)[0]
                    without += (alone * dot(other, other) - 2 * dot(other, one.white)) * alone
                own[i] += without - left[n]
            jac, variance = (c[:, None, None] * slopes).reshape(2 * k, -1), np.zeros(k)
            basis: list[FloatArray] = []
            for i in np.flatnonzero(c).tolist():
                free = g[i]
                for unit in basis:
                    free = free - dot(unit, free) * unit
                variance[i] = 1 / dot(free, free)
                basis.append(free * np.sqrt(variance[i]))
            for unit in basis:
                jac = jac - summed(jac * unit, axis=1)[:, None] * unit
            h, b = h + summed(jac[:, None] * jac, axis=2), b + summed(jac * rest, axis=1)
        return Fit(places, strength, left, score, own, h, b, variance)

    def _refine(self, held: list[Held], places: FloatArray, steps: int) -> Fit | None:
        """Damped Gauss-Newton steps from ``places`` (k, 2)."""
        fit, shorter = self.fit(held, places), 1.0
        for _ in range(steps):
            if fit is None:
                return None
            damped = inverted(fit.h + np.diag(FAST_DAMPING * np.diag(fit.h)))
            if damped is None:
                return fit
            step = shorter * summed(damped * fit.b, axis=1).reshape(-1, 2)
            length = float(np.abs(step).max())
            if length > FAST_MAX_STEP_MM:
                step, length = step * (FAST_MAX_STEP_MM / length), FAST_MAX_STEP_MM
            trial = self.fit(held, fit.places + step)
            if trial is not None and trial.score > fit.score:
                fit, shorter = trial, 1.0
            else:
                shorter *= FAST_SHORTER
            if length < FAST_SETTLED_MM:
                return fit
        return fit
