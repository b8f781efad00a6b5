"""The multiplexers: a resistance in series with the signal, and a voltage that has not settled when
it is sampled.

Two closed switches (V+ and V-) lie between the electrodes and the input resistance of the
amplifier, and form a divider R_in / (R_in + R_plus + R_minus). Switches of one part differ
slightly; an ADG1206 has typically 120 ohm, matched to a few ohm (its datasheet, at +-15 V). After
switching, the voltage (the demodulated amplitude) approaches the new value with the time constant
of resistance and line capacitance, a first-order step response: exp(-dwell / tau) of the distance
from the voltage of the previous row remains. So the order of the scan matters. The scan counts as
periodic: the first row follows the last row of the same frame.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, Stage, Voltages, VoltageStep
from eitskin.scene.scan import settled_from_the_row_before

NAME = "mux"
STAGE = Stage.FRONT_END
ORDER = 20
SUMMARY = "Switches have a resistance, and voltages settle slowly."


@dataclass(frozen=True)
class Parameters:
    """The resistances, and the times of settling."""

    on_resistance_ohm: float = parameter(
        120.0, "ohm", "resistance of a closed switch", low=0, high=1e9
    )
    on_spread_ohm: float = parameter(
        0.0, "ohm", "each electrode's switch differs by up to this", low=0, high=1e9
    )
    input_resistance_ohm: float = parameter(
        1e7, "ohm", "between the amplifier's inputs", low=0, open_low=True
    )
    settling_us: float = parameter(
        20.0, "us", "time constant of settling; 0 settles at once", low=0, high=1e9
    )
    dwell_us: float = parameter(
        100.0, "us", "time from switching to the sample", low=0, high=1e9, open_low=True
    )


def unsettled(parameters: Parameters) -> float:
    """Return the part of the distance to the new voltage that remains at the sample: exp(-dwell /
    tau)."""
    return exp(-parameters.dwell_us / parameters.settling_us) if parameters.settling_us else 0.0


def dividers(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Return the part of each row's voltage (m,) that reaches the amplifier. No random number is
    drawn if the spread is 0."""
    count = session.skin.electrodes.count
    switches = np.full((2, count), parameters.on_resistance_ohm)
    if parameters.on_spread_ohm:
        spread = parameters.on_spread_ohm
        switches = np.maximum(
            switches + session.stream(NAME).uniform(-spread, spread, (2, count)), 0.0
        )
    plus, minus = session.protocol.drive_measure[:, 2:].T
    in_series = switches[0, plus] + switches[1, minus]
    return np.asarray(
        parameters.input_resistance_ohm / (parameters.input_resistance_ohm + in_series)
    )


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that divides the voltages, then lets them settle from the previous row."""
    gains = dividers(parameters, session)
    left = unsettled(parameters)
    order, places = session.protocol.scan_rows, session.protocol.scan_places

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(settled_from_the_row_before((v * gains)[order], left)[places])

    note = (
        f"{parameters.on_resistance_ohm:g} ohm per switch; {100 * left:.3g} % of the previous row"
        " remains"
    )
    drawn = 2 * session.skin.electrodes.count if parameters.on_spread_ohm else 0
    return VoltageStep(
        NAME, STAGE, EffectCost(vector_passes_per_frame=4, random_numbers=drawn), note, apply
    )
