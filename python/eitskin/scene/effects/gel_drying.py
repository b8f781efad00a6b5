"""A hydrogel that dries: its conductivity falls as water leaves.

Thin-layer drying in the falling-rate period is first order (Lewis, Ind. Eng. Chem. 13, 1921): the
free water content decays exponentially to the equilibrium with the air. The conductivity of a
porous medium filled with electrolyte follows a power of its water fraction (Archie, Trans. AIME
146, 1942; exponents of 1.3 to 2), so

    water(t) = final + (1 - final) exp(-t / tau),    sigma(t) = sigma_0 water(t)^exponent.

The whole skin dries evenly. Time counts from the session's first frame, at which the skin is as
described.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, MaterialStep, Stage

NAME = "gel_drying"
STAGE = Stage.MATERIAL
ORDER = 30
SUMMARY = "The skin's conductivity falls as its water leaves."


@dataclass(frozen=True)
class Parameters:
    """The speed and the extent of drying, and the exponent of the conductivity."""

    time_constant_h: float = parameter(
        4.0, "h", "time in which 63 % of the free water leaves", low=0, open_low=True
    )
    final_water: float = parameter(
        0.5, "1", "water left at the end / water at the start", low=0, high=1, open_low=True
    )
    exponent: float = parameter(
        1.5, "1", "conductivity follows this power of the water content", low=0, high=5
    )


def drying_factor(age_s: float, parameters: Parameters) -> float:
    """Return the conductivity after ``age_s`` relative to that at the start."""
    final = parameters.final_water
    water = final + (1 - final) * exp(-age_s / (3600 * parameters.time_constant_h))
    return float(water**parameters.exponent)


def make(parameters: Parameters, session: EffectSession) -> MaterialStep:
    """Return the step that scales the conductivity over time, with one factor for all elements."""
    start_s = float(session.times_s()[0])

    def apply(conductivity: FloatArray, time_s: float, frame: int) -> FloatArray:
        return np.asarray(conductivity * drying_factor(time_s - start_s, parameters))

    note = (
        f"conductivity x water^{parameters.exponent:g}, water falling to {parameters.final_water:g}"
        f" with {parameters.time_constant_h:g} h"
    )
    cost = EffectCost(factorisations_per_frame=1, vector_passes_per_frame=1)
    return MaterialStep(NAME, cost, note, apply, varies=True)
