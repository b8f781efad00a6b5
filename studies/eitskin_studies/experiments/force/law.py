"""The effect of a weight on the sheet, and how sure it is: a disc's radius by Hertz, its contrast
by the piezoresistive law.

- Contact radius: a rigid round tip of radius rho on an elastic half-space of reduced modulus E*
  under load F has a = (3 F rho / (4 E*))^(1/3) (Hertz 1882; Johnson, Contact Mechanics, 1985,
  section 4.2). Hydrogels of skins have moduli of tens of kPa. The sheet, 12 mm, is no half-space
  beside contacts of 8 mm: that goes into the deviation of the modulus.
- Contrast: ``scene.laws.Piezoresistive``, 1 + c (1 - exp(-s grams / c)).
- Under a metal sheet the contact's area stays, and the contrast is what the round tip's 50 g make
  of the same pressure.

Parameters are uncertain by relative standard deviations (log-normal), which say how far real gels
and tips may be from this one.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.core.results import NEWTONS_PER_GRAM
from eitskin.scene.laws import Piezoresistive
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.streams import stream

WEIGHTS_G = (50.0, 80.0, 100.0, 150.0, 200.0)
DEVIATION = {"modulus_pa": 0.25, "tip_mm": 0.1, "sensitivity_per_gram": 0.2, "saturation": 0.2}


@dataclass(frozen=True)
class PressLaw:
    """A skin and a tip: ``modulus_pa`` E*, ``tip_mm`` rho, ``sensitivity_per_gram`` s,
    ``saturation`` c (the greatest contrast less 1)."""

    modulus_pa: float = 40e3
    tip_mm: float = 12.0
    sensitivity_per_gram: float = 0.02
    saturation: float = 9.0

    def radius_mm(self, grams: float) -> float:
        """The radius of the contact in mm."""
        newtons = grams * NEWTONS_PER_GRAM
        return float(1e3 * (0.75 * newtons * self.tip_mm * 1e-3 / self.modulus_pa) ** (1 / 3))

    def contrast(self, grams: float) -> float:
        """Under it."""
        law = Piezoresistive(self.sensitivity_per_gram, 1 + self.saturation)
        return float(law.contrast_at(np.array(grams)))

    def pressure_kpa(self, grams: float) -> float:
        """The mean over the contact."""
        area_m2 = np.pi * (1e-3 * self.radius_mm(grams)) ** 2
        return float(1e-3 * grams * NEWTONS_PER_GRAM / area_m2)

    def touch(self, grams: float, place_mm: npt.ArrayLike) -> TrueTouch:
        """The disc that a weight makes at a place."""
        x, y = np.asarray(place_mm, dtype=np.float64)
        return TrueTouch(float(x), float(y), self.radius_mm(grams), self.contrast(grams))


NOMINAL = PressLaw()


@dataclass(frozen=True)
class SheetLaw(PressLaw):
    """A weight on a round metal sheet, as in the paper. Its radius is 11 mm, so that 200 g stay
    below the limit of the paper's gel."""

    sheet_mm: float = 11.0

    def radius_mm(self, grams: float) -> float:
        """The sheet's."""
        return self.sheet_mm

    def contrast(self, grams: float) -> float:
        """Return the contrast of a round tip's 50 g, scaled by the pressure."""
        tip = WEIGHTS_G[0] * self.pressure_kpa(grams) / NOMINAL.pressure_kpa(WEIGHTS_G[0])
        return super().contrast(tip)


SHEET = SheetLaw()
GEL_LIMIT_KPA = 5.41  # the paper's gel


def drawn_laws(seed: int, count: int) -> tuple[PressLaw, ...]:
    """Draw ``count`` skins and tips; the first ones are those of a smaller count."""
    laws = []
    for k in range(count):
        normal = stream(seed, "force law", k).standard_normal(len(DEVIATION))
        factors = np.exp(np.array(list(DEVIATION.values())) * normal).tolist()
        laws.append(
            PressLaw(
                **{
                    name: getattr(NOMINAL, name) * by
                    for name, by in zip(DEVIATION, factors, strict=True)
                }
            )
        )
    return tuple(laws)
