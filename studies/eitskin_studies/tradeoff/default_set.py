"""The configurations that ``eitskin tradeoff run`` measures: points over the scale, and one knob
turned at a time around two."""

from dataclasses import fields, replace
from typing import Any

from eitskin.core.options_table import SOLVERS
from eitskin.core.results import Options
from eitskin.tuning.configuration import Configuration
from eitskin_studies.tradeoff.configuration_sets import checked_set

STANDARD = Configuration("standard")
GOOD = Configuration("good", lambda_rel=0.01)
FINE = Configuration("fine", lambda_rel=0.005, iterations=90)
HAS_LIMIT = any(one.name == "mac_limit" for one in fields(Options))
MAC_LIMITS = (1_200_000, 1_800_000)
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
    Configuration("light", rank=48, pixels=20, iterations=40),
    Configuration("lean", rank=48, pixels=24, iterations=40),
    Configuration("quick", pixels=28),
    Configuration("brisk", pixels=28, lambda_rel=0.01),
    STANDARD,
    GOOD,
    FINE,
    Configuration(
        "best", rank=80, pixels=40, regularisation=0.05, lambda_rel=0.003, iterations=150
    ),
    Configuration("calm", regularisation=0.1, lambda_rel=0.01, iterations=120),
)

PLAIN = tuple(
    replace(one, name=f"{one.name} plain", touch_fit=0, model_errors=False)
    for one in SCALE
    if one.name in ("tiny", "light", "lean", "quick", "standard")
)
REFINABLE = ("standard", "fine", "best")
REFINED = tuple(
    replace(one, name=f"{one.name} refined", second_pass=True)
    for one in SCALE
    if one.name in REFINABLE
)

# lambda follows the noise that the tare measures
BY_NOISE = (
    *_turned(GOOD, "lambda_noise_factor", (0.6, 1.0), "noise {}"),
    *_turned(FINE, "lambda_noise_factor", (0.6, 1.0), "noise {}"),
    Configuration(
        "best noise 0.6",
        rank=80,
        pixels=40,
        regularisation=0.05,
        lambda_rel=0.003,
        lambda_noise_factor=0.6,
        iterations=150,
    ),
)
# settings that stand beside other methods on every scan
COMPARED = tuple(one for one in BY_NOISE if one.name in ("good noise 1.0", "best noise 0.6"))

KNOBS = {
    "touch_fit": PLAIN,
    "second_pass": REFINED,
    "iterations": (
        *_turned(STANDARD, "iterations", (20, 30, 90, 150, 300), "{} iterations"),
        *_turned(FINE, "iterations", (60, 120, 300), "{} iterations"),
    ),
    "rank": _turned(STANDARD, "rank", (32, 48, 80), "rank {}"),
    "pixels": _turned(STANDARD, "pixels", (16, 20, 40), "{} pixels"),
    "storage": _turned(STANDARD, "storage", ("f16", "i16", "i8"), "{}"),
    "samples": (
        *_turned(STANDARD, "samples", (20, 160, 320), "{} samples"),
        *_turned(STANDARD, "scan", ("reciprocal",), "{}"),
        Configuration("standard reciprocal 20 samples", scan="reciprocal", samples=20),
        *_turned(GOOD, "samples", (160,), "{} samples"),
        *_turned(FINE, "samples", (160, 320), "{} samples"),
        *(
            replace(one, name=f"{one.name} {label}", scan=scan, samples=samples)
            for one in COMPARED
            for label, scan, samples in (
                ("20 samples", "full", 20),
                ("reciprocal", "reciprocal", 80),
                ("reciprocal 20 samples", "reciprocal", 20),
            )
        ),
    ),
    "lambda_noise_factor": BY_NOISE,
    "lambda_rel": _turned(STANDARD, "lambda_rel", (0.003, 0.02, 0.08), "lambda {}"),
    "touch_sweeps": _turned(STANDARD, "touch_sweeps", (0, 2, 12), "{} sweeps"),
    "solver": _turned(STANDARD, "solver", OTHER_SOLVERS),
    "gap": (Configuration("standard gap 0.003", gap=3e-3, iterations=1000),),
    "mac_limit": _turned(FINE, "mac_limit", MAC_LIMITS, "limit {}") if HAS_LIMIT else (),
    "warm_start": (
        Configuration("warm 10", warm_start=True, iterations=10),
        Configuration("warm 20", warm_start=True, iterations=20),
    ),
    "regularisation": (
        *_turned(STANDARD, "regularisation", (0.003, 0.1), "mu {}"),
        *_turned(FINE, "regularisation", (0.003, 0.03), "mu {}"),
    ),
    "column_power": _turned(FINE, "column_power", (0.75,), "p {}"),
}


def default_set() -> tuple[Configuration, ...]:
    """The scale first, then each knob's."""
    return checked_set(
        [*SCALE, *(one for turned in KNOBS.values() for one in turned)], "the default set"
    )
