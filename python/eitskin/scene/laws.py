"""The law of a touch: the conductivity under it, from contact with a conductor or from force on a
piezoresistive skin.

A law gives the contrast, which is the conductivity under the touch divided by that of the skin.

- Short circuit: a conductor lies on the skin and carries current in parallel. With full contact
  (``press`` = 1) both together conduct ``contrast`` times as well as the skin alone; with less
  contact the contrast is 1 + press (contrast - 1). A finger (about 0.09 S/m) on the paper's gel
  (0.01 S/m) gives about 9.
- Piezoresistive: force brings the conductive paths of the skin together. The paper finds a nearly
  linear response from 50 to 200 g, and saturation beyond: 1 + c (1 - exp(-s grams / c)) with
  c = saturation_contrast - 1 and the slope s at zero force, ``sensitivity_per_gram``. The paper
  also finds that the slope falls towards the centre; that is a property of the image's peak, not
  of the conductivity, so it is not part of the law.
- Press and conduct: both effects, as for a finger that presses. The true contact area of two rough
  bodies first grows with the force (Greenwood and Williamson, Proc. R. Soc. A 295, 1966) and ends
  at full contact, so (contrast - 1) (1 - exp(-grams / contact_grams)) is added to the
  piezoresistive contrast.
- Insulating: the body displaces or divides the skin, as a plastic rod does in a tank. The formula
  is that of the short circuit with a contrast below 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.config import number
from eitskin.errors import ConfigError

MAX_CONTRAST = 1e4


@dataclass(frozen=True)
class ShortCircuit:
    """Contact with a conductor; ``press`` is the part of full contact, 0 to 1. A contrast below 1
    insulates."""

    contrast: float = 9.0

    def contrast_at(self, press: FloatArray) -> FloatArray:
        """Return the contrast for each ``press``, in the same shape."""
        return np.asarray(1.0 + press * (self.contrast - 1.0))


@dataclass(frozen=True)
class Piezoresistive:
    """Force on the skin, in ``grams``. ``sensitivity_per_gram`` is the slope of the contrast at
    zero force."""

    sensitivity_per_gram: float = 0.02
    saturation_contrast: float = 10.0

    def contrast_at(self, grams: FloatArray) -> FloatArray:
        """Return the contrast for each force in ``grams``, in the same shape."""
        most = self.saturation_contrast - 1.0
        return np.asarray(1.0 + most * -np.expm1(-self.sensitivity_per_gram * grams / most))


@dataclass(frozen=True)
class PressAndConduct(Piezoresistive):
    """A conductor that is pressed onto the skin with ``grams``: force on the skin, and current
    through the contact, which reaches 63 % of full contact at ``contact_grams``."""

    contrast: float = 9.0
    contact_grams: float = 50.0

    def contrast_at(self, grams: FloatArray) -> FloatArray:
        """Return the contrast for each force in ``grams``, in the same shape."""
        contact = -np.expm1(-grams / self.contact_grams)
        return np.asarray(super().contrast_at(grams) + (self.contrast - 1.0) * contact)


@dataclass(frozen=True)
class Insulating(ShortCircuit):
    """A body that does not conduct, pressed into the skin; ``press`` is 0 to 1."""

    contrast: float = 0.2


Law: TypeAlias = ShortCircuit | Piezoresistive
KINDS: dict[str, type[Law]] = {
    "short_circuit": ShortCircuit,
    "piezoresistive": Piezoresistive,
    "press_and_conduct": PressAndConduct,
    "insulating": Insulating,
}
LAWS = tuple(KINDS)
LAW_KEYS = {name: tuple(one.name for one in fields(kind)) for name, kind in KINDS.items()}
DRIVING_KEY = {
    name: "press" if issubclass(kind, ShortCircuit) else "grams" for name, kind in KINDS.items()
}
LEAST = {"saturation_contrast": 1.0}  # exclusive limit; 0 for all others
MOST = {
    "sensitivity_per_gram": 10.0,
    "saturation_contrast": 1e4,
    "contact_grams": 1e4,
    "contrast": MAX_CONTRAST,
}


def law_from_table(table: Mapping[str, Any], name: str, where: str) -> Law:
    """Return the law called ``name`` with its parameters in ``table``; keys that belong to no law
    are ignored.

    Raises:
        ConfigError: a parameter is out of range or belongs to another law.
    """
    own = (*LAW_KEYS[name], DRIVING_KEY[name])
    for other, keys in LAW_KEYS.items():
        for key in (*keys, DRIVING_KEY[other]):
            if key in table and key not in own:
                raise ConfigError(
                    f'{where}: {key} goes with law = "{other}", but the law is "{name}"; remove one'
                )
    kind, given = KINDS[name], {}
    for key in LAW_KEYS[name]:
        low, high = LEAST.get(key, 0), 1.0 if kind is Insulating else MOST[key]
        default = getattr(kind(), key)
        given[key] = number(table, key, default, where, low=low, high=high, open_low=True)
    return kind(**given)
