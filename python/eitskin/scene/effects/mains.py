"""Mains hum: the remainder of the power line's 50 or 60 Hz after the demodulator.

Electric fields of the mains couple into high-impedance wires (Huhta and Webster, IEEE Trans.
Biomed. Eng. 20, 1973). The effect adds amplitude sin(2 pi f t + phase) to every row at the time at
which that row is read. Rows are read at equal intervals over a frame, so neighbouring rows see
nearly the same value, and the same row samples the hum at the frame rate r, where it appears at the
aliased frequency |f - r round(f / r)|.
"""

from dataclasses import dataclass
from math import pi, radians

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep
from eitskin.scene.scan import row_delays_s

NAME = "mains"
STAGE = Stage.FRONT_END
ORDER = 40
SUMMARY = "The power line's hum is added to every row."


@dataclass(frozen=True)
class Parameters:
    """The hum at the output of the demodulator."""

    amplitude_v: float = parameter(1e-3, "V", "peak amplitude", low=0, high=1e6)
    frequency_hz: float = parameter(
        50.0, "Hz", "frequency of the mains", low=0, high=1e6, open_low=True
    )
    phase_deg: float = parameter(
        0.0, "deg", "phase at the first recorded frame", low=-360, high=360
    )


def alias_hz(frequency_hz: float, rate_hz: float) -> float:
    """Return the frequency, 0 to rate / 2, at which a sine of ``frequency_hz`` appears when sampled
    at ``rate_hz``."""
    return abs(frequency_hz - rate_hz * round(frequency_hz / rate_hz))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that adds the sine at each row's own time."""
    delays_s = row_delays_s(session)
    omega, phase = 2 * pi * parameters.frequency_hz, radians(parameters.phase_deg)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + parameters.amplitude_v * np.sin(omega * (time_s + delays_s) + phase))

    alias = alias_hz(parameters.frequency_hz, session.rate_hz)
    note = (
        f"{parameters.amplitude_v:g} V at {parameters.frequency_hz:g} Hz, seen at {alias:g} Hz from"
        " frame to frame"
    )
    return VoltageStep(NAME, STAGE, EffectCost(vector_passes_per_frame=3), note, apply)
