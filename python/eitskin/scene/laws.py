"""From a touch to the conductivity under it: by contact with a conductor, or by load on a
piezoresistive sheet.

A law gives the contrast, the conductivity under the touch divided by the sheet's.

- Short circuit: a conductor lies on the sheet and carries current beside it. With full contact
  (``press`` = 1) the two together conduct ``contrast`` times what the sheet does; less contact
  carries less: 1 + press (contrast - 1). A finger (about 0.09 S/m) on the paper's gel (0.01 S/m)
  gives about 9.
- Piezoresistive: load brings the conductive paths of the sheet together. The paper finds the
  response nearly linear from 50 to 200 g, and it saturates beyond: 1 + c (1 - exp(-s grams / c))
  with c = saturation_contrast - 1 and s the slope at no load, ``sensitivity_per_gram``. The slope
  that the paper sees fall towards the centre is one of the picture's peak, not of the conductivity,
  and so is no part of the law.
- Press and conduct: both, as of a finger that is pressed on. Of two rough bodies the true contact
  grows with the load at first (Greenwood and Williamson, Proc. R. Soc. A 295, 1966) and ends at the
  whole, so that to the piezoresistive contrast (contrast - 1) (1 - exp(-grams / contact_grams)) is
  added.
- Insulating: what is pressed on pushes the sheet aside or parts it, as a plastic rod does in a
  tank. The short circuit's formula with a contrast below 1.
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
    """Contact with a conductor, driven by ``press``: its part of full contact, 0 to 1. A contrast
    below 1 insulates."""

    contrast: float = 9.0

    def contrast_at(self, press: FloatArray) -> FloatArray:
        """Contrast for each ``press``, the same shape."""
        return np.asarray(1.0 + press * (self.contrast - 1.0))


@dataclass(frozen=True)
class Piezoresistive:
    """Load on the sheet; driven by ``grams``. ``sensitivity_per_gram`` is the slope of the contrast
    at no load."""

    sensitivity_per_gram: float = 0.02
    saturation_contrast: float = 10.0

    def contrast_at(self, grams: FloatArray) -> FloatArray:
        """Contrast for each load in ``grams``, the same shape."""
        most = self.saturation_contrast - 1.0
        return np.asarray(1.0 + most * -np.expm1(-self.sensitivity_per_gram * grams / most))


@dataclass(frozen=True)
class PressAndConduct(Piezoresistive):
    """A conductor that is pressed on: load on the sheet, and current through the contact, of which
    ``contact_grams`` make 63 %. Driven by ``grams``."""

    contrast: float = 9.0
    contact_grams: float = 50.0

    def contrast_at(self, grams: FloatArray) -> FloatArray:
        """Contrast for each load in ``grams``, the same shape."""
        contact = -np.expm1(-grams / self.contact_grams)
        return np.asarray(super().contrast_at(grams) + (self.contrast - 1.0) * contact)


@dataclass(frozen=True)
class Insulating(ShortCircuit):
    """A body that does not conduct, pressed into the sheet; driven by ``press``, 0 to 1."""

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
LEAST = {"saturation_contrast": 1.0}  # exclusive; others 0
MOST = {
    "sensitivity_per_gram": 10.0,
    "saturation_contrast": 1e4,
    "contact_grams": 1e4,
    "contrast": MAX_CONTRAST,
}


def law_from_table(table: Mapping[str, Any], name: str, where: str) -> Law:
    """The law called ``name`` with its parameters in ``table``; other keys of the table are not
    looked at."""
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
        usual = getattr(kind(), key)
        given[key] = number(table, key, usual, where, low=low, high=high, open_low=True)
    return kind(**given)
