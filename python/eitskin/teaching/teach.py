"""Teach a model from presses, with a report on its errors."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.calibration.fit import calibrate
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import EitskinError, ProtocolError, UsageError
from eitskin.fem.grid import Grid
from eitskin.model.force_law import ForceLaw
from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.skin.skin import Skin, skin_to_table
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.checks import MIN_PRESSES, check_presses
from eitskin.teaching.explained import (
    Explained,
    explained,
    known_size,
    shifted_or_refused,
)
from eitskin.teaching.fit import Learned, learn, with_drift
from eitskin.teaching.kernel import least_turn_deg, placement_text
from eitskin.teaching.left_out import (
    MISFIT,
    LeftOut,
    ellipse_factor,
    stranger_note,
)
from eitskin.teaching.make import LEAST_SHARES, taught_model
from eitskin.teaching.presses import Presses, aged

# models, each with the numbers of the presses that were held out from it
Tried = list[tuple[Model, IntArray]]

FEW_PRESSES = 50
FEWEST_LEVELS = 3  # least number of different depths or forces for a law
FOLDS, MAX_HELD_OUT = 5, 250
# least fraction of single presses that must be found as one touch, without sums and with sums
COUNTED_ONCE, LEAST_ONCE = 0.96, 0.93
# Sums of two held-out presses simulate two touches. In parts of the skin's width: their least and
# greatest distance, and the greatest error of a place; then the greatest number per fold, and the
# least number in all (with fewer only single presses count).
SUMS_FROM, SUMS_TO, SUM_AT, MAX_SUMS, FEWEST_SUMS = 0.26, 0.41, 0.09, 30, 100
# The limits of the slope of log error over log presses, for predictions: few presses show a steeper
# slope that does not last. For 20 to 400 hydrogel presses it is -.43 to -.26.
SLOPES = (-0.35, -0.15)
NOTHING = 0.1  # explained fraction of a row's energy below which the row is useless
OTHER_SCALE = 0.16  # a greater |log scale| means another unit or another skin


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Presses solved by the C core with models from which they were held out: the error (k,) in mm
    of the strongest touch, the number of touches, the strength of the strongest, the squared error
    in the covariance of the fit (inf if there is none), and the numbers of the presses."""

    error_mm: FloatArray
    count: IntArray
    strength: FloatArray
    mahalanobis2: FloatArray
    which: IntArray


@dataclass(frozen=True, eq=False)
class Taught:
    """A taught ``model``, what was ``learned``, each press ``left_out``, some presses ``held`` out
    and solved by the core, and the ``report``."""

    model: Model
    learned: Learned
    left_out: LeftOut
    held: HeldOut
    report: dict[str, Any]


def teach(
    presses: Presses,
    skin: Skin | None,
    *,
    place_sd_mm: float = 0.0,
    reference_age: int = 0,
    refuse: bool = True,
    progress: Progress = silent,
) -> Taught:
    """Learn a model from ``presses`` of ``skin`` (None if unknown).

    ``place_sd_mm`` is the standard deviation per axis of places given by hand. ``reference_age`` is
    how old the reference will be, in presses in order of time: the drift over this age counts as
    noise, and held-out presses are solved with such a reference. With ``refuse`` False a model is
    made even if the places do not explain the voltages.

    Raises:
        FrameError: the presses cannot teach; the text states which, and what to do.
        ProtocolError: ``skin`` has another number of electrodes.
        UsageError: a number is out of range.
        MissingExtraError: scipy or netgen is not installed.
    """
    begun = time.monotonic()
    if not 0 <= place_sd_mm <= 1000:
        raise UsageError("teach: the places' sd must be 0 to 1000 mm")
    notes = check_presses(presses, skin)
    if not 0 <= reference_age <= len(presses) // 2:
        raise UsageError(
            f"teach: {len(presses)} presses show the drift over 0 to {len(presses) // 2} presses,"
            f" not over {reference_age}; record more, or give a smaller reference age"
        )
    if skin is not None and skin.electrodes.count != presses.protocol.n_electrodes:
        raise ProtocolError(
            f"teach: the skin has {skin.electrodes.count} electrodes, the presses were scanned with"
            f" {presses.protocol.n_electrodes}; give the description of that skin"
        )
    found = explained(presses, skin, place_sd_mm, progress)
    if refuse and found.is_chance:
        found = shifted_or_refused(found, skin, place_sd_mm, progress)
    presses, left_out, grid = found.presses, found.left_out, found.grid
    notes += found.notes
    judged = aged(presses, reference_age)
    least_share, held = held_out(found, judged, reference_age, progress)
    meta = {"teach": {"presses": len(presses)}}
    if skin is not None:
        meta["skin"] = skin_to_table(found.seen_as)
    learned = with_drift(found.learned, presses.untouched, reference_age)
    model = taught_model(learned, presses.protocol, grid, presses.untouched, least_share, meta)
    if len(presses) >= FEW_PRESSES:
        model = replace(model, place_factor=ellipse_factor(held.mahalanobis2))
    law, law_note = size_law(presses, held, grid)
    notes += law_note
    report = _report(presses, learned, left_out, held, least_share, notes)
    report["ellipse_factor"] = round(model.place_factor, 3) or None
    report["reference_age"] = reference_age
    report["held_out_by_presses"] = learning_curve(found, judged, reference_age, least_share, held)
    report["fit_s"] = round(time.monotonic() - begun, 2)
    model = replace(model, force_law=law, meta={**model.meta, "teach": report})
    return Taught(model, learned, left_out, held, report)


def solve_presses(
    model: Model, presses: Presses, **options: object
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Solve presses by the C core with ``options``, each with its own untouched frame. Return the
    error (n,) in mm of the strongest touch (the skin's width if there is none), the number of
    touches, its strength, and the squared error in the touch's own covariance (inf if unknown)."""
    core = Reconstructor(model)
    core.set_options(**options)
    width = width_of(model)
    out = np.zeros((4, len(presses)))
    for i in range(len(presses)):
        core.forget()
        core.tare(presses.untouched[i])
        touches = core.reconstruct(presses.pressed[i]).touches
        out[:, i] = width, len(touches), 0, np.inf
        if touches:
            first = max(touches, key=lambda one: abs(one.strength_s_per_m_mm2))
            away = np.array([first.x_mm, first.y_mm]) - presses.place_mm[i]
            out[0, i], out[2, i] = np.linalg.norm(away), abs(first.strength_s_per_m_mm2)
            out[3, i] = squared(away, first)
    return out[0], out[1], out[2], out[3]


def squared(away_mm: FloatArray, touch: Touch) -> float:
    """Return the squared length of ``away_mm`` (2,) in the covariance of the touch's place; inf if
    that is unknown."""
    if not touch.x_variance_mm2:
        return np.inf
    xy = touch.xy_covariance_mm2 or 0.0
    covariance = np.array([[touch.x_variance_mm2, xy], [xy, touch.y_variance_mm2 or 0.0]])
    return float(away_mm @ np.linalg.solve(covariance, away_mm))


def model_without(
    found: Explained, kept: IntArray, reference_age: int, least_share: float
) -> Model:
    """Return a model of the presses ``kept``, with the kernel and the drift of all presses."""
    presses, process, given = found.presses, found.learned.process, known_size(found.presses)
    less = learn(
        process.kernel, process.place_mm[kept], presses.difference[kept],
        None if given is None else given[kept], found.width_mm, choose=False,
        amplitude=process.amplitude[kept],
    )  # fmt: skip
    less = with_drift(less, presses.untouched, reference_age)
    return taught_model(less, presses.protocol, found.grid, presses.untouched[kept], least_share)


def held_out(
    found: Explained, judged: Presses, reference_age: int, progress: Progress
) -> tuple[float, HeldOut]:
    """Return the least share that a touch must explain, chosen on presses held out in five folds,
    each as in ``judged``; and the results of the core for them with it."""
    count = len(judged)
    fold = np.random.default_rng(1).permutation(count) % min(FOLDS, count)
    limit = MAX_HELD_OUT // FOLDS
    tried = []
    for k in progress(range(int(fold.max()) + 1), "held-out presses"):
        model = model_without(found, np.flatnonzero(fold != k), reference_age, LEAST_SHARES[0])
        tried.append((model, np.flatnonzero(fold == k)[:limit]))
    return chosen_share(tried, judged)


def chosen_share(tried: Tried, presses: Presses) -> tuple[float, HeldOut]:
    """Return the best of ``LEAST_SHARES`` for presses that are held out, each model of ``tried``
    with its own of ``presses``; and the results of the core for them with it."""
    sums = [near_sums(presses.place_mm[which], width_of(one)) for one, which in tried]
    few = sum(map(len, sums)) < FEWEST_SUMS
    if few:  # too few to decide; the first share that keeps single presses single is taken
        sums = [pairs[:0] for pairs in sums]
    found: list[list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]] = []
    alone, two = [], []
    for share in LEAST_SHARES:
        parts, exact = [], []
        for (one, which), pairs in zip(tried, sums, strict=True):
            defaults = replace(one.defaults, touch_min_fraction=share)
            model, some = replace(one, place_factor=1.0, defaults=defaults), presses.take(which)
            parts.append(solve_presses(model, some))
            exact.append(found_as_two(model, some, pairs))
        found.append(parts)
        alone.append(float(np.mean(np.concatenate([part[1] for part in parts]) == 1)))
        two.append(np.concatenate(exact))
        if alone[-1] >= (COUNTED_ONCE if few else 1):  # greater shares could only lose touches
            break
    k = best_share(np.array(alone), np.array(two))
    error, number, strength, mahalanobis2 = (
        np.concatenate(part) for part in zip(*found[k], strict=True)
    )
    which = np.concatenate([which for _, which in tried])
    held = HeldOut(error, number.astype(np.int64), strength, mahalanobis2, which)
    return LEAST_SHARES[k], held


def best_share(alone: FloatArray, two: BoolArray) -> int:
    """Return which of k shares is best, from the fraction ``alone`` (k,) of single presses found as
    one, and whether sums are found as two, ``two`` (k, n). With few sums it is the least share that
    keeps single presses single."""
    few = two.shape[1] < FEWEST_SUMS
    enough = np.flatnonzero(alone >= (COUNTED_ONCE if few else LEAST_ONCE))
    if not len(enough):
        return len(alone) - 1
    return int(enough[0 if few else np.argmax((alone + two.mean(axis=1))[enough])])


def near_sums(place_mm: FloatArray, width_mm: float) -> IntArray:
    """Return pairs (k, 2) of presses at ``place_mm`` (n, 2) that the core can just separate."""
    away = np.linalg.norm(place_mm[:, None] - place_mm, axis=2) / width_mm
    pairs = np.argwhere(np.triu((away > SUMS_FROM) & (away < SUMS_TO), 1))
    return np.random.default_rng(3).permutation(pairs)[:MAX_SUMS]


def found_as_two(model: Model, presses: Presses, pairs: IntArray) -> BoolArray:
    """Return whether the core finds exactly two touches, each at its place, when two of
    ``presses``, numbered by ``pairs`` (k, 2), are added."""
    core, resolved = Reconstructor(model), np.zeros(len(pairs), dtype=bool)
    for k, pair in enumerate(pairs):
        i, j = pair
        core.forget()
        core.tare(presses.untouched[i])
        touches = core.reconstruct(presses.pressed[i] + presses.difference[j]).touches
        if len(touches) == 2:
            at = np.array([(one.x_mm, one.y_mm) for one in touches])
            away = np.linalg.norm(at[:, None] - presses.place_mm[pair], axis=2)
            worst = min(max(away[0, 0], away[1, 1]), max(away[0, 1], away[1, 0]))
            resolved[k] = worst < SUM_AT * width_of(model)
    return resolved


def width_of(model: Model) -> float:
    """Return the width of the skin in mm."""
    return model.grid.pixel_mm * max(model.grid.nx, model.grid.ny)


def learning_curve(
    found: Explained, judged: Presses, reference_age: int, least_share: float, held: HeldOut
) -> dict[str, float]:
    """Return the median error by number of presses: measured with a quarter, a half and four fifths
    of them, and predicted by that power law for two and four times as many."""
    order, count = np.random.default_rng(2).permutation(len(judged)), len(judged)
    points = {}
    for few in (count // 4, count // 2):
        if few < MIN_PRESSES:
            continue
        model = model_without(found, order[:few], reference_age, least_share)
        points[few] = float(np.median(solve_presses(model, judged.take(order[-count // 4 :]))[0]))
    points[count * 4 // 5] = float(np.median(held.error_mm))
    sizes, errors = np.log(list(points)), np.log(list(points.values()))
    found_slope = float(np.polyfit(sizes, errors, 1)[0]) if len(points) > 1 else SLOPES[0]
    slope = min(max(found_slope, SLOPES[0]), SLOPES[1])
    last = points[count * 4 // 5]
    expected = {k * count: last * (1.25 * k) ** slope for k in (2, 4)}
    return {
        **{f"measured_{k}": round(v, 2) for k, v in points.items()},
        **{f"expected_{k}": round(v, 2) for k, v in expected.items()},
    }


def size_law(presses: Presses, held: HeldOut, grid: Grid) -> tuple[ForceLaw | None, list[str]]:
    """Return the law from strength to force (or to depth if only that is known) from held-out
    presses, and notes."""
    from eitskin.calibration.presses import WeighedPresses

    given = known_size(presses)
    if given is None:
        return None, []
    size = given[held.which]
    good = np.isfinite(size) & (size > 0) & (held.strength > 0) & (held.count == 1)
    levels = len(np.unique(size[good]))
    if levels < FEWEST_LEVELS:
        return None, [
            f"touches have no force: {levels} different depths or forces are too few; press with at"
            f" least {FEWEST_LEVELS}"
        ]
    reach = float(np.hypot(*grid.centres_mm().T).max())
    unit = "force in newtons" if presses.force_n is not None else "depth in mm instead of newtons"
    try:
        places = presses.place_mm[held.which][good]
        found = calibrate(
            WeighedPresses(size[good], held.strength[good], places), reach, resamples=0
        )
    except EitskinError as error:
        return None, [f"touches have no force: {error}"]
    rms = float(np.sqrt(np.mean((found.left_out * size[good]) ** 2)))
    return found.law, [f"touches have a force: {unit}; rms error of held-out presses {rms:.2g}"]


def _report(
    presses: Presses,
    learned: Learned,
    left_out: LeftOut,
    held: HeldOut,
    least_share: float,
    notes: list[str],
) -> dict[str, Any]:
    placement, kernel = learned.kernel.placement, learned.kernel
    strangers = np.flatnonzero(left_out.misfit > MISFIT)
    silent = np.flatnonzero(left_out.explained < NOTHING)
    if len(presses) < FEW_PRESSES:
        notes.append(f"{len(presses)} presses are too few for 90 % ellipses")
    if abs(np.log(placement.scale)) > OTHER_SCALE:
        notes.append(
            f"the places fit a skin {1 / placement.scale:.2f} times as large as described; correct"
            " their unit or the description; the model uses the places"
        )
    if len(strangers):
        notes.append(stranger_note(strangers))
    return {
        "presses": len(presses),
        "error_mm": {
            "left_out_median": round(float(np.median(left_out.error_mm)), 2),
            "left_out_p95": round(float(np.quantile(left_out.error_mm, 0.95)), 2),
            "held_out_median": round(float(np.median(held.error_mm)), 2),
            "held_out_p95": round(float(np.quantile(held.error_mm, 0.95)), 2),
        },
        "counted_as_one": round(float(np.mean(held.count == 1)), 3),
        "least_share": least_share,
        "noise": {
            "of_a_press": round(float(np.sqrt(np.mean(learned.process.left_out() ** 2))), 3),
            "shrinkage": round(learned.noise.shrinkage, 3),
        },
        "placement": {
            "turn_deg": least_turn_deg(placement.turn_deg, 2),
            "scale": round(placement.scale, 4),
            "mirrored": placement.mirrored,
            "text": "none: stationary kernel"
            if kernel.sensitivity is None
            else placement_text(placement),
        },
        "strange_presses": strangers.tolist(),
        "silent_rows": silent.tolist(),
        "notes": notes,
    }
