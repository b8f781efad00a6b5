"""A skin that is pulled lengthwise after the tare: it deforms together with its electrodes.

Lengths along the pull become 1 + strain. The volume is kept, so a free skin becomes narrower and
thinner by 1 / sqrt(1 + strain) each, and one held at its sides only becomes thinner. The
resistivity of a gel stays (Keplinger et al., Science 341, 2013), so the resistance of a free strip
follows the square of its length. Touches stay on the material under them. To tare the stretched
skin, let the pull begin before the untouched frames (``at_s`` of -1000).
"""

from dataclasses import dataclass

from eitskin.config import parameter
from eitskin.scene.deformation import Deformation, EvenDeformation, stretched
from eitskin.scene.effect import DeformationStep, EffectCost, EffectSession, Stage, part_at

NAME = "stretch"
STAGE = Stage.MATERIAL
ORDER = 2
SUMMARY = "The skin is pulled lengthwise, electrodes with it."


@dataclass(frozen=True)
class Parameters:
    """The strain, its direction, and its time."""

    strain: float = parameter(0.1, "1", "length gained / length", low=-0.3, high=1.0)
    direction_deg: float = parameter(0.0, "deg", "direction of the pull, from the x axis")
    sides: str = parameter("free", "", "whether sides may move in", choices=("free", "held"))
    at_s: float = parameter(0.0, "s", "time at which it begins")
    rise_s: float = parameter(0.0, "s", "time until it is complete; 0: at once", low=0)


def stretched_at(time_s: float, parameters: Parameters) -> EvenDeformation:
    """Return the deformation at a time; the strain rises linearly."""
    along = 1 + parameters.strain * part_at(time_s, parameters.at_s, parameters.rise_s)
    across = along**-0.5 if parameters.sides == "free" else 1.0
    return stretched(along, across, parameters.direction_deg)


def make(parameters: Parameters, session: EffectSession) -> DeformationStep:
    """Return the step; frames with equal strain share a solve."""

    def apply(time_s: float, frame: int) -> Deformation:
        return stretched_at(time_s, parameters)

    states = {apply(float(t), k) for k, t in enumerate(session.times_s())}
    note = f"{100 * parameters.strain:g} % from {parameters.at_s:g} s on, sides {parameters.sides}"
    return DeformationStep(NAME, EffectCost(factorisations=len(states)), note, apply)
