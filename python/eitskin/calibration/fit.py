"""Fit the law that converts the strength and place of a touch to force, from presses of known force
(docs/guide/calibration.md).

The strength of a force F at (x, y) is modelled as law(F) / gain(x, y). There are three monotone
laws: *saturating*, s_max (1 - exp(-F / F0)); *power*, c F^p; and, with four or more weights,
*stretched*, s_max (1 - exp(-(F / F0)^p)), which contains both. The gain is 1 + a polynomial without
constant in (x / R, y / R), regularised by a ridge. The fit minimises the sum of squared logarithms
of measured over modelled strength. The law and the order of the gain are those that best predict
presses left out of the fit: one place after another, or one press after another if there are too
few places.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.calibration.presses import WeighedPresses
from eitskin.errors import FrameError, missing_extra
from eitskin.model.force_law import MAX_ORDER, ForceLaw, monomials

MIN_PRESSES, MIN_WEIGHTS, MIN_RATIO = 4, 3, 1.5
SAME_WEIGHT = 1.005  # forces within this ratio count as the same weight
PLACE_MM = 12.0  # presses closer than this, directly or in a chain, are at the same place
PLACES_FOR_ORDER = (1, 5, 8, 13, 19)
# A higher order, or a law with more numbers, must reduce the prediction error to this part or less.
WORTH = 0.95
LAW_ORDER = 2  # order of the gain with which the laws are compared
RIDGE = 0.02 / 0.5  # strengths scatter by about 0.02, coefficients are of the order of 0.5
TABLE_POINTS = 33
RESAMPLES = 200
STEP = 1e-5  # relative finite difference of a law's numbers
MIN_EXPONENT = 0.02
MIN_STEEPNESS = 0.05  # a flatter law cannot distinguish forces
MAX_F0 = 30.0  # times the greatest force; beyond it a saturating law is a straight line


@dataclass(frozen=True)
class LawForm:
    """The form of a law with some positive numbers.

    ``strength`` gives strength from force, ``force`` gives force from strength; both take the law's
    numbers, called ``names``. ``least_weights`` is how many different weights the fit needs. The
    fit starts at ``start`` and stays within ``low`` and ``high``: strengths are relative to the
    median strength, F0 to the greatest force, and exponents are absolute.
    """

    strength: Callable[..., FloatArray]
    force: Callable[..., FloatArray]
    names: tuple[str, ...]
    text: str
    least_weights: int
    start: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]


FORMS = {
    "saturating": LawForm(
        lambda f, most, f0: np.asarray(-most * np.expm1(-f / f0)),
        lambda s, most, f0: np.asarray(-f0 * np.log1p(-s / most)),
        ("s_max_s_per_m_mm2", "f0_n"), "s_max (1 - exp(-F / F0))", 3, (2.0, 2.0), (1e-9, 0.05),
        (1e9, MAX_F0),
    ),
    "power": LawForm(
        lambda f, c, p: np.asarray(c * f**p),
        lambda s, c, p: np.asarray((s / c) ** (1 / p)),
        ("c_s_per_m_mm2_at_1_n", "exponent"), "c F^p", 3, (1.0, 0.9), (1e-9, MIN_EXPONENT),
        (1e9, 20.0),
    ),
    "stretched": LawForm(
        lambda f, most, f0, p: np.asarray(-most * np.expm1(-((f / f0) ** p))),
        lambda s, most, f0, p: np.asarray(f0 * (-np.log1p(-s / most)) ** (1 / p)),
        ("s_max_s_per_m_mm2", "f0_n", "exponent"), "s_max (1 - exp(-(F / F0)^p))", 4,
        (2.0, 2.0, 1.0), (1e-9, 0.05, MIN_EXPONENT), (1e9, MAX_F0, 20.0),
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FittedLaw:
    """One fit: the numbers of ``form``, and the coefficients (t,) of the ``gain``, the first of
    which is 1."""

    form: str
    numbers: tuple[float, ...]
    order: int
    gain: FloatArray


@dataclass(frozen=True, eq=False)
class Calibration:
    """The result of a calibration.

    Attributes:
        law: the law in the form that a model stores.
        fitted: the law and the gain in their own numbers.
        interval: 95 % interval of each of the law's numbers, by the bootstrap.
        left_out: relative error (k,) of the force of each press when it was left out of the fit.
        groups: the number of places; ``by_place``: whether whole places were left out.
        scatter: relative standard deviation over places of the force, with the same gain everywhere
            and with the fitted gain.
        notes: sentences about what the data could not determine.
    """

    law: ForceLaw
    fitted: FittedLaw
    interval: tuple[tuple[float, float], ...]
    left_out: FloatArray
    groups: int
    by_place: bool
    scatter: tuple[float, float]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON and for the description in the model."""
        names = FORMS[self.fitted.form].names
        return {
            "law": self.fitted.form,
            **dict(zip(names, self.fitted.numbers, strict=True)),
            **{f"{name}_95": list(ends) for name, ends in zip(names, self.interval, strict=True)},
            "gain_order": self.fitted.order,
            "presses": len(self.left_out),
            "places": self.groups,
            "left_out_by": "place" if self.by_place else "press",
            "error_rms": float(np.sqrt(np.mean(self.left_out**2))),
            "error_95": float(self.law.uncertainty),
            "error_worst": float(np.abs(self.left_out).max()),
            "scatter_before": self.scatter[0],
            "scatter_after": self.scatter[1],
            "max_force_n": float(self.law.force_n[-1]),
            "notes": list(self.notes),
        }


def places_of(place_mm: FloatArray) -> IntArray:
    """Return the number of the place of each press (k, 2). Presses connected by a chain of steps
    below ``PLACE_MM`` are at the same place."""
    label = np.arange(len(place_mm))
    near = np.hypot(*(place_mm[:, None] - place_mm[None]).transpose(2, 0, 1)) < PLACE_MM
    for _ in range(len(label)):
        joined = np.array([label[row].min() for row in near])
        if (joined == label).all():
            break
        label = joined
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def weights_of(force_n: FloatArray) -> FloatArray:
    """Return the different forces, ascending."""
    ascending = np.sort(force_n)
    another = ascending[1:] > SAME_WEIGHT * ascending[:-1]
    return np.asarray(ascending[np.concatenate([[True], another])])


def check_presses(presses: WeighedPresses) -> None:
    """Check that ``presses`` can determine a law.

    Raises:
        FrameError: there are too few presses or different weights, or their range is too small.
    """
    if len(presses) < MIN_PRESSES:
        raise FrameError(
            f"calibration: {len(presses)} presses are too few; record at least {MIN_PRESSES} that"
            " show a touch"
        )
    weights = weights_of(presses.force_n)
    if len(weights) < MIN_WEIGHTS:
        raise FrameError(
            f"calibration: {len(weights)} different weights are too few; use at least {MIN_WEIGHTS}"
        )
    ratio = float(weights[-1] / weights[0])
    if ratio < MIN_RATIO:
        raise FrameError(
            f"calibration: the greatest weight is {ratio:.2f} times the least, which cannot show a"
            f" law; use a range of {MIN_RATIO:g} times or more"
        )


def calibrate(
    presses: WeighedPresses, radius_mm: float, seed: int = 1, resamples: int = RESAMPLES
) -> Calibration:
    """Fit the law of a skin whose image reaches ``radius_mm`` from its middle. The intervals come
    from ``resamples`` draws of its places with replacement.

    Raises:
        FrameError: the presses cannot determine a law, or strength does not grow with force.
        MissingExtraError: scipy is not installed.
    """
    check_presses(presses)
    place = places_of(presses.place_mm)
    groups, notes = int(place.max()) + 1, []
    orders = [order for order in range(MAX_ORDER + 1) if groups >= PLACES_FOR_ORDER[order]]
    if orders == [0]:
        places = f"{groups} place{'s' * (groups > 1)}"
        notes.append(
            f"{places}: the gain is taken to be the same everywhere; press at {PLACES_FOR_ORDER[1]}"
            " or more"
        )
    by_place = groups >= MIN_PRESSES
    fold = place if by_place else np.arange(len(presses))
    different = len(weights_of(presses.force_n))
    forms = [name for name, shape in FORMS.items() if different >= shape.least_weights]
    middle = min(max(orders), LAW_ORDER)
    tried = {(form, middle): _left_out(presses, radius_mm, fold, form, middle) for form in forms}
    form, _ = _best(tried)
    known = {middle: tried[form, middle]}
    for order in orders:
        if order != middle:
            known[order] = _left_out(presses, radius_mm, fold, form, order)
    tried = {(form, order): known[order] for order in orders}
    _, order = _best(tried)
    fitted = fit(presses, radius_mm, form, order)
    if _steepness(fitted, presses.force_n) < MIN_STEEPNESS:
        raise FrameError(
            "calibration: strength does not grow with force; check the list of weights, and the"
            " touches of each"
        )
    if form != "power" and fitted.numbers[1] > 0.9 * MAX_F0 * presses.force_n.max():
        notes.append(
            "the strength shows no saturation: beyond the greatest weight the law is a guess"
        )
    left_out = tried[form, order]
    law = law_of(fitted, presses, radius_mm, float(np.quantile(np.abs(left_out), 0.95)))
    before = tried[form, 0]
    return Calibration(
        law, fitted, _interval(presses, radius_mm, fitted, fold, seed, resamples), left_out, groups,
        by_place,
        (_scatter(presses, before), _scatter(presses, left_out)), tuple(notes),
    )  # fmt: skip


def _steepness(fitted: FittedLaw, force_n: FloatArray) -> float:
    """Return the exponent of force with which strength grows between the least and the greatest
    weight."""
    ends = np.array([force_n.min(), force_n.max()])
    low, high = np.log(np.maximum(FORMS[fitted.form].strength(ends, *fitted.numbers), 1e-300))
    return float((high - low) / np.log(ends[1] / ends[0]))


def fit(presses: WeighedPresses, radius_mm: float, form: str, order: int) -> FittedLaw:
    """Fit one law and one order of the gain to all ``presses``."""
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise missing_extra("model", "scipy") from None
    shape, most = FORMS[form], float(presses.force_n.max())
    u, v = presses.place_mm.T / radius_mm
    terms, log_strength = monomials(u, v, order)[:, 1:], np.log(presses.strength)

    count, scale = len(shape.names), float(np.median(presses.strength))
    free = terms.shape[1]
    units = np.array([scale, most, 1.0])[:count]
    if form == "power":
        units = np.array([scale, 1.0])

    def misfit(p: FloatArray) -> FloatArray:
        gain = np.maximum(1 + terms @ p[count:], 0.05)
        expected = np.maximum(shape.strength(presses.force_n, *np.exp(p[:count])), 1e-300)
        return np.concatenate([log_strength + np.log(gain) - np.log(expected), RIDGE * p[count:]])

    def slope(p: FloatArray) -> FloatArray:
        gain = np.maximum(1 + terms @ p[count:], 0.05)
        jacobian = np.zeros((len(log_strength) + free, len(p)))
        for k in range(count):
            step = STEP * (np.arange(count) == k)
            up, down = (
                np.log(np.maximum(shape.strength(presses.force_n, *np.exp(at)), 1e-300))
                for at in (p[:count] + step, p[:count] - step)
            )
            jacobian[: len(log_strength), k] = (down - up) / (2 * STEP)
        jacobian[: len(log_strength), count:] = terms / gain[:, None]
        jacobian[len(log_strength) :, count:] = RIDGE * np.eye(free)
        return jacobian

    low, high, start = (
        np.log(np.array(ends) * units).tolist() for ends in (shape.low, shape.high, shape.start)
    )
    bounds = (low + free * [-np.inf], high + free * [np.inf])
    solved = least_squares(
        misfit, start + free * [0.0], slope, bounds=bounds, max_nfev=100, ftol=1e-7, xtol=1e-7
    ).x
    return FittedLaw(
        form, tuple(np.exp(solved[:count]).tolist()), order, np.concatenate([[1.0], solved[count:]])
    )


def law_of(
    fitted: FittedLaw, presses: WeighedPresses, radius_mm: float, uncertainty: float
) -> ForceLaw:
    """Return ``fitted`` as a model stores it: a table up to the greatest force of ``presses``, at
    equal steps of strength."""
    shape, most = FORMS[fitted.form], float(presses.force_n.max())
    top = float(shape.strength(np.array(most), *fitted.numbers))
    strength = np.linspace(0.0, top, TABLE_POINTS)
    force_n = shape.force(strength[:-1], *fitted.numbers)
    reach = float(np.hypot(*presses.place_mm.T).max()) / radius_mm
    table = np.concatenate([force_n, [most]]).astype(np.float32)
    return ForceLaw(
        strength.astype(np.float32), table, fitted.gain.astype(np.float32), fitted.order,
        float(np.float32(radius_mm)),
        float(np.float32(reach)), float(np.float32(uncertainty)),
    )  # fmt: skip


def _left_out(
    presses: WeighedPresses, radius_mm: float, fold: IntArray, form: str, order: int
) -> FloatArray:
    """Return the relative error (k,) of the force of each press when the fit uses only the presses
    of other folds."""
    errors = np.empty(len(presses))
    for number in range(int(fold.max()) + 1):
        out = fold == number
        kept = presses.take(~out)
        law = law_of(fit(kept, radius_mm, form, order), kept, radius_mm, 0.0)
        found = law.forces_at(presses.place_mm[out], presses.strength[out])
        errors[out] = found / presses.force_n[out] - 1
    return errors


def _best(tried: dict[tuple[str, int], FloatArray]) -> tuple[str, int]:
    """Return the law and order with the best predictions, from errors (k,) by law and order. A
    later choice wins only if it reduces the error below ``WORTH`` times the best one so far."""
    (best, least), *others = ((key, _rms_log(errors)) for key, errors in tried.items())
    for key, error in others:
        if error < WORTH * least:
            best, least = key, error
    return best


def _rms_log(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.log(np.maximum(1 + errors, 1e-9)) ** 2)))


def _interval(
    presses: WeighedPresses,
    radius_mm: float,
    fitted: FittedLaw,
    fold: IntArray,
    seed: int,
    resamples: int,
) -> tuple[tuple[float, float], ...]:
    """Return the 95 % interval of each of the law's numbers, over fits to folds drawn with
    replacement."""
    generator, count = np.random.default_rng(seed), int(fold.max()) + 1
    members = [np.flatnonzero(fold == number) for number in range(count)]
    drawn = []
    for _ in range(resamples):
        rows = np.concatenate([members[k] for k in generator.integers(0, count, count)])
        sample = presses.take(rows)
        if len(weights_of(sample.force_n)) >= 2:
            drawn.append(fit(sample, radius_mm, fitted.form, fitted.order).numbers)
    ends = np.quantile(np.array(drawn or [fitted.numbers]), [0.025, 0.975], axis=0)
    return tuple((float(low), float(high)) for low, high in ends.T)


def _scatter(presses: WeighedPresses, errors: FloatArray) -> float:
    """Return the relative standard deviation over places of the measured force, around the mean of
    each weight."""
    residual = 1 + errors
    squares, count = 0.0, 0
    for weight in weights_of(presses.force_n):
        same = residual[np.abs(np.log(presses.force_n / weight)) < np.log(SAME_WEIGHT)]
        squares += float(((same / same.mean() - 1) ** 2).sum())
        count += len(same) - 1
    return float(np.sqrt(squares / max(count, 1)))
