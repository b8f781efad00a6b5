"""The candidates that are compared: each method with the parameters that it may have, and the one
that it has if parameters are fixed."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_studies.compare import baselines
from eitskin_studies.compare.core_method import CoreMethod, core_methods
from eitskin_studies.compare.families import Family, Method, Setup
from eitskin_studies.compare.greit import GreitTraining, train_greit
from eitskin_studies.compare.methods import RATIOS, STEPS, STRENGTHS

FIXED_STRENGTH, FIXED_STEPS, FIXED_RATIO = 1e-5, 30.0, 1e-3
CONVERGED = 3000


@dataclass(frozen=True)
class Candidate:
    """A method under comparison.

    Attributes:
        name: in tables; ``short`` above pictures.
        parameter: what may be chosen, "" for nothing; out of ``values``.
        fixed: its value where parameters are fixed: one for all that share a parameter, amid those
            tried.
        make: the method at a value.
        claimed: the range of MIoU that the paper gives, where it does.
        own: this project's.
    """

    name: str
    short: str
    parameter: str
    values: tuple[float, ...]
    fixed: float
    make: Callable[[Setup, float], Method]
    claimed: tuple[float, float] | None = None
    own: bool = False


def candidates() -> tuple[Candidate, ...]:
    """In the order of the tables."""
    others = (0.4, 0.5)
    return (
        Candidate(
            "linear back projection", "back projection", "norm", (1.0, 2.0), 1.0, _back_projection
        ),
        Candidate(
            "Gauss-Newton (Tikhonov)",
            "Gauss-Newton",
            "strength",
            STRENGTHS,
            FIXED_STRENGTH,
            _gauss_newton,
            others,
        ),
        Candidate(
            "conjugate gradient",
            "conj. gradient",
            "steps",
            tuple(map(float, STEPS)),
            FIXED_STEPS,
            _gradient,
            others,
        ),
        Candidate("NOSER", "NOSER", "strength", STRENGTHS, FIXED_STRENGTH, _noser, others),
        Candidate("GREIT-like", "GREIT-like", "noise weight", STRENGTHS, FIXED_STRENGTH, _greit),
        *(
            _fista(iterations, signed)
            for signed in (True, False)
            for iterations in (30, 300, CONVERGED)
        ),
        Candidate(
            "eitskin 60, solver's image", "eitskin, solver", "", (0.0,), 0.0, _own(1), None, True
        ),
        Candidate(
            "eitskin 60, image shown", "eitskin, shown", "", (0.0,), 0.0, _own(2), None, True
        ),
    )


def macs_of(method: Method, dv: FloatArray) -> FloatArray:
    """Multiply-accumulates of each difference frame (k, m), (k,): counted by the core, or the same
    for every frame."""
    if isinstance(method, CoreMethod):
        return method.macs_of(dv)
    macs = getattr(method, "macs", None)
    return np.full(len(dv), np.nan if macs is None else float(macs))


def _back_projection(setup: Setup, norm: float) -> Method:
    return baselines.back_projection(setup.jacobian, norm)


def _gauss_newton(setup: Setup, strength: float) -> Method:
    return baselines.gauss_newton(setup.jacobian, strength)


def _noser(setup: Setup, strength: float) -> Method:
    return baselines.noser(setup.jacobian, strength)


def _greit(setup: Setup, weight: float) -> Method:
    return _trained(setup).method(weight)


@lru_cache(maxsize=1)
def _trained(setup: Setup) -> GreitTraining:
    return train_greit(setup.jacobian, setup.grid)


def _gradient(setup: Setup, steps: float) -> Method:
    return baselines.ConjugateGradient(setup.jacobian, int(steps))


def _fista(iterations: int, signed: bool) -> Candidate:
    """With many iterations the smaller half of the ratios only: there larger ones shrink touches to
    specks, and it takes long."""

    def make(setup: Setup, ratio: float) -> Method:
        return baselines.PlainFista(setup.jacobian, iterations, ratio, signed)

    values = RATIOS[: len(RATIOS) // 2] if iterations >= CONVERGED else RATIOS
    sign = "signed" if signed else "non-negative"
    short = f"FISTA {iterations}\n{sign}"
    return Candidate(
        f"plain FISTA {iterations}, {sign}",
        short,
        "lambda / lambda_max",
        values,
        FIXED_RATIO,
        make,
        (0.84, 0.84),
    )


def _own(place: int) -> Callable[[Setup, float], Method]:
    """One of ``core_methods``: 1 is the solver's image after 60 iterations, 2 the image shown."""
    return lambda setup, value: _families(setup)[place].make(value)


@lru_cache(maxsize=1)
def _families(setup: Setup) -> tuple[Family, ...]:
    return core_methods(setup)
