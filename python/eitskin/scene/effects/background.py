"""An uneven skin: a smooth random pattern of conductivity whose mean over the area is kept.

The pattern is a Gaussian random field f of unit variance (``scene/random_field.py``). With q = ln(1
+ spread^2) the conductivity is multiplied by exp(sqrt(q) f), which is log-normal with a relative
deviation of ``spread``, so always above 0. Division by its mean over the area makes the mean
exactly that of the skin's description.
"""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, MaterialStep, Stage
from eitskin.scene.random_field import COSINES, random_field

NAME = "background"
STAGE = Stage.MATERIAL
ORDER = 10
SUMMARY = "The skin's conductivity varies smoothly from place to place."


@dataclass(frozen=True)
class Parameters:
    """The strength and the smoothness of the pattern."""

    spread: float = parameter(
        0.1, "1", "relative standard deviation of the conductivity", low=0, high=2
    )
    length_mm: float = parameter(
        30.0, "mm", "correlation length of the pattern", low=0, open_low=True
    )


def pattern(
    places_mm: FloatArray, areas: FloatArray, parameters: Parameters, draw: np.random.Generator
) -> FloatArray:
    """Return factors (k,) above 0 whose mean weighted by ``areas`` (k,) is 1."""
    field = random_field(places_mm, parameters.length_mm, draw)
    factors = np.exp(sqrt(log(1 + parameters.spread**2)) * field)
    return np.asarray(factors / np.average(factors, weights=areas))


def make(parameters: Parameters, session: EffectSession) -> MaterialStep:
    """Return the step with one factor per element, drawn once."""
    mesh = session.mesh
    factors = pattern(mesh.centroids_mm(), mesh.areas_mm2, parameters, session.stream(NAME))

    def apply(conductivity: FloatArray, time_s: float, frame: int) -> FloatArray:
        return np.asarray(conductivity * factors)

    note = (
        f"conductivity varies by {100 * parameters.spread:g} % over {parameters.length_mm:g} mm,"
        " its mean kept"
    )
    return MaterialStep(NAME, EffectCost(random_numbers=3 * COSINES), note, apply)
