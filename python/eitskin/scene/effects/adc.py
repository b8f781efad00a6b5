"""The converter: voltages become integer steps, and values out of range become the first or the
last step.

It is mid-tread, two's complement: B bits over +-range have the step LSB = 2 range / 2^B and codes
from -2^(B-1) to 2^(B-1) - 1. The error is uniform over a step, with the variance LSB^2 / 12, if the
signal moves over many steps (Bennett, Bell Syst. Tech. J. 27, 1948). The result is code times LSB,
in V.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "adc"
STAGE = Stage.DIGITISE
ORDER = 40
SUMMARY = "Voltages are rounded to the converter's steps."


@dataclass(frozen=True)
class Parameters:
    """The resolution, and the range as a voltage or as a headroom (default 1.25)."""

    bits: int = parameter(12, "bit", "resolution", low=1, high=32)
    range_v: float | None = parameter(
        None, "V", "half the span of the converter", low=0, open_low=True
    )
    headroom: float | None = parameter(
        None, "1", "range / largest untouched voltage", low=0, high=1e6, open_low=True
    )

    def __post_init__(self) -> None:
        if self.range_v is not None and self.headroom is not None:
            raise ConfigError("range_v: give either range_v or headroom")


def codes(v: Voltages, lsb_v: float, bits: int) -> Voltages:
    """Return integers (m,), as float64, from -2^(bits - 1) to 2^(bits - 1) - 1."""
    half = 2.0 ** (bits - 1)
    return np.asarray(np.clip(np.round(v / lsb_v), -half, half - 1))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that rounds every row."""
    span_v = session.limit_v(parameters.range_v, parameters.headroom)
    lsb_v = 2 * span_v / 2**parameters.bits

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(codes(v, lsb_v, parameters.bits) * lsb_v)

    note = f"{parameters.bits} bits over +-{span_v:.3g} V, step {lsb_v:.3g} V"
    return VoltageStep(NAME, STAGE, EffectCost(vector_passes_per_frame=3), note, apply)
