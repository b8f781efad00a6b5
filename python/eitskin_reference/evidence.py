"""The numpy reference of csrc/src/evidence: which of the fitted discs are touches, given what the
model itself may be wrong by; the same steps, written for reading."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_reference.constants_table import (
    CLEAR,
    CLEAR_AS_DISCS,
    CLEAR_OF_FEW,
    CLEAR_OF_MANY,
    DIPOLE_PRECISION,
    FEW_DISCS,
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
    REACH_OF_FEW,
    REFIT_STEPS,
    SETTLED_MISFIT,
    SHAPE_COLUMNS,
    SHAPE_PRECISION,
    SHORTER,
    SPLIT_APART,
    SPLIT_COLUMNS,
    SPLIT_HOPE,
    SPLIT_MIN_RISE,
    SPLIT_ODDS,
    SPLIT_RISE,
    SPLIT_RISE_OF_ODDS,
    STILL_COLUMNS,
    STILL_MIN,
    TOUCH_EVIDENCE,
    TRIAL_COLUMNS,
)
from eitskin_reference.disc_fit import Disc, Fit
from eitskin_reference.ellipse import long_axis, placed
from eitskin_reference.pair import pair_lines, pair_scores
from eitskin_reference.places import Corrected
from eitskin_reference.split_merge import merged

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
    reference from the model's, rms over folds of log(v0 / v_ref), ``places`` how they are
    corrected by it. ``kept``: so many discs stay, whatever the data say of them."""

    error: FloatArray
    drift: FloatArray
    dipoles: Callable[[Disc], FloatArray] | None
    distance: float = 0.0
    places: Corrected | None = None
    kept: int = 0


@dataclass(frozen=True, eq=False)
class Tested:
    """For each disc that stays, minus twice the logarithm of the ratio of likelihoods without and
    with it (k,), the covariance xx, xy, yy of its place (k, 3), mm^2, where the test would have it
    less where the disc is (k, 2), mm, the log odds that it is two touches (k,), half of its long
    axis (k, 2), mm, zeros where it is a disc as far as the data tell, and the x, y and radius (k,
    3), mm, that it is reported with. ``spent``: more columns were
    wanted than ``options.test_columns`` allows."""

    rise: FloatArray
    place_mm2: FloatArray
    apart_mm: FloatArray
    pair: FloatArray
    long_mm: FloatArray
    reported_mm: FloatArray
    spent: bool


@dataclass(eq=False)
class Budget:
    """The columns that a frame's test has ``made``, of at most ``most`` in what is being tried and
    ``all`` at last (0: any number), those ``kept`` instead; ``spent``: more were wanted."""

    most: int
    all: int
    made: int = 0
    kept: int = 0
    spent: bool = False

    def allows(self, columns: int) -> bool:
        """Whether so many more may be made. Who linearises asks before, and leaves enough to
        linearise what is taken at last."""
        return self._has(columns, self.most)

    def allows_later(self, columns: int) -> bool:
        """The same of what is tried at last."""
        return self._has(columns, self.all)

    def _has(self, columns: int, most: int) -> bool:
        may = most == 0 or self.made + columns <= most
        self.spent |= not may
        return may


@dataclass(frozen=True, eq=False)
class Answer:
    """One answer to how many touches there are: discs, the radii (k,) about which the prior holds
    theirs, ``shape`` (k, 4) how much of each edge and dipole term there is, and F."""

    discs: list[Disc]
    radius_mm: FloatArray
    shape: FloatArray
    parameters: int
    misfit: float = 0.0

    @property
    def columns(self) -> int:
        """Parameters of all discs."""
        return len(self.discs) * self.parameters

    def offsets(self) -> FloatArray:
        """How far each parameter is from its prior's middle (k, parameters)."""
        radius = np.array([disc.radius_mm for disc in self.discs]) / self.radius_mm - 1
        free = np.zeros((len(self.discs), PLACE - 1))
        return np.column_stack([free, radius, self.shape])[:, : self.parameters]

    def parts(self) -> FloatArray:
        """How much of each parameter's column there is (k, parameters)."""
        parts = self.offsets()
        parts[:, :PLACE] = 1, 0, 0, 0
        return parts

    def prior(self) -> float:
        """The priors' part of F."""
        return float((self.offsets() ** 2 @ PRECISION[: self.parameters]).sum())

    def without(self, k: int) -> "Answer":
        """Without disc k."""
        return replace(
            self,
            discs=self.discs[:k] + self.discs[k + 1 :],
            radius_mm=np.delete(self.radius_mm, k),
            shape=np.delete(self.shape, k, axis=0),
        )


@dataclass(eq=False)
class Likelihood:
    """F linearised about an answer: F ``here``, the ``least`` at the minimum, the ``step`` to it
    (n,), the ``inverse`` of its matrix (n, n), the ``columns`` (n, r), and what the answer ``left``
    of the data (r,). Not ``at_hand``: of the answer before its last step, but for ``here``."""

    here: float
    least: float
    step: FloatArray
    inverse: FloatArray
    columns: FloatArray
    left: FloatArray
    at_hand: bool = True

    def hold(self, answer: Answer, k: int) -> tuple[slice, FloatArray, FloatArray]:
        """Disc k's own rows of the inverse, the Cholesky factor L of their block, and w = L^-1 q, q
        how far its parameters are from where there is no such disc; F rises by |w|^2 without it."""
        own = slice(k * answer.parameters, (k + 1) * answer.parameters)
        lower = held_cholesky(self.inverse[own, own])
        absent = -answer.offsets()[k]
        absent[0] = -1.0
        return own, lower, np.linalg.solve(lower, self.step[own] - absent)

    def rise(self, answer: Answer, k: int) -> float:
        """What F rises by without disc k."""
        w = self.hold(answer, k)[2]
        return float(w @ w)

    def without(self, answer: Answer, k: int) -> "tuple[Answer, Likelihood]":
        """``answer`` without disc k, and F linearised about the others where they are."""
        own, lower, w = self.hold(answer, k)
        rows = np.linalg.solve(lower, self.inverse[own])
        rest, others = answer.without(k), np.delete(np.arange(len(self.step)), own)
        left = self.left + answer.parts().ravel()[own] @ self.columns[own]
        return rest, Likelihood(
            float(left @ left) + rest.prior(),
            self.least + float(w @ w),
            (self.step - rows.T @ w)[others],
            (self.inverse - rows.T @ rows)[np.ix_(others, others)],
            self.columns[others],
            left,
        )


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
    if count * all_ <= min(room, SHAPE_COLUMNS):
        return all_
    return PLACE if count * PLACE <= room else 0


def is_near(a: Disc, b: Disc, reach: float) -> bool:
    """Whether two discs, nearer than so many sums of their radii, may be one touch."""
    distance = np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm)
    return a.polarity == b.polarity and bool(distance < reach * (a.radius_mm + b.radius_mm))


class Hypothesis:
    """The discs under one covariance, with drift or without, and which of them stay."""

    def __init__(self, fit: Fit, errors: DataErrors, budget: Budget, *, drift: bool) -> None:
        self.fit, self.errors, self.budget, count = fit, errors, budget, len(fit.discs)
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
        self.changed = self.clear = self.fitted = False
        self.rise, self.place_mm2 = np.zeros(count), np.zeros((count, 3))
        self.best_mm, self.pair = np.zeros((count, 2)), np.zeros(count)
        self.axis, self.line = np.zeros((count, 2)), np.zeros((count, 2))
        self.here = 0.0
        self.places_made = False  # columns of strength, places and radii are at hand

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
        known = PLACE * len(answer.discs) if self.places_made and answer.parameters > PLACE else 0
        self.places_made = False
        self.budget.made += len(columns) - known
        self.budget.kept += known
        left, off = self.data - answer.parts().ravel() @ columns, answer.offsets().ravel()
        precision = np.tile(PRECISION[: answer.parameters], len(answer.discs))
        here = float(left @ left) + answer.prior()
        gradient = columns @ left - precision * off
        root = np.linalg.inv(held_cholesky(columns @ columns.T + np.diag(precision)))
        inverse = root.T @ root
        step = inverse @ gradient
        return Likelihood(here, here - float(gradient @ step), step, inverse, columns, left)

    def misfit_of(self, answer: Answer) -> float:
        """F of ``answer`` alone, without slopes."""
        columns = np.vstack([self.columns(answer, k) for k in range(len(answer.discs))])
        self.budget.made += TRIAL_COLUMNS * len(answer.discs)
        left = self.data - answer.parts().ravel() @ columns
        return float(left @ left) + answer.prior()

    def about(self, now: Likelihood | None) -> Likelihood:
        """F about the answer: ``now``, if it is at hand."""
        return now if now is not None and now.at_hand else self.linearise(self.answer)

    def moved(self, answer: Answer, step: FloatArray, fraction: float) -> Answer:
        """``answer`` a ``fraction`` of ``step`` (n,) further, or as far as the linearisation
        holds."""
        o, pixel, discs = self.fit.options, self.fit.model.grid.pixel_mm, list(answer.discs)
        steps = step.reshape(len(discs), answer.parameters)
        change = np.maximum(steps[:, 0] / LEAST_CHANGE, steps[:, 0] / MOST_CHANGE)
        radius = np.abs(answer.radius_mm * steps[:, 3]) / (MAX_RADIUS_MOVE * pixel)
        over = max(1.0, change.max(), np.abs(steps[:, 1:3]).max() / MAX_MOVE, radius.max())
        fraction = fraction / float(over)
        for k, (disc, s) in enumerate(zip(discs, steps, strict=True)):
            grown = float(answer.radius_mm[k] * s[3])
            x, y = fraction * pixel * s[1:3]
            disc = replace(disc, change=disc.change * (1 + fraction * float(s[0])))
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
        shape[:, : answer.parameters - PLACE] += fraction * steps[:, PLACE:]
        return replace(answer, discs=discs, shape=shape)

    def refit(
        self,
        answer: Answer,
        now: Likelihood | None = None,
        enough: float = 0.0,
        hopeless: float = np.inf,
    ) -> tuple[Answer, Likelihood | None]:
        """Gauss and Newton's steps, a few at most, until F is ``enough`` or hardly falls, or a
        linearisation has its least above ``hopeless``; sets its misfit. ``now``: F about
        ``answer``, if it is at hand; beside it, the last that was made. Where not even one may be,
        the misfit is beyond all others."""
        if not answer.discs:
            return replace(answer, misfit=float(self.data @ self.data)), None
        if now is None or not now.at_hand:
            if not self.budget.allows(answer.columns):
                return replace(answer, misfit=np.inf), None
            now = self.linearise(answer)
        fraction, trials = 1.0, TRIAL_COLUMNS * len(answer.discs)
        for _ in range(REFIT_STEPS):
            again = 0 if now.at_hand else answer.columns
            if now.here <= enough or not self.budget.allows(again + trials + answer.columns):
                break
            if not now.at_hand:
                now = self.linearise(answer)
            if now.here - now.least < SETTLED_MISFIT or now.least > hopeless:
                break
            trial = self.moved(answer, now.step, fraction)
            misfit = self.misfit_of(trial)
            if misfit < now.here:
                answer, now, fraction = trial, replace(now, here=misfit, at_hand=False), 1.0
            else:
                fraction *= SHORTER
        return replace(answer, misfit=now.here), now

    # ---- simpler answers ----

    def excess(self, misfit: float, count: int) -> float:
        """How much worse the data fit than Sigma says; at least 1."""
        free = len(self.data) - len(self.fit.basis) - PLACE * count
        return max(1.0, misfit / max(free, MIN_FREEDOM))

    def needed(self) -> float:
        """What F is to rise by without a touch."""
        return TOUCH_EVIDENCE * self.excess(self.answer.misfit, len(self.answer.discs))

    def near_pairs(self) -> list[tuple[int, int]]:
        """Pairs i < j of near discs, one of them worth little beside the other, by j and then i;
        of few discs further ones, too: two may lie along one long touch."""
        discs, few = self.answer.discs, len(self.answer.discs) <= FEW_DISCS
        reach = REACH_OF_FEW if few else MERGE_REACH
        weak = self.rise < (CLEAR_OF_FEW if few else CLEAR_OF_MANY) * self.needed()
        return [
            (i, j)
            for j in range(len(discs))
            for i in range(j)
            if (weak[i] or weak[j]) and is_near(discs[i], discs[j], reach)
        ]

    def shaped(self, answer: Answer) -> Answer:
        """``answer`` with as many shapes as there is room for."""
        parameters = parameters_of(self.fit, self.errors, len(answer.discs))
        return replace(answer, parameters=max(answer.parameters, parameters))

    def one_less(self, answer: Answer, now: Likelihood, k: int) -> tuple[Answer, Likelihood | None]:
        """``answer`` without disc k, and F about it, None where there is room for more shapes."""
        return self.with_shapes(*now.without(answer, k))

    def with_shapes(self, rest: Answer, about: Likelihood) -> tuple[Answer, Likelihood | None]:
        """``rest`` with shapes, if they may be made, and F about it, ``about`` being that of
        ``rest``; None where there is room for more shapes."""
        columns = len(rest.discs) * parameters_of(self.fit, self.errors, len(rest.discs))
        shaped = self.shaped(rest) if self.budget.allows(columns) else rest
        return shaped, about if shaped.parameters == rest.parameters else None

    def as_one(self, answer: Answer, i: int, j: int) -> Answer:
        """Discs i < j as one of the same strength."""
        a, b, to = answer.discs[i], answer.discs[j], self.shaped(answer.without(j))
        one = merged(self.fit.options, a, b)
        strength = a.change * a.radius_mm**2 + b.change * b.radius_mm**2
        to.discs[i] = replace(one, change=strength / one.radius_mm**2)
        to.radius_mm[i], to.shape[i] = one.radius_mm, 0.0
        return to

    def look(self, now: Likelihood) -> int:
        """Set what is known of each disc by F about them; returns the weakest."""
        answer, self.here = self.answer, now.here
        if not self.fitted:
            self.answer = answer = replace(answer, misfit=now.least)
        count = len(answer.discs)
        self.place_mm2, self.best_mm = np.zeros((count, 3)), np.zeros((count, 2))
        for k in range(count):
            self.look_at_place(now, k)
        self.look_at_shapes(now)
        self.rise = np.array([now.rise(answer, k) for k in range(count)])
        return int(np.argmin(self.rise))

    def look_at_place(self, now: Likelihood, k: int) -> None:
        """Set how well the place of disc k is known, and where one more step would put it."""
        disc, pixel = self.answer.discs[k], self.fit.model.grid.pixel_mm
        unit = pixel**2 * self.excess(self.answer.misfit, len(self.answer.discs))
        x = k * self.answer.parameters + 1
        (xx, xy), (_, yy) = unit * now.inverse[x : x + 2, x : x + 2]
        self.place_mm2[k] = xx, xy, yy
        self.best_mm[k] = (disc.x_mm, disc.y_mm) + pixel * now.step[x : x + 2]

    def look_at_shapes(self, now: Likelihood) -> None:
        """Set what its shape says of each disc; what is an ellipse has its place by the look that
        says so."""
        answer, p = self.answer, self.answer.parameters
        unit = self.excess(answer.misfit, len(answer.discs))
        self.pair = pair_scores(answer.offsets(), now.step, np.diag(now.inverse))
        self.line = pair_lines(answer.offsets(), now.step)
        self.axis = np.zeros((len(answer.discs), 2))
        for k, disc in enumerate(answer.discs if p == ALL else ()):
            own = slice(k * p + EDGE, (k + 1) * p)
            dipole = answer.offsets()[k, EDGE:] + now.step[own]
            self.axis[k] = long_axis(dipole, now.inverse[own, own], disc.polarity, unit)
            if self.axis[k].any():
                self.look_at_place(now, k)

    def drop_linearly(self, now: Likelihood, weakest: int) -> tuple[Answer, Likelihood | None]:
        """The answer without whatever the linearisation can do without, one after another from the
        ``weakest`` on, and F about it."""
        rest, about, rise = self.answer, now, float(self.rise[weakest])
        while rise < TOUCH_EVIDENCE * self.excess(about.least, len(rest.discs)):
            rest, about = about.without(rest, weakest)
            if len(rest.discs) <= self.errors.kept:
                break
            rises = [about.rise(rest, k) for k in range(len(rest.discs))]
            weakest = int(np.argmin(rises))
            rise = rises[weakest]
        return self.with_shapes(rest, about)

    def take_simpler(self, now: Likelihood, weakest: int) -> tuple[bool, Likelihood | None]:
        """Take the best of the answers with one disc less: without the weakest, unless that is
        clear, or with a near pair as one. Where the linearisation alone has judged the discs, they
        are fitted only if that may decide. What is at hand of the best is told, if it was tried
        last."""
        needed = self.needed()
        enough = self.answer.misfit + needed
        best, about = replace(self.answer, misfit=np.inf), None
        if not self.rise[weakest] > CLEAR * needed:
            best, about = self.refit(*self.one_less(self.answer, now, weakest), enough)
        for i, j in self.near_pairs():
            if best.misfit < enough or not self.budget.allows(2 * best.columns):
                break
            one, of_one = self.refit(self.as_one(self.answer, i, j), None, enough, enough)
            better = one.misfit < best.misfit
            best, about = (one, of_one) if better else (best, None)
        if not self.fitted and enough <= best.misfit < now.here + needed:
            self.answer, about = self.refit(self.answer)[0], None
            self.fitted = True
        if not best.misfit - self.answer.misfit < self.needed():
            return False, None
        self.answer, self.changed, self.fitted = best, True, True
        return True, about

    def fits(self) -> bool:
        """Whether the data are explained about as well as Sigma says."""
        return self.excess(self.answer.misfit, len(self.answer.discs)) <= FITS

    # ---- two in the place of one ----

    def as_two(self, k: int) -> Answer | None:
        """The answer with two discs in the place of disc k, on the line along which its edge
        bulges, to be fitted; None where there is no room for them."""
        one, disc, count = self.answer, self.answer.discs[k], len(self.answer.discs)
        radius = max(disc.radius_mm * 0.70710678, self.fit.options.touch_min_radius_mm)
        change = disc.change * disc.radius_mm**2 / (2 * radius**2)
        x, y = (SPLIT_APART * disc.radius_mm * self.line[k]).tolist()
        first, second = (
            replace(
                disc,
                x_mm=disc.x_mm + side * x,
                y_mm=disc.y_mm + side * y,
                radius_mm=radius,
                change=change,
            )
            for side in (1, -1)
        )
        parameters = parameters_of(self.fit, self.errors, count + 1)
        if not (parameters and self.fit.on_skin(first) and self.fit.on_skin(second)):
            return None
        two = Answer(
            [*one.discs, second],
            np.append(one.radius_mm, radius),
            np.vstack([one.shape, np.zeros(ALL - PLACE)]),
            parameters,
        )
        two.discs[k], two.radius_mm[k], two.shape[k] = first, radius, 0.0
        return two

    def needed_fall(self, k: int, misfit: float, count: int) -> float:
        """What F is to fall by for disc k as two: the more the less its shape says so."""
        rise = max(SPLIT_RISE - SPLIT_RISE_OF_ODDS * self.pair[k], SPLIT_MIN_RISE)
        return float(rise * TOUCH_EVIDENCE * self.excess(misfit, count))

    def may_fall(self, k: int, misfit: float) -> bool:
        """Whether F may fall enough where two in the place of disc k leave ``misfit``: before the
        one is fitted, which only lowers its own."""
        return self.here - misfit > self.needed_fall(k, misfit, len(self.answer.discs) + 1)

    def take_split(self) -> bool:
        """Take the likeliest pair as two where F falls enough. Twice the usual steps: one disc and
        two are compared at their best. Two that are far from it after the first are given up, and
        so are those that fall too little from one that is not fitted yet."""
        count = len(self.answer.discs)
        k = int(np.argmax(self.pair[:count])) if count else 0
        if not (0 < count < self.fit.options.max_touches and self.pair[k] > SPLIT_ODDS):
            return False
        one, two = self.answer, self.as_two(k)
        if two is None or not self.may_fall(k, 0.0):
            return False
        two, now = self.refit(two)
        if now is None or not now.least < SPLIT_HOPE * one.misfit:
            return False
        if not self.may_fall(k, now.least):
            return False
        two, now = self.refit(two, now)
        if not self.may_fall(k, two.misfit):
            return False
        if not self.fitted:
            one = self.refit(*self.refit(one))[0]
        fall = one.misfit - two.misfit
        if one.misfit == np.inf or not fall > self.needed_fall(k, two.misfit, count + 1):
            return False
        self.answer, self.changed, self.fitted = two, True, True
        self.look(self.about(now))
        return True

    def eliminate(self, now: Likelihood | None = None, *, to_the_end: bool) -> bool:
        """From the discs as they are to those that stay; not ``to_the_end``: false as soon as the
        data are found not to fit, to be gone on with another time, and where no column may be made
        at all. Where no more may be made, what stands then stays, less what the linearisation can
        do without. ``now``: F about the answer, if
        it is at hand."""
        if now is None and not self.budget.allows(self.answer.columns):
            return False
        others = self.answer.columns  # of the discs as they came, gone on with another time
        while len(self.answer.discs) > self.errors.kept:
            now = self.about(now)
            weakest = self.look(now)
            if self.rise[weakest] > CLEAR * self.needed() and not self.near_pairs():
                return True
            bad = FITS if self.fitted else FITS_AS_DISCS
            excess = self.excess(self.answer.misfit, len(self.answer.discs))
            if not to_the_end and excess > bad and self.budget.allows_later(others):
                return False
            rest, about = self.drop_linearly(now, weakest)
            if len(rest.discs) < len(self.answer.discs):
                rest, now = self.refit(rest, about)
                if rest.misfit == np.inf:
                    return True
                self.answer, self.changed, self.fitted = rest, True, True
                continue
            if not self.budget.allows(2 * self.answer.columns):
                return True
            unclear = not self.rise[weakest] > CLEAR * self.needed()
            if not self.fitted and (
                unclear or self.excess(now.here, len(self.answer.discs)) > FITS
            ):
                self.answer, now = self.refit(self.answer, now)
                self.fitted, now = True, self.about(now)
                weakest = self.look(now)
            if not to_the_end and not self.fits() and self.budget.allows_later(others):
                return False
            weak = self.rise[weakest] < self.needed()
            if weak and not self.budget.allows(2 * self.answer.columns):
                continue
            taken, now = self.take_simpler(now, weakest)
            if not taken:
                return True
        self.fitted = True
        self.answer, now = self.refit(self.answer, now)
        if self.answer.discs:  # on an instrument that is far from the model one stays
            self.look(self.about(now))
        return True

    def is_clear(self) -> Likelihood | None:
        """Whether the discs need no closer look, as discs, which costs least: sets ``clear``. What
        is at hand about the answer."""
        parameters = self.answer.parameters
        self.answer = replace(self.answer, parameters=PLACE)
        now = self.linearise(self.answer)
        weakest = self.look(now)
        excess = self.excess(self.answer.misfit, len(self.answer.discs))
        clear = self.rise[weakest] > CLEAR_AS_DISCS * self.needed() and not self.near_pairs()
        self.clear = clear and excess < FITS_AS_DISCS
        self.answer = replace(self.answer, parameters=parameters)
        self.places_made = parameters > PLACE
        rank = self.fit.model.rank
        shapes_matter = parameters > PLACE and self.answer.misfit > PAIR_MISFIT * rank
        if self.clear and shapes_matter and self.budget.allows(self.answer.columns):
            self.look_at_shapes(self.linearise(self.answer))
        return now if parameters == PLACE else None


def keep_likely(fit: Fit, errors: DataErrors) -> Tested | None:
    """Drop and merge discs of ``fit`` that model errors could have made; what is known of those
    that stay, None where there is no room to test so many."""
    if not fit.discs or not parameters_of(fit, errors, len(fit.discs)):
        return None
    all_ = fit.options.test_columns
    budget = Budget(min(all_, max(STILL_MIN, STILL_COLUMNS - fit.moves)), all_)
    best = Hypothesis(fit, errors, budget, drift=False)
    at_hand = best.is_clear()
    if not best.clear:
        whole = best.eliminate(at_hand, to_the_end=False)
        if not whole:
            budget.most = budget.all
        drifted = Hypothesis(fit, errors, budget, drift=True)
        if not best.fits() and budget.allows(drifted.answer.columns):
            drifted.eliminate(to_the_end=True)
            if not whole and drifted.evidence >= best.answer.misfit + best.log_determinant:
                whole = best.eliminate(to_the_end=True)
            if not whole or drifted.evidence < best.evidence:
                best = drifted
    budget.most = min(budget.all or SPLIT_COLUMNS, SPLIT_COLUMNS)
    budget.made += budget.kept
    while best.take_split():
        pass
    count = len(best.answer.discs)
    unit = best.excess(best.answer.misfit, count)
    if best.changed:
        fit.discs = list(best.answer.discs)
    discs_mm = np.array([(disc.x_mm, disc.y_mm) for disc in fit.discs]).reshape(-1, 2)
    looks = zip(fit.discs, best.best_mm, best.axis, strict=False)
    reported_mm = np.array([placed(fit, *look) for look in looks]).reshape(-1, 3)
    return Tested(
        best.rise[:count] / unit,
        best.place_mm2[:count],
        best.best_mm[:count] - discs_mm,
        best.pair[:count],
        best.axis[:count] * reported_mm[:, 2:],
        reported_mm,
        budget.spent,
    )
