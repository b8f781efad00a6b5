"""Electrodes joined by a resistor, for example a solder bridge, a drop of gel on the rim, or wires
that touch.

A resistor R between electrodes i and j carries (U_i - U_j) / R. By Kirchhoff's current law this is
one more term in the electrodes' balance: it adds [[1, -1], [-1, 1]] / R to their block of the
matrix, which stays symmetric, so reciprocity holds. R = 0 makes them one electrode.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import Contacts, ContactStep, EffectCost, EffectSession, Stage

NAME = "bridged"
STAGE = Stage.BOUNDARY
ORDER = 30
SUMMARY = "Electrodes are joined by a resistance."


@dataclass(frozen=True)
class Parameters:
    """The electrodes, and the resistance between them."""

    electrodes: tuple[int, ...] = parameter(
        (0, 1), "", "electrodes joined in a chain (from 0)", low=0
    )
    resistance_ohm: float = parameter(
        10.0, "ohm", "resistance between neighbours in the chain", low=0, high=1e12
    )

    def __post_init__(self) -> None:
        if len(self.electrodes) < 2 or len(set(self.electrodes)) != len(self.electrodes):
            raise ConfigError(
                f"electrodes = {list(self.electrodes)}: name at least two, and none twice"
            )


def make(parameters: Parameters, session: EffectSession) -> ContactStep:
    """Return the step that adds the bridges."""
    session.refuse_absent(parameters.electrodes)
    bridges = tuple((i, j, parameters.resistance_ohm) for i, j in pairwise(parameters.electrodes))

    def apply(contacts: Contacts, time_s: float, frame: int) -> Contacts:
        return replace(contacts, bridges=contacts.bridges + bridges)

    joined = " - ".join(map(str, parameters.electrodes))
    note = f"electrodes {joined} (from 0) joined by {parameters.resistance_ohm:g} ohm"
    return ContactStep(NAME, EffectCost(), note, apply)
