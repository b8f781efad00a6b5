"""An outline that is not cut as described: its radius varies with the angle.

The radius about the middle is multiplied by 1 + sum_k c_k cos(k angle - phase_k) for k = 2 (oval)
and 3 (three-cornered), with normal c_k of deviation ``spread`` and uniform phases, drawn once, and
scaled so that the area is kept. Electrodes keep their fractions of the rim. Kolehmainen, Lassas and
Ola (SIAM J. Appl. Math. 66, 2005) show what a wrong outline does to images; difference imaging
cancels most of it.
"""

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError, GeometryError
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, GeometryStep, Stage
from eitskin.skin.outline import Outline, polygon
from eitskin.skin.skin import Skin

NAME = "out_of_round"
STAGE = Stage.GEOMETRY
ORDER = 5
SUMMARY = "The radius of the outline varies with the angle."
HARMONICS = (2, 3)


@dataclass(frozen=True)
class Parameters:
    """The deviation from the described outline."""

    spread: float = parameter(
        0.02, "1", "standard deviation of each wave over the radius", low=0, high=0.2
    )


def waved(outline: Outline, sizes: FloatArray, phases: FloatArray) -> Outline:
    """Return ``outline`` as a polygon with a varying radius and the same area."""
    corners = np.array(outline.vertices_mm)
    middle = np.array(outline.centre_mm)
    offsets = corners - middle
    angles = np.arctan2(offsets[:, 1], offsets[:, 0])
    waves = [
        size * np.cos(k * angles - phase)
        for k, size, phase in zip(HARMONICS, sizes, phases, strict=True)
    ]
    factors = 1 + np.sum(waves, axis=0)
    if factors.min() <= 0:
        raise GeometryError("the radius would fall to 0")
    offsets = offsets * factors[:, None]
    shape = polygon((middle + offsets).tolist())
    grow = sqrt(outline.area_mm2 / shape.area_mm2)
    return polygon((middle + grow * offsets).tolist())


def bent(skin: Skin, outline: Outline) -> Skin:
    """Return ``skin`` with another outline, its electrodes at the same fractions of the rim."""
    electrodes = skin.electrodes
    if electrodes.positions_mm is not None:
        ratio = outline.perimeter_mm / skin.outline.perimeter_mm
        places = tuple(ratio * place for place in electrodes.positions_mm)
        electrodes = replace(electrodes, positions_mm=places)
    return replace(skin, outline=outline, electrodes=electrodes)


def make(parameters: Parameters, session: EffectSession) -> GeometryStep:
    """Return the step that gives the skin to be meshed."""
    generator = session.stream(NAME)
    sizes = parameters.spread * generator.standard_normal(len(HARMONICS))
    phases = generator.uniform(0, 2 * pi, len(HARMONICS))
    try:
        bent(session.skin, waved(session.skin.outline, sizes, phases))
    except GeometryError as error:
        raise ConfigError(f"spread = {parameters.spread:g}: {error}") from None

    def apply(skin: Skin) -> Skin:
        return bent(skin, waved(skin.outline, sizes, phases))

    note = f"radius varies by up to {100 * np.abs(sizes).sum():.2g} %"
    return GeometryStep(NAME, EffectCost(random_numbers=2 * len(HARMONICS)), note, apply)
