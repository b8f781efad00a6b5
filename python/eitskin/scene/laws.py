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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from eitskin.config import number
from eitskin.errors import ConfigError

FloatArray = npt.NDArray[np.float64]

LAWS = ("short_circuit", "piezoresistive")
LAW_KEYS: dict[str, tuple[str, ...]] = {
    "short_circuit": ("contrast",),
    "piezoresistive": ("sensitivity_per_gram", "saturation_contrast"),
}
DRIVING_KEY = {"short_circuit": "press", "piezoresistive": "grams"}
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


Law: TypeAlias = ShortCircuit | Piezoresistive


def law_from_table(table: Mapping[str, Any], name: str, where: str) -> Law:
    """The law called ``name`` with its parameters in ``table``; other keys of the table are not
    looked at.

    Raises:
        ConfigError: a parameter is out of range, or belongs to the other law.
    """
    for other, keys in LAW_KEYS.items():
        for key in (*keys, DRIVING_KEY[other]):
            if other != name and key in table:
                raise ConfigError(
                    f'{where}: {key} goes with law = "{other}", but the law is "{name}"; remove one'
                )
    if name == "short_circuit":
        return ShortCircuit(
            number(table, "contrast", 9.0, where, low=0, high=MAX_CONTRAST, open_low=True)
        )
    default = Piezoresistive()
    return Piezoresistive(
        number(
            table,
            "sensitivity_per_gram",
            default.sensitivity_per_gram,
            where,
            low=0,
            high=10,
            open_low=True,
        ),
        number(
            table,
            "saturation_contrast",
            default.saturation_contrast,
            where,
            low=1,
            high=1e4,
            open_low=True,
        ),
    )
