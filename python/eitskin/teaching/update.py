"""Adapt a taught model after remounting or drying, with a few new presses.

    s_new,c(p) = (1 + gamma_c) s_old,c(T p) + delta_c(p)

T turns and shifts new places into old ones, gamma_c is the change of row c's gain, and delta_c is a
Gaussian process with the kernel of the physics. Both are one process (process.py) whose prior mean
is the old response: its own-row term is the old response instead of that of the physics.

Few presses may make a model worse. So each candidate (the old model, the moved one with T alone,
and the full one) is tried on held-out presses, solved by the C core, and a richer candidate is used
only if it is significantly better.
"""

from dataclasses import dataclass, replace
from math import exp, log
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import ProtocolError
from eitskin.fem.grid import between_pixels, grid_for
from eitskin.model.force_law import ForceLaw
from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.skin.protocol import pattern_name
from eitskin.skin.skin import Skin, skin_to_table
from eitskin.teaching.checks import check_presses
from eitskin.teaching.explained import (
    MIRROR_GAIN,
    PIXELS_ACROSS,
    known_size,
    shift_note,
    shifts,
    starting_kernel,
)
from eitskin.teaching.fit import (
    LOG_BOUND,
    Learned,
    Noise,
    by_given,
    left_out_amplitudes,
    suiting_amplitudes,
    whitening_of,
)
from eitskin.teaching.kernel import Kernel, Sensitivity, least_turn_deg
from eitskin.teaching.known import Known, known_of
from eitskin.teaching.left_out import stranger_note
from eitskin.teaching.make import taught_model
from eitskin.teaching.move import UNMOVED, Move
from eitskin.teaching.presses import Presses, shifted
from eitskin.teaching.process import condition
from eitskin.teaching.teach import Tried, chosen_share, solve_presses

KEPT, MOVED, FULL = "kept", "moved", "full"
START_TURNS, REFINED_STARTS = 36, 3
SHIFT_SD = 0.03  # relative to the skin's width
ROUNDS = 3
MAX_FOLDS = 10
STRANGE = 6.0  # in medians; a press with a greater misfit is unlike the others
BETTER_BY = 1.0  # standard errors of the mean logarithm of the ratio of errors
ERROR_FLOOR = 0.01  # relative to the skin's width; smaller errors count as equal
SHARE_FROM = 20  # presses; fewer cannot determine the least share that a touch must explain
# Places may be shifted if more than ODD of the energy is unexplained; they are if a shift reduces
# that below SHIFTED times.
ODD, SHIFTED = 0.5, 0.5
STILL_POOR = 3.0  # times the error when the model was taught, above which a note is added


@dataclass(frozen=True, eq=False)
class Deviation(Kernel):
    """The kernel of gamma and delta; its ``features``, the own-row term, are the ``old``
    responses."""

    old: Sensitivity | None = None
    move: Move = UNMOVED

    def features(self, place_mm: FloatArray) -> FloatArray:
        """Return the old response (n, m) at new places (n, 2)."""
        assert self.old is not None
        return self.old(self.move.to_old(place_mm, self.centre_mm))

    def common(self, p: FloatArray, q: FloatArray, jp: FloatArray, jq: FloatArray) -> FloatArray:
        """Return the physics' part, (n, k); the responses ``jp`` and ``jq`` are not part of it."""
        a = self.move.to_old(p, self.centre_mm)
        b = a if q is p else self.move.to_old(q, self.centre_mm)
        ja = Kernel.features(self, a)
        return Kernel.common(self, a, b, ja, ja if b is a else Kernel.features(self, b))


@dataclass(frozen=True, eq=False)
class Prior:
    """The knowledge that new presses are compared with: the ``old`` knowledge, its ``kernel``, the
    skin's ``width_mm``, and ``unit`` (m,) in V, the rms of each row's old response."""

    old: Known
    kernel: Deviation
    width_mm: float
    unit: FloatArray


@dataclass(frozen=True, eq=False)
class Updated:
    """The adapted ``model``, the ``chosen`` candidate, the ``move``, and the ``report``."""

    model: Model
    chosen: str
    move: Move
    report: dict[str, Any]


def update(
    model: Model, presses: Presses, *, where: str = "model", progress: Progress = silent
) -> Updated:
    """Return ``model`` adapted by new ``presses``; ``where`` names it in errors.

    Raises:
        ModelError: ``model`` was not taught.
        ProtocolError: it has another protocol.
        FrameError: the presses cannot teach; the text states which, and what to do.
        MissingExtraError: scipy or netgen is not installed.
    """
    old = known_of(model, where)
    if model.protocol.hash != presses.protocol.hash:
        raise ProtocolError(
            f"{where}: taught with {model.protocol.n_rows} rows of"
            f" {pattern_name(model.protocol)}, another protocol than the presses'"
            f" {presses.protocol.n_rows} of {pattern_name(presses.protocol)}; give the model of"
            " this skin, or  eitskin teach fit  a new one"
        )
    skin = model.skin if "skin" in model.meta else None
    check_presses(presses, skin)
    prior = _prior(old, skin, presses)
    by = _shift(prior, presses)
    presses = shifted(presses, by)
    prior, mirrored = _mirrored_or_not(prior, presses)
    found = {how: adapted(prior, presses, how) for how in progress((MOVED, FULL), "candidates")}
    errors, tried = held_out_errors(model, prior, presses, found, progress)
    chosen = choice(errors, ERROR_FLOOR * prior.width_mm)
    before = float(model.meta["teach"].get("error_mm", {}).get("held_out_median", np.inf))
    strangers = _strangers(prior, found[MOVED])
    notes = [stranger_note(strangers)] if len(strangers) else []
    if by:
        notes.append(shift_note(by))
    if mirrored and chosen != KEPT:
        notes.append("the new places are mirrored relative to the old; the model uses the new ones")
    medians = {how: float(np.median(one)) for how, one in errors.items()}
    if medians[chosen] > STILL_POOR * max(before, ERROR_FLOOR * prior.width_mm):
        notes.append(
            f"the error of held-out presses is still {medians[chosen]:.1f} mm; check the electrodes"
            " and whether each press has its own place, then teach again with 50 presses"
        )
    move = UNMOVED if chosen == KEPT else _move(found[chosen])
    report: dict[str, Any] = {
        "presses": old.presses + (0 if chosen == KEPT else len(presses)),
        "error_mm": {
            "held_out_median": round(medians[chosen], 2),
            "held_out_p95": round(float(np.quantile(errors[chosen], 0.95)), 2),
        },
        "update": {
            "presses": len(presses),
            "chosen": chosen,
            "held_out_mm": {how: round(one, 2) for how, one in medians.items()},
            "turn_deg": least_turn_deg(move.turn_deg),
            "shift_mm": [round(one, 1) for one in move.shift_mm],
        },
        "notes": notes,
    }
    if chosen == KEPT:
        return Updated(model, chosen, move, report)
    defaults = model.defaults
    if len(presses) >= SHARE_FROM:
        share, _ = chosen_share(tried[chosen], presses)
        defaults = replace(defaults, touch_min_fraction=share)
    least_share = defaults.touch_min_fraction
    meta = {**model.meta, "teach": {"least_share": least_share, **report}}
    if skin is not None:
        seen = move.skin(skin)
        meta["skin"] = skin_to_table(seen)
        grid = grid_for(seen.outline, PIXELS_ACROSS)
    else:
        grid = move.grid(model.grid, prior.kernel.centre_mm)
    new = taught_model(found[chosen], presses.protocol, grid, presses.untouched, least_share, meta)
    law = _law(model, new, move, prior, presses)
    new = replace(new, defaults=defaults, force_law=law, place_factor=model.place_factor)
    return Updated(new, chosen, move, report)


def _prior(old: Known, skin: Skin | None, presses: Presses) -> Prior:
    begin, width_mm = starting_kernel(presses, skin)
    unit = np.sqrt(np.mean(old.answer**2, axis=0))
    unit = np.maximum(unit, 1e-9 * unit.max())
    kernel = Deviation(
        begin.sensitivity, begin.centre_mm, begin.length_mm,
        old=between_pixels(old.grid, old.answer / unit),
    )  # fmt: skip
    return Prior(old, kernel, width_mm, unit)


def _shift(prior: Prior, presses: Presses) -> int:
    """Return by how many places the presses are shifted, 0 if the moved old model explains them."""
    as_given = _unexplained(prior, presses)
    if as_given < ODD:
        return 0
    tried = {by: _unexplained(prior, shifted(presses, by)) for by in shifts(presses)}
    by = min(tried, key=lambda one: tried[one], default=0)
    return by if by and tried[by] < SHIFTED * as_given else 0


def _unexplained(prior: Prior, presses: Presses) -> float:
    """Return the fraction of the presses' energy that the old responses at the likeliest new places
    do not explain."""
    process = min(
        (adapted(one, presses, MOVED) for one in (prior, _mirrored(prior))),
        key=lambda one: -one.log_likelihood,
    ).process
    return float(np.sum(process.left_out() ** 2) / np.sum(process.data**2))


def _mirrored(prior: Prior) -> Prior:
    return replace(prior, kernel=replace(prior.kernel, move=Move(mirrored=True)))


def _mirrored_or_not(prior: Prior, presses: Presses) -> tuple[Prior, bool]:
    """Return ``prior``, mirrored if that is far more likely, and whether it is."""
    other = _mirrored(prior)
    plain, turned = (adapted(one, presses, MOVED).log_likelihood for one in (prior, other))
    return (other, True) if turned > plain + MIRROR_GAIN else (prior, False)


def _strangers(prior: Prior, learned: Learned) -> IntArray:
    """Return presses that the others and the old noise do not explain; the new noise would hide
    them."""
    white = whitening_of(prior.old.noise / prior.unit / prior.unit[:, None])
    misfit = np.sum((learned.process.left_out() @ white.T) ** 2, axis=1)
    return np.flatnonzero(misfit > STRANGE * np.median(misfit))


def _move(learned: Learned) -> Move:
    assert isinstance(learned.kernel, Deviation)
    return learned.kernel.move


def adapted(prior: Prior, presses: Presses, how: str, start: Deviation | None = None) -> Learned:
    """Return what is learned after ``presses`` by the candidate ``how``; with ``start`` the
    likelihood is maximised from there alone."""
    data, given = presses.difference / prior.unit, known_size(presses)
    old_noise = prior.old.noise / prior.unit / prior.unit[:, None]
    white = whitening_of(old_noise)
    kernel = likeliest(prior, presses, how, white, start)
    answer = kernel.features(presses.place_mm)
    amplitude = _amplitudes(answer, data, given, white)
    process = condition(kernel, presses.place_mm, amplitude, data, about_own=True)
    noise = _pooled(old_noise, prior.old.presses, process.left_out())
    for _ in range(ROUNDS):
        amplitude = left_out_amplitudes(process, noise, given)
        process = condition(kernel, presses.place_mm, amplitude, data, about_own=True)
        noise = _pooled(old_noise, prior.old.presses, process.left_out())
    return Learned(process, noise, prior.unit, process.log_likelihood)


def _amplitudes(
    answer: FloatArray, data: FloatArray, given: FloatArray | None, white: FloatArray
) -> FloatArray:
    """Return amplitudes by the old response alone; 1 is the mean of the old presses."""
    amplitude = suiting_amplitudes(answer, data, white)
    return amplitude if given is None else by_given(amplitude, given)


def _pooled(old: FloatArray, count: int, residual: FloatArray) -> Noise:
    """Return the covariance of ``count`` old presses and new residuals (n, m) together."""
    covariance = (count * old + residual.T @ residual) / (count + len(residual))
    return Noise(whitening_of(covariance), covariance, 0.0)


def likeliest(
    prior: Prior, presses: Presses, how: str, white: FloatArray, start: Deviation | None
) -> Deviation:
    """Return the kernel with the turn, shift, and variances of gain and noise (over that of delta)
    of the greatest likelihood; ``MOVED`` has only the noise."""
    from scipy.optimize import minimize

    data, given, place = presses.difference / prior.unit, known_size(presses), presses.place_mm
    sd_mm = SHIFT_SD * prior.width_mm
    free = 5 if how == FULL else 3
    fixed = np.array([0, 0, 0, LOG_BOUND, -LOG_BOUND])

    def at(numbers: FloatArray) -> Deviation:
        turn, x, y, noise, own = np.concatenate([numbers, fixed[free:]]).tolist()
        noise, own = (min(max(one, -LOG_BOUND), LOG_BOUND) for one in (noise, own))
        move = replace(prior.kernel.move, turn_deg=turn, shift_mm=(x, y))
        return replace(prior.kernel, move=move, noise=exp(noise), own=exp(own))

    def cost(numbers: FloatArray) -> float:
        kernel = at(numbers)
        answer = kernel.features(place)
        amplitude = _amplitudes(answer, data, given, white)
        if how == MOVED:
            energy = np.sum((data - amplitude[:, None] * answer) ** 2, axis=0)
            found = -0.5 * len(data) * float(np.log(np.maximum(energy, 1e-300)).sum())
        else:
            try:
                found = condition(kernel, place, amplitude, data, about_own=True).log_likelihood
            except np.linalg.LinAlgError:
                return 1e30
        return -found + 0.5 * float(numbers[1] ** 2 + numbers[2] ** 2) / sd_mm**2

    if start is None:
        turns = 360 / START_TURNS * np.arange(START_TURNS)
        starts = [np.array([turn, 0, 0, log(0.1), log(0.3)])[:free] for turn in turns]
    else:
        begin = [start.move.turn_deg, *start.move.shift_mm, log(start.noise), log(start.own)]
        starts = [np.array(begin)[:free]]
    steps = np.diag([5.0, 0.7 * sd_mm, 0.7 * sd_mm, 0.7, 0.7])[:free, :free]
    best = None
    for k in np.argsort([cost(one) for one in starts])[:REFINED_STARTS]:
        found = minimize(
            cost, starts[k], method="Nelder-Mead",
            options={"initial_simplex": starts[k] + np.vstack([np.zeros(free), steps]),
                     "xatol": 0.05, "fatol": 0.1, "maxfev": 300},
        )  # fmt: skip
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return at(best.x)


def held_out_errors(
    model: Model,
    prior: Prior,
    presses: Presses,
    found: dict[str, Learned],
    progress: Progress = silent,
) -> tuple[dict[str, FloatArray], dict[str, Tried]]:
    """Return the errors (n,) in mm of each candidate for held-out presses, solved by the core (for
    the old model, which knew none, all presses); and the models that were tried, with the numbers
    of their held-out presses."""
    count = len(presses)
    fold = np.random.default_rng(1).permutation(count) % min(count, MAX_FOLDS)
    errors = {KEPT: solve_presses(model, presses)[0]} | {how: np.zeros(count) for how in found}
    tried: dict[str, Tried] = {how: [] for how in found}
    for k in progress(range(int(fold.max()) + 1), "held-out presses"):
        known = presses.take(np.flatnonzero(fold != k))
        for how, learned in found.items():
            assert isinstance(learned.kernel, Deviation)
            less = adapted(prior, known, how, learned.kernel)
            grid = _move(less).grid(model.grid, prior.kernel.centre_mm)
            one = taught_model(
                less, presses.protocol, grid, known.untouched, model.defaults.touch_min_fraction
            )
            out = np.flatnonzero(fold == k)
            errors[how][out] = solve_presses(one, presses.take(out))[0]
            tried[how].append((one, out))
    return errors, tried


def choice(errors: dict[str, FloatArray], floor_mm: float) -> str:
    """Return the last candidate that is significantly better than the one chosen before it."""
    chosen = KEPT
    for how in (MOVED, FULL):
        gain = np.log((errors[chosen] + floor_mm) / (errors[how] + floor_mm))
        if gain.mean() > BETTER_BY * gain.std(ddof=1) / np.sqrt(len(gain)):
            chosen = how
    return chosen


def _law(old: Model, new: Model, move: Move, prior: Prior, presses: Presses) -> ForceLaw | None:
    """Return the old law of force in the new coordinates, with strengths in the scale of the new
    model, taken from presses of known size."""
    given = known_size(presses)
    if old.force_law is None:
        return None
    law = move.law(old.force_law, new.grid, prior.kernel.centre_mm)
    if given is None:
        return law
    strength = solve_presses(new, presses)[2]
    expected = np.interp(given, law.force_n, law.strength) / law.gains_at(presses.place_mm)
    good = np.isfinite(given) & (given > 0) & (strength > 0) & (expected > 0)
    if not good.any():
        return law
    factor = float(np.median(strength[good] / expected[good]))
    return replace(law, strength=(law.strength * factor).astype(np.float32))
