"""A rectifier: the reading is a magnitude, and the sign is lost.

Instruments that detect an amplitude by a diode bridge, a logarithmic or an RMS detector give |v|; a
plain diode gives nothing below its forward drop (Horowitz and Hill, The Art of Electronics). It
acts on the output of the amplifier, including offset, common mode and noise. A row whose voltage is
far from 0 keeps its change, or its negative; one near 0 is folded.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "rectifier"
STAGE = Stage.DIGITISE
ORDER = 25
SUMMARY = "Only magnitudes are read, without signs."


@dataclass(frozen=True)
class Parameters:
    """The quality of the rectifier."""

    drop_v: float = parameter(0.0, "V", "loss of each magnitude", low=0, high=1e6)


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that folds every row."""
    drop_v = parameters.drop_v

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(np.maximum(np.abs(v) - drop_v, 0.0))

    cost = EffectCost(vector_passes_per_frame=1)
    return VoltageStep(NAME, STAGE, cost, f"magnitudes less {drop_v:g} V", apply)
