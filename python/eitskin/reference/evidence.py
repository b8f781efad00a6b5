"""The numpy reference of csrc/src/evidence: which of the fitted discs are touches, given what the
model itself may be wrong by; the same steps, written for reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from eitskin.core.constants_table import (
    CLEAR,
    CLEAR_AS_DISCS,
    DIPOLE_PRECISION,
    FITS,
    FITS_AS_DISCS,
    FREE_PRECISION,
    LEAST_CHANGE,
    MAX_MOVE,
    MAX_RADIUS_MOVE,
    MERGE_REACH,
    MIN_FREEDOM,
    MIN_PIVOT,
    MOST_CHANGE,
    PAIR_MISFIT,
    REFIT_STEPS,
    SETTLED_MISFIT,
    SHAPE_PRECISION,
    SHORTER,
    TEST_COLUMNS,
    TOUCH_EVIDENCE,
)
from eitskin.reference.disc_fit import Disc, Fit
from eitskin.reference.pair import pair_scores
from eitskin.reference.split_merge import merged

FloatArray = npt.NDArray[np.float64]

# what a disc's parameters are: strength (relative), x, y (pixels), radius (over the fitted one),
# two of an ellipse's edge and two of its dipole
PLACE, EDGE, ALL = 4, 6, 8
MAX_COLUMNS = 64
PRECISION = np.array([FREE_PRECISION] * 3 + [SHAPE_PRECISION] * 3 + [DIPOLE_PRECISION] * 2)


@dataclass(frozen=True, eq=False)
class DataErrors:
    """What a frame's data y (r,) may be wrong by: covariances ``error`` (r, r), of noise and of
    model errors, and ``drift`` (r, r), of a skin that drifts; ``dipoles`` gives what a disc adds to
    y as a dipole that turns (2, r), None where the model cannot tell. ``distance``: of the
    reference from the model's, rms over folds of log(v0 / v_ref). ``kept``: so many discs stay,
    whatever the data say of them."""

    error: FloatArray
    drift: FloatArray
    dipoles: Callable[[Disc], FloatArray] | None
    distance: float = 0.0
    kept: int = 0


@dataclass(frozen=True, eq=False)
class Tested:
    """For each disc that stays, minus twice the logarithm of the ratio of likelihoods without and
    with it (k,), the covariance xx, xy, yy of its place (k, 3), mm^2, where the test would have it
    less where it is (k, 2), mm, and the log odds that it is two touches (k,)."""

    rise: FloatArray
    place_mm2: FloatArray
    apart_mm: FloatArray
    pair: FloatArray


@dataclass(frozen=True, eq=False)
class Answer:
    """One answer to how many touches there are: discs, the radii (k,) about which the prior holds
    theirs, ``shape`` (k, 4) how much of each edge and dipole term there is, and F."""

    discs: list[Disc]
    radius_mm: FloatArray
    shape: FloatArray
    parameters: int
    misfit: float = 0.0

    def offsets(self) -> FloatArray:
        """How far each parameter is from its prior's middle (k, parameters)."""
        radius = np.array([disc.radius_mm for disc in self.discs]) / self.radius_mm - 1
        free = np.zeros((len(self.discs), PLACE - 1))
        return np.column_stack([free, radius, self.shape])[:, : self.parameters]


@dataclass(eq=False)
class Likelihood:
    """F linearised: F ``here``, the ``least`` at the minimum, the ``step`` to it (n,) and the
    ``inverse`` of its matrix (n, n)."""

    here: float
    least: float
    step: FloatArray
    inverse: FloatArray

    def hold(self, offsets: FloatArray, k: int) -> tuple[slice, FloatArray, FloatArray]:
        """Disc k's own rows of the inverse, the Cholesky factor L of their block, and w = L^-1 q, q
        how far its parameters are from where there is no such disc; F rises by |w|^2 without it."""
        own = slice(k * offsets.shape[1], (k + 1) * offsets.shape[1])
        lower = held_cholesky(self.inverse[own, own])
        absent = -offsets[k]
        absent[0] = -1.0
        return own, lower, np.linalg.solve(lower, self.step[own] - absent)

    def rise(self, offsets: FloatArray, k: int) -> float:
        """What F rises by without disc k."""
        w = self.hold(offsets, k)[2]
        return float(w @ w)

    def drop(self, offsets: FloatArray, k: int) -> None:
        """Leave disc k out; its own step and inverse are of no use any more."""
        own, lower, w = self.hold(offsets, k)
        rows = np.linalg.solve(lower, self.inverse[own])
        self.least += float(w @ w)
        self.step = self.step - rows.T @ w
        self.inverse = self.inverse - rows.T @ rows


def held_cholesky(matrix: FloatArray) -> FloatArray:
    """L of ``matrix`` = L L' (n, n), where rounding leaves no pivot below MIN_PIVOT of its diagonal
    element."""
    lower = np.zeros_like(matrix)
    for i, diagonal in enumerate(np.diag(matrix)):
        if i > 0:
            lower[i, :i] = np.linalg.solve(lower[:i, :i], matrix[i, :i])
        lower[i, i] = np.sqrt(max(diagonal - lower[i, :i] @ lower[i, :i], MIN_PIVOT * diagonal))
    return lower


def parameters_of(fit: Fit, errors: DataErrors, count: int) -> int:
    """How many parameters each of ``count`` discs gets."""
    room, all_ = min(fit.model.rank, MAX_COLUMNS), ALL if errors.dipoles is not None else EDGE
    if count * all_ <= room:
        return all_
    return PLACE if count * PLACE <= room else 0


def is_near(a: Disc, b: Disc) -> bool:
    """Whether two discs may be one touch."""
    distance = np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm)
    return a.polarity == b.polarity and bool(distance < MERGE_REACH * (a.radius_mm + b.radius_mm))


class Hypothesis:
    """The discs under one covariance, with drift or without, and which of them stay."""

    def __init__(self, fit: Fit, errors: DataErrors, *, drift: bool) -> None:
        self.fit, self.errors, count = fit, errors, len(fit.discs)
        lower = held_cholesky(errors.error + errors.drift if drift else errors.error)
        self.log_determinant = 2 * float(np.log(np.diag(lower)).sum())
        self.whitening = np.linalg.inv(lower)
        if len(fit.basis):  # the gain's drift, projected out of y: in this metric once more
            along = self.whitening @ fit.basis[0]
            along /= np.linalg.norm(along)
            self.whitening = self.whitening - np.outer(along, along @ self.whitening)
        self.data = self.whitening @ fit.data
        self.answer = Answer(
            list(fit.discs),
            np.array([disc.radius_mm for disc in fit.discs]),
            np.zeros((count, ALL - PLACE)),
            parameters_of(fit, errors, count),
        )
        self.changed = self.clear = False
        self.columns_made = 0
        self.rise, self.place_mm2 = np.zeros(count), np.zeros((count, 3))
        self.best_mm, self.pair = np.zeros((count, 2)), np.zeros(count)

    @property
    def evidence(self) -> float:
        """F + threshold n + log det Sigma."""
        answer = self.answer
        return answer.misfit + TOUCH_EVIDENCE * len(answer.discs) + self.log_determinant

    # ---- F and the discs that make it least ----

    def columns(self, answer: Answer, k: int) -> FloatArray:
        """What each parameter of disc k moves the data by (parameters, r)."""
        disc, pixel = answer.discs[k], self.fit.model.grid.pixel_mm
        unit = np.array(
            [1, pixel, pixel, answer.radius_mm[k], disc.radius_mm, disc.radius_mm]
        )  # fmt: skip
        columns = (disc.change * unit)[:, None] * self.fit.shaped(disc)
        if answer.parameters == ALL and self.errors.dipoles is not None:
            columns = np.vstack([columns, self.errors.dipoles(disc)])
        return np.asarray(columns[: answer.parameters] @ self.whitening.T)

    def linearise(self, answer: Answer) -> Likelihood:
        """F about ``answer``."""
        columns = np.vstack([self.columns(answer, k) for k in range(len(answer.discs))])
        self.columns_made += len(columns)
        offsets = answer.offsets()
        parts = offsets.copy()  # how much of each column there is
        parts[:, :PLACE] = 1, 0, 0, 0
        left, off = self.data - parts.ravel() @ columns, offsets.ravel()
        precision = np.tile(PRECISION[: answer.parameters], len(answer.discs))
        here = float(left @ left + precision @ off**2)
        gradient = columns @ left - precision * off
        root = np.linalg.inv(held_cholesky(columns @ columns.T + np.diag(precision)))
        inverse = root.T @ root
        step = inverse @ gradient
        return Likelihood(here, here - float(gradient @ step), step, inverse)

    def moved(self, answer: Answer, step: FloatArray, fraction: float) -> Answer:
        """``answer`` a ``fraction`` of ``step`` (n,) further."""
        o, pixel, discs = self.fit.options, self.fit.model.grid.pixel_mm, list(answer.discs)
        steps = step.reshape(len(discs), answer.parameters)
        for k, (disc, s) in enumerate(zip(discs, steps, strict=True)):
            grown = np.clip(
                answer.radius_mm[k] * s[3], -MAX_RADIUS_MOVE * pixel, MAX_RADIUS_MOVE * pixel
            )
            x, y = fraction * pixel * np.clip(s[1:3], -MAX_MOVE, MAX_MOVE)
            disc = replace(
                disc,
                change=disc.change
                * (1 + fraction * float(np.clip(s[0], LEAST_CHANGE, MOST_CHANGE))),
            )
            there = replace(
                disc,
                x_mm=disc.x_mm + float(x),
                y_mm=disc.y_mm + float(y),
                radius_mm=float(
                    np.clip(
                        disc.radius_mm + fraction * grown,
                        o.touch_min_radius_mm,
                        o.touch_max_radius_mm,
                    )
                ),
            )
            discs[k] = there if self.fit.on_skin(there) else disc
        shape = answer.shape.copy()
        shape[:, : answer.parameters - PLACE] += fraction * np.clip(steps[:, PLACE:], -1, 1)
        return replace(answer, discs=discs, shape=shape)

    def refit(self, answer: Answer, enough: float = 0.0) -> Answer:
        """Gauss and Newton's steps, a few at most, until F is ``enough`` or hardly falls; sets its
        misfit."""
        if not answer.discs:
            return replace(answer, misfit=float(self.data @ self.data))
        now, fraction = self.linearise(answer), 1.0
        for _ in range(REFIT_STEPS):
            if now.here <= enough or now.here - now.least < SETTLED_MISFIT:
                break
            trial = self.moved(answer, now.step, fraction)
            after = self.linearise(trial)
            if after.here < now.here:
                answer, now, fraction = trial, after, 1.0
            else:
                fraction *= SHORTER
        return replace(answer, misfit=now.here)

    # ---- simpler answers ----

    def excess(self, misfit: float, count: int) -> float:
        """How much worse the data fit than Sigma says; at least 1."""
        free = len(self.data) - len(self.fit.basis) - PLACE * count
        return max(1.0, misfit / max(free, MIN_FREEDOM))

    def needed(self) -> float:
        """What F is to rise by without a touch."""
        return TOUCH_EVIDENCE * self.excess(self.answer.misfit, len(self.answer.discs))

    def near_pairs(self) -> list[tuple[int, int]]:
        """Pairs i < j of near discs, one of them worth little beside the other, by j and then i."""
        discs, weak = self.answer.discs, self.rise < CLEAR_AS_DISCS * self.needed()
        return [
            (i, j)
            for j in range(len(discs))
            for i in range(j)
            if (weak[i] or weak[j]) and is_near(discs[i], discs[j])
        ]

    def without(self, answer: Answer, k: int) -> Answer:
        """``answer`` without disc k."""
        discs = answer.discs[:k] + answer.discs[k + 1 :]
        return replace(
            answer,
            discs=discs,
            radius_mm=np.delete(answer.radius_mm, k),
            shape=np.delete(answer.shape, k, axis=0),
            parameters=max(answer.parameters, parameters_of(self.fit, self.errors, len(discs))),
        )

    def as_one(self, answer: Answer, i: int, j: int) -> Answer:
        """Discs i < j as one of the same strength."""
        a, b, to = answer.discs[i], answer.discs[j], self.without(answer, j)
        one = merged(self.fit.options, a, b)
        strength = a.change * a.radius_mm**2 + b.change * b.radius_mm**2
        to.discs[i] = replace(one, change=strength / one.radius_mm**2)
        to.radius_mm[i], to.shape[i] = one.radius_mm, 0.0
        return to

    def look(self, *, fitted: bool) -> tuple[int, Likelihood]:
        """Linearise, and set what is known of each disc by it; returns the weakest."""
        now, answer = self.linearise(self.answer), self.answer
        if not fitted:
            self.answer = answer = replace(answer, misfit=now.least)
        offsets, count, p = answer.offsets(), len(answer.discs), answer.parameters
        unit = self.fit.model.grid.pixel_mm**2 * self.excess(answer.misfit, count)
        x = p * np.arange(count) + 1
        self.place_mm2 = unit * np.column_stack(
            [now.inverse[x, x], now.inverse[x, x + 1], now.inverse[x + 1, x + 1]]
        )
        self.best_mm = np.array([(disc.x_mm, disc.y_mm) for disc in answer.discs])
        self.best_mm += self.fit.model.grid.pixel_mm * now.step.reshape(count, p)[:, 1:3]
        self.pair = pair_scores(offsets, now.step, np.diag(now.inverse))
        self.rise = np.array([now.rise(offsets, k) for k in range(count)])
        return int(np.argmin(self.rise)), now

    def drop_linearly(self, now: Likelihood) -> list[int]:
        """Which discs stay where whatever the linearisation can do without is left out, one after
        another."""
        offsets, left = self.answer.offsets(), list(range(len(self.answer.discs)))
        while len(left) > self.errors.kept:
            rises = [now.rise(offsets, k) for k in left]
            weakest = int(np.argmin(rises))
            if not rises[weakest] < TOUCH_EVIDENCE * self.excess(now.least, len(left)):
                break
            now.drop(offsets, left.pop(weakest))
        return left

    def take_linear(self, left: list[int]) -> bool:
        """Take the discs that are ``left``, fitted again, where F has risen by no more than the
        others were found to be worth."""
        rest, dropped = self.answer, len(self.answer.discs) - len(left)
        for k in reversed(range(len(self.answer.discs))):
            if k not in left:
                rest = self.without(rest, k)
        rest = self.refit(rest)
        allowed = TOUCH_EVIDENCE * self.excess(rest.misfit, len(left))
        return self.take(rest, allowed * dropped)

    def take_simpler(self, weakest: int) -> bool:
        """Take the best of the answers with one disc less: without the weakest, or with a near pair
        as one."""
        enough = self.answer.misfit + self.needed()
        best = self.refit(self.without(self.answer, weakest), enough)
        for i, j in self.near_pairs():
            one = self.refit(self.as_one(self.answer, i, j), enough)
            best = one if one.misfit < best.misfit else best
        return self.take(best, self.needed())

    def take(self, simpler: Answer, allowed: float) -> bool:
        """Take a ``simpler`` answer where F rises by less than is ``allowed``."""
        if not simpler.misfit - self.answer.misfit < allowed:
            return False
        self.answer, self.changed = simpler, True
        return True

    def eliminate(self) -> None:
        """From the discs as they are to those that stay."""
        fitted, linear = False, True
        while len(self.answer.discs) > self.errors.kept:
            weakest, now = self.look(fitted=fitted)
            if self.rise[weakest] > CLEAR * self.needed() and not self.near_pairs():
                return
            if linear:
                left = self.drop_linearly(now)
                if len(left) < len(self.answer.discs):
                    linear = self.take_linear(left)
                    fitted = linear or fitted
                    continue
            if self.columns_made > TEST_COLUMNS:
                return
            if not fitted:
                self.answer = self.refit(self.answer)
                weakest, _ = self.look(fitted=True)
                fitted = True
            if not self.take_simpler(weakest):
                return
        self.answer = self.refit(self.answer)
        if self.answer.discs:  # on an instrument that is far from the model one stays
            self.look(fitted=True)

    def is_clear(self) -> bool:
        """Whether the discs need no closer look, as discs: what that costs least."""
        parameters = self.answer.parameters
        self.answer = replace(self.answer, parameters=PLACE)
        weakest, _ = self.look(fitted=False)
        excess = self.excess(self.answer.misfit, len(self.answer.discs))
        clear = self.rise[weakest] > CLEAR_AS_DISCS * self.needed() and not self.near_pairs()
        self.clear = clear and excess < FITS_AS_DISCS
        self.answer = replace(self.answer, parameters=parameters)
        rank = self.fit.model.rank
        if self.clear and parameters > PLACE and self.answer.misfit > PAIR_MISFIT * rank:
            now = self.linearise(self.answer)
            self.pair = pair_scores(self.answer.offsets(), now.step, np.diag(now.inverse))
        return self.clear


def keep_likely(fit: Fit, errors: DataErrors) -> Tested | None:
    """Drop and merge discs of ``fit`` that model errors could have made; what is known of those
    that stay, None where there is no room to test so many."""
    if not fit.discs or not parameters_of(fit, errors, len(fit.discs)):
        return None
    best = Hypothesis(fit, errors, drift=False)
    if not best.is_clear():
        best.eliminate()
        if best.excess(best.answer.misfit, len(best.answer.discs)) > FITS:
            drifted = Hypothesis(fit, errors, drift=True)
            drifted.eliminate()
            best = drifted if drifted.evidence < best.evidence else best
    count = len(best.answer.discs)
    unit = best.excess(best.answer.misfit, count)
    if best.changed:
        fit.discs = list(best.answer.discs)
    reported = np.array([(disc.x_mm, disc.y_mm) for disc in fit.discs]).reshape(-1, 2)
    return Tested(
        best.rise[:count] / unit,
        best.place_mm2[:count],
        best.best_mm[:count] - reported,
        best.pair[:count],
    )
