"""A skin that is bent over a cylinder after the tare: it deforms together with its electrodes.

A layer at height z above the neutral layer becomes longer by 1 + z / R in the direction of bending,
and thinner by the same factor (plane strain, volume kept). Summed over the heights z1 to z2, the
skin conducts 1 / ((1 + z1 / R) (1 + z2 / R)) times as well in that direction, and as before along
the cylinder. This equals a stretch by a = sqrt((1 + z1 / R) (1 + z2 / R)) between held sides. A
free skin bends about its middle (``neutral`` of 0.5), which leaves only the square of thickness
over R; a skin on a rigid base has its neutral layer there (0). If R is above 0, touches press on
the outer face; the curved coordinate is measured along the skin.
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
    """The radius, the direction, the neutral layer, and the time of the bending."""

    radius_mm: float = parameter(
        300.0, "mm", "radius of the neutral layer; below 0 the touched face is inside"
    )
    direction_deg: float = parameter(0.0, "deg", "direction of the curvature, from the x axis")
    neutral: float = parameter(
        0.0, "1", "height of the layer that keeps its length / thickness", low=0, high=1
    )
    at_s: float = parameter(0.0, "s", "time at which it begins")
    rise_s: float = parameter(0.0, "s", "time until it is complete; 0: at once", low=0)


def lengthening(parameters: Parameters, thickness_mm: float, part: float) -> float:
    """Return the stretch that conducts like the skin when ``part`` of the bending has happened."""
    low = -parameters.neutral * thickness_mm * part / parameters.radius_mm
    return sqrt((1 + low) * (1 + low + thickness_mm * part / parameters.radius_mm))


def make(parameters: Parameters, session: EffectSession) -> DeformationStep:
    """Return the step in which the curvature rises linearly; frames with equal curvature share a
    solve."""
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
