"""The configurations that ``eitskin tradeoff run`` measures: points over the scale, and one knob
turned at a time around two."""

from dataclasses import fields, replace
from typing import Any

from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options
from eitskin.tuning.configuration import Configuration
from eitskin_studies.tradeoff.configuration_sets import checked_set

STANDARD = Configuration("standard")
FINE = Configuration("fine", lambda_rel=0.005, iterations=90)
HAS_LIMIT = any(one.name == "mac_limit" for one in fields(Options))
MAC_LIMITS = (600_000, 900_000, 1_200_000, 1_800_000)
OTHER_SOLVERS = tuple(name for name in SOLVERS if name != STANDARD.solver)


def _turned(
    base: Configuration, knob: str, values: tuple[Any, ...], label: str = "{}"
) -> tuple[Configuration, ...]:
    """``base`` with one field at each value, named after both."""
    return tuple(
        replace(base, name=f"{base.name} {label.format(value)}", **{knob: value})
        for value in values
    )


# a rank that is a multiple of 16 costs the fewest instructions a MAC on the Cortex-M7
SCALE = (
    Configuration("tiny", rank=32, pixels=16, iterations=20, lambda_rel=0.05),
    Configuration("mini", rank=48, pixels=16, iterations=30),
    Configuration("small", rank=48, pixels=18, iterations=30),
    Configuration("light", rank=48, pixels=20, iterations=40),
    Configuration("lean", rank=48, pixels=24, iterations=40),
    Configuration("modest", pixels=24),
    Configuration("quick", pixels=28),
    Configuration("brisk", pixels=28, lambda_rel=0.01),
    STANDARD,
    Configuration("good", lambda_rel=0.01),
    Configuration("keen", pixels=28, lambda_rel=0.005, iterations=90),
    FINE,
    Configuration("finer", pixels=36, regularisation=0.03, lambda_rel=0.005, iterations=120),
    Configuration(
        "best", rank=80, pixels=40, regularisation=0.05, lambda_rel=0.003, iterations=150
    ),
    Configuration("calm", regularisation=0.1, lambda_rel=0.01, iterations=120),
    Configuration("calm light", rank=48, pixels=24, regularisation=0.1),
)

PLAIN = tuple(
    replace(one, name=f"{one.name} plain", touch_fit=0, model_errors=False)
    for one in SCALE
    if one.name in ("tiny", "mini", "small", "light", "lean", "modest", "quick", "standard")
)
REFINABLE = ("quick", "standard", "keen", "fine", "best")
REFINED = tuple(
    replace(one, name=f"{one.name} refined", second_pass=True)
    for one in SCALE
    if one.name in REFINABLE
)

KNOBS = {
    "touch_fit": PLAIN,
    "second_pass": REFINED,
    "iterations": (
        *_turned(STANDARD, "iterations", (10, 20, 30, 45, 90, 150, 300), "{} iterations"),
        *_turned(FINE, "iterations", (30, 60, 120, 180, 300), "{} iterations"),
    ),
    "rank": _turned(STANDARD, "rank", (24, 32, 40, 48, 56, 80, 104), "rank {}"),
    "pixels": _turned(STANDARD, "pixels", (16, 20, 36, 40, 48), "{} pixels"),
    "storage": (
        *_turned(STANDARD, "storage", ("f16", "i16", "i8"), "{}"),
        *_turned(FINE, "storage", ("f16", "i16", "i8"), "{}"),
    ),
    "samples": (
        *_turned(STANDARD, "samples", (20, 40, 160, 320), "{} samples"),
        *_turned(STANDARD, "scan", ("reciprocal",), "{}"),
        Configuration("standard reciprocal 40 samples", scan="reciprocal", samples=40),
        Configuration("standard reciprocal 20 samples", scan="reciprocal", samples=20),
    ),
    "lambda_rel": _turned(STANDARD, "lambda_rel", (0.003, 0.02, 0.05, 0.08), "lambda {}"),
    "touch_sweeps": _turned(STANDARD, "touch_sweeps", (0, 1, 2, 3, 12), "{} sweeps"),
    "solver": (
        *_turned(STANDARD, "solver", OTHER_SOLVERS),
        *_turned(FINE, "solver", OTHER_SOLVERS),
    ),
    "gap": (
        Configuration("standard gap 0.01", gap=1e-2, iterations=1000),
        Configuration("standard gap 0.003", gap=3e-3, iterations=1000),
    ),
    "mac_limit": _turned(FINE, "mac_limit", MAC_LIMITS, "limit {}") if HAS_LIMIT else (),
    "warm_start": (
        Configuration("warm 5", warm_start=True, iterations=5),
        Configuration("warm 10", warm_start=True, iterations=10),
        Configuration("warm 20", warm_start=True, iterations=20),
    ),
    "regularisation": (
        *_turned(STANDARD, "regularisation", (0.003, 0.03, 0.1, 0.3), "mu {}"),
        *_turned(FINE, "regularisation", (0.003, 0.03), "mu {}"),
    ),
    "column_power": _turned(FINE, "column_power", (0.25, 0.75), "p {}"),
}


def default_set() -> tuple[Configuration, ...]:
    """The scale first, then each knob's."""
    return checked_set(
        [*SCALE, *(one for turned in KNOBS.values() for one in turned)], "the default set"
    )
