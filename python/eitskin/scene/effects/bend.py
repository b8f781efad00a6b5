"""A skin that is bent over a cylinder after the tare: sheet and electrodes deform together.

A layer at height z above the neutral one gets longer by 1 + z / R in the direction of bending, and
thinner by as much (plane strain, volume kept). Summed over the sheet's heights z1 to z2, it
conducts 1 / ((1 + z1 / R) (1 + z2 / R)) times as well in that direction and as before along the
cylinder: the same as a stretch by a = sqrt((1 + z1 / R) (1 + z2 / R)) between held sides. A sheet
that is free bends about its middle (``neutral`` of 0.5), where only the square of its thickness
over R is left; one on a base that does not give has its neutral layer there (0). Touches press on
the outer face for R above 0; the curved way is measured along the sheet.
"""

from dataclasses import dataclass
from math import sqrt

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.deformation import Deformation, stretched
from eitskin.scene.effect import DeformationStep, EffectCost, EffectSession, Stage, part_at

NAME = "bend"
STAGE = Stage.MATERIAL
ORDER = 4
SUMMARY = "The skin is bent over a cylinder, electrodes with it."


@dataclass(frozen=True)
class Parameters:
    """How sharply, which way, about which layer, when."""

    radius_mm: float = parameter(
        300.0, "mm", "of the neutral layer; below 0: the touched face is inside"
    )
    direction_deg: float = parameter(0.0, "deg", "in which it is curved, from the x axis")
    neutral: float = parameter(
        0.0, "1", "height of the layer that keeps its length / thickness", low=0, high=1
    )
    at_s: float = parameter(0.0, "s", "when it begins")
    rise_s: float = parameter(0.0, "s", "time until it is whole; 0: at once", low=0)


def lengthening(parameters: Parameters, thickness_mm: float, part: float) -> float:
    """The stretch that conducts as the sheet does when ``part`` of the bending has happened."""
    low = -parameters.neutral * thickness_mm * part / parameters.radius_mm
    return sqrt((1 + low) * (1 + low + thickness_mm * part / parameters.radius_mm))


def make(parameters: Parameters, session: EffectSession) -> DeformationStep:
    """The curvature rises evenly; frames with the same one share a solve."""
    thickness_mm = session.skin.thickness_mm
    if abs(parameters.radius_mm) <= thickness_mm:
        raise ConfigError(
            f"radius_mm = {parameters.radius_mm:g} is no more than the skin's thickness,"
            f" {thickness_mm:g} mm; bend it less"
        )

    def apply(time_s: float, frame: int) -> Deformation:
        part = part_at(time_s, parameters.at_s, parameters.rise_s)
        return stretched(lengthening(parameters, thickness_mm, part), 1.0, parameters.direction_deg)

    states = {apply(float(t), k) for k, t in enumerate(session.times_s())}
    note = f"to a radius of {parameters.radius_mm:g} mm from {parameters.at_s:g} s on"
    return DeformationStep(NAME, EffectCost(factorisations=len(states)), note, apply)
