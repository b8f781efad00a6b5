"""A skin whose conductivity changes unevenly after the tare, suddenly or slowly.

Water, warmth and wear are uneven, so the change is a smooth random field f of unit variance over
place (``scene/random_field.py``): the conductivity is multiplied by exp(spread p(t) f), where p
rises from 0 to 1. A difference image shows all of it, because the reference does not include it.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, MaterialStep, Stage, part_at
from eitskin.scene.random_field import COSINES, random_field

NAME = "sheet_change"
STAGE = Stage.MATERIAL
ORDER = 40
SUMMARY = "The skin's conductivity has changed since the tare, unevenly."


@dataclass(frozen=True)
class Parameters:
    """The strength and smoothness of the change, and its time."""

    spread: float = parameter(
        0.02, "1", "relative standard deviation of the change over the skin", low=0, high=1
    )
    length_mm: float = parameter(
        60.0, "mm", "correlation length of the change", low=0, open_low=True
    )
    at_s: float = parameter(0.0, "s", "time at which it begins")
    rise_s: float = parameter(0.0, "s", "time until it is complete; 0: at once", low=0)


def make(parameters: Parameters, session: EffectSession) -> MaterialStep:
    """Return the step with one field, drawn once; frames in which the same part has happened share
    a solve."""
    places = session.mesh.centroids_mm()
    log_change = parameters.spread * random_field(
        places, parameters.length_mm, session.stream(NAME)
    )

    def part(time_s: float, frame: int) -> float:
        return part_at(time_s, parameters.at_s, parameters.rise_s)

    def apply(conductivity: FloatArray, time_s: float, frame: int) -> FloatArray:
        return np.asarray(conductivity * np.exp(part(time_s, frame) * log_change))

    parts = {part(float(t), k) for k, t in enumerate(session.times_s())}
    how = f"over {parameters.rise_s:g} s" if parameters.rise_s else "at once"
    note = f"changes by {100 * parameters.spread:g} % from {parameters.at_s:g} s on, {how}"
    cost = EffectCost(
        factorisations=len(parts) - 1, vector_passes_per_frame=1, random_numbers=3 * COSINES
    )
    return MaterialStep(NAME, cost, note, apply, varies=True, same=part)
