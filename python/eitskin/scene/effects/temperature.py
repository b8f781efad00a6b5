"""Warmth: the conductivity of an aqueous electrolyte rises by about 2 % per kelvin.

sigma(T) = sigma_0 (1 + alpha (T - T_0)) is the linear compensation that conductivity meters use.
alpha is 0.019 to 0.022 per K for dilute salts near 25 degrees C (ISO 7888 gives the tables),
because water becomes less viscous and ions move faster. T_0 is the temperature at which the skin
has the described conductivity. Time counts from the session's first frame.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, MaterialStep, Stage

NAME = "temperature"
STAGE = Stage.MATERIAL
ORDER = 20
SUMMARY = "The skin's conductivity follows its temperature."


@dataclass(frozen=True)
class Parameters:
    """The temperature over time, and the effect of a kelvin."""

    offset_k: float = parameter(
        0.0,
        "K",
        "temperature at the first frame above that of the described skin",
        low=-50,
        high=100,
    )
    drift_k_per_min: float = parameter(
        0.2, "K/min", "rate at which the temperature rises", low=-1000, high=1000
    )
    coefficient_per_k: float = parameter(
        0.02, "1/K", "relative change of conductivity per kelvin", low=-0.1, high=0.1
    )


def temperature_factor(age_s: float, parameters: Parameters) -> float:
    """Return the conductivity ``age_s`` after the first frame, relative to the described skin's."""
    warmer_k = parameters.offset_k + parameters.drift_k_per_min * age_s / 60
    return 1 + parameters.coefficient_per_k * warmer_k


def make(parameters: Parameters, session: EffectSession) -> MaterialStep:
    """Return the step that scales the conductivity over time, with one factor for all elements."""
    times_s = session.times_s()
    ages_s = (0.0, float(times_s[-1] - times_s[0]))
    if min(temperature_factor(age_s, parameters) for age_s in ages_s) <= 0:
        raise ConfigError(
            f"drift_k_per_min: over the session's {ages_s[1]:g} s the conductivity would fall to 0;"
            " use a smaller drift"
        )
    varies = parameters.drift_k_per_min != 0 and parameters.coefficient_per_k != 0

    def apply(conductivity: FloatArray, time_s: float, frame: int) -> FloatArray:
        return np.asarray(conductivity * temperature_factor(time_s - float(times_s[0]), parameters))

    note = (
        f"conductivity x (1 + {parameters.coefficient_per_k:g}/K dT), dT = {parameters.offset_k:g}"
        f" K + {parameters.drift_k_per_min:g} K/min"
    )
    each = 1 if varies else 0
    cost = EffectCost(factorisations_per_frame=each, vector_passes_per_frame=each)
    return MaterialStep(NAME, cost, note, apply, varies=varies)
