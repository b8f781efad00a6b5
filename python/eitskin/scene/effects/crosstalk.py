"""Cross-talk: wires with neighbouring numbers couple, so a measuring wire picks up the potential of
its neighbours.

Neighbouring wires of a ribbon cable and neighbouring switches of a multiplexer couple by a
capacitance of the order of a pF. Datasheets state the part that comes through in dB (the ADG1206:
-85 dB at 1 MHz, in 50 ohm; cables with higher source impedances are far worse). The driven wires
have by far the largest potentials, so only they count as sources: a measuring wire next in number
to a driven one gets 10^(dB / 20) of its potential, relative to the mean of all electrodes. The
first and the last wire are not neighbours.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import (
    EffectCost,
    EffectSession,
    FloatArray,
    LoadedStep,
    Loads,
    Stage,
    Voltages,
)
from eitskin.skin.protocol import Protocol

NAME = "crosstalk"
STAGE = Stage.FRONT_END
ORDER = 10
SUMMARY = "Driven wires couple into measuring wires beside them."


@dataclass(frozen=True)
class Parameters:
    """The strength of the coupling."""

    coupling_db: float = parameter(
        -60.0, "dB", "voltage picked up / the driven wire's potential", low=-300, high=0
    )


def pick_up(protocol: Protocol) -> tuple[FloatArray, FloatArray]:
    """Return how often the wires of the source and the sink couple into each row's voltage, (m,)
    each, in {-1, 0, 1}."""
    rows = protocol.drive_measure.astype(np.int64)
    beside = (np.abs(rows[:, None, :2] - rows[:, 2:, None]) == 1).astype(
        np.float64
    )  # (m, [V+, V-], [I+, I-])
    onto = beside[:, 0] - beside[:, 1]
    return onto[:, 0].copy(), onto[:, 1].copy()


def make(parameters: Parameters, session: EffectSession) -> LoadedStep:
    """Return the step that adds what comes through from the two driven wires."""
    part = 10 ** (parameters.coupling_db / 20)
    of_source, of_sink = (part * weight for weight in pick_up(session.protocol))

    def apply(v: Voltages, loads: Loads, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + of_source * loads.source_v + of_sink * loads.sink_v)

    note = f"{parameters.coupling_db:g} dB of a driven wire's potential onto the wires beside it"
    return LoadedStep(NAME, STAGE, EffectCost(vector_passes_per_frame=4), note, apply)
