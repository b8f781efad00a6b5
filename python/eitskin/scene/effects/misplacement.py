"""Electrodes that are not where the description puts them: each is shifted along the rim.

Hand-made skins place electrodes to about a millimetre. Shifts are given, or uniform within +-
spread, drawn once. A reconstruction that assumes the described places then uses a wrong model (the
classical modelling error of absolute EIT; difference imaging cancels most of it).
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError, GeometryError
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, GeometryStep, Stage
from eitskin.skin.skin import Skin

NAME = "misplacement"
STAGE = Stage.GEOMETRY
ORDER = 10
SUMMARY = "Electrodes are shifted from their described places."


@dataclass(frozen=True)
class Parameters:
    """The range of random shifts, or known shifts."""

    spread_mm: float = parameter(
        1.0, "mm", "each electrode is shifted along the rim by up to +- this", low=0
    )
    shift_mm: tuple[float, ...] = parameter(
        (),
        "mm",
        "known shifts instead, one per electrode, in the direction of numbering",
    )


def shifted(skin: Skin, shift_mm: FloatArray) -> Skin:
    """Return ``skin`` with each electrode moved by ``shift_mm`` (L,) along the rim, in the
    direction of numbering."""
    electrodes = skin.electrodes
    along = np.arange(electrodes.count) * (skin.outline.perimeter_mm / electrodes.count)
    if electrodes.positions_mm is not None:
        along = np.array(electrodes.positions_mm, dtype=np.float64)
    places = tuple(float(place) for place in along + shift_mm)
    return replace(skin, electrodes=replace(electrodes, positions_mm=places))


def make(parameters: Parameters, session: EffectSession) -> GeometryStep:
    """Return the step that gives the skin to be meshed."""
    count, spread = session.skin.electrodes.count, parameters.spread_mm
    known = len(parameters.shift_mm)
    if known not in (0, count):
        raise ConfigError(f"shift_mm: {known} shifts for {count} electrodes; give one each")
    shift_mm = (
        np.array(parameters.shift_mm)
        if known
        else session.stream(NAME).uniform(-spread, spread, count)
    )
    try:
        shifted(session.skin, shift_mm)
    except GeometryError as error:
        key = "shift_mm" if known else f"spread_mm = {spread:g}"
        raise ConfigError(f"{key}: {error}") from None

    def apply(skin: Skin) -> Skin:
        return shifted(skin, shift_mm)

    note = f"electrodes shifted along the rim by up to {np.abs(shift_mm).max():.3g} mm"
    return GeometryStep(NAME, EffectCost(random_numbers=0 if known else count), note, apply)
