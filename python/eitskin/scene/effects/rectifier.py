"""A rectifier: what is read is a magnitude, the sign is lost.

Instruments that detect an amplitude by a diode bridge, a logarithmic or an RMS detector give |v|; a
plain diode gives nothing below its forward drop (Horowitz and Hill, The Art of Electronics). It
acts on what the amplifier puts out, offset, common mode and noise included. A row whose voltage is
far from 0 keeps its change, or gives the negative of it; one near 0 is folded.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "rectifier"
STAGE = Stage.DIGITISE
ORDER = 25
SUMMARY = "Magnitudes are read, without their signs."


@dataclass(frozen=True)
class Parameters:
    """How good the rectifier is."""

    drop_v: float = parameter(0.0, "V", "what is lost of each magnitude", low=0, high=1e6)


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Folds every row."""
    drop_v = parameters.drop_v

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(np.maximum(np.abs(v) - drop_v, 0.0))

    cost = EffectCost(vector_passes_per_frame=1)
    return VoltageStep(NAME, STAGE, cost, f"magnitudes less {drop_v:g} V", apply)
