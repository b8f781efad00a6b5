"""The common mode of the amplifier: the mean voltage of both inputs appears in the output, divided
by the rejection ratio.

An instrumentation amplifier gives v_difference + v_common / CMRR (referred to its input), with
v_common = (V+ + V-) / 2 against its ground (Pallas-Areny and Webster, Sensors and Signal
Conditioning). 80 to 100 dB at direct current shrink to 50 to 70 dB at 50 kHz, mostly because the
capacitances of the two lines are unequal, so either sign occurs. With a grounded sink the
electrodes are at half the driven voltage, often far above the measured difference; a balanced
source keeps their mean at ground.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, LoadedStep, Loads, Stage, Voltages

NAME = "common_mode"
STAGE = Stage.FRONT_END
ORDER = 50
SUMMARY = "A part of the inputs' common voltage appears as signal."


@dataclass(frozen=True)
class Parameters:
    """The rejection, and the ground."""

    cmrr_db: float = parameter(
        60.0, "dB", "common-mode rejection ratio at the excitation frequency", low=0, high=300
    )
    ground: str = parameter(
        "sink", "", "the electrode I-, or the mean of all electrodes", choices=("sink", "mean")
    )
    inverted: bool = parameter(False, "", "whether it has the opposite sign")


def common_v(loads: Loads, ground: str) -> Voltages:
    """Return the mean of the two inputs against ground, (m,)."""
    middle = (loads.plus_v + loads.minus_v) / 2
    return np.asarray(middle - loads.sink_v if ground == "sink" else middle)


def make(parameters: Parameters, session: EffectSession) -> LoadedStep:
    """Return the step that adds what the amplifier does not reject."""
    passed = 10 ** (-parameters.cmrr_db / 20) * (-1 if parameters.inverted else 1)

    def apply(v: Voltages, loads: Loads, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + passed * common_v(loads, parameters.ground))

    note = f"CMRR {parameters.cmrr_db:g} dB, ground at the {parameters.ground}"
    return LoadedStep(NAME, STAGE, EffectCost(vector_passes_per_frame=4), note, apply)
