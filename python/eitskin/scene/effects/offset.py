"""Offsets of the channels: the reading of each without a signal.

The input offset of an amplifier, and its bias currents across the source, are added to the signal
(Pallas-Areny and Webster, Sensors and Signal Conditioning). A constant common mode that is rejected
equally in every row looks the same to the reader. The offset of a measuring pair (V+, V-) is common
+ spread normal(), drawn once, relative to the rms of the untouched frame V0. A difference image
cancels it; behind a rectifier it decides which rows grow and which shrink when a finger presses.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, Stage, Voltages, VoltageStep
from eitskin.scene.scan import channels

NAME = "offset"
STAGE = Stage.FRONT_END
ORDER = 70
SUMMARY = "Each measuring pair has its own offset."


@dataclass(frozen=True)
class Parameters:
    """The offset that channels share, and how much they differ."""

    common: float = parameter(
        0.0, "1", "all channels' offset / rms of the untouched frame", low=-100, high=100
    )
    spread: float = parameter(
        0.01, "1", "standard deviation between channels / the same rms", low=0, high=100
    )


def offsets_v(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Return the offset of each row (m,) in V."""
    pairs, number = channels(session.protocol)
    drawn = session.stream(NAME).standard_normal(len(pairs))[number]
    return np.asarray(session.v0_rms_v() * (parameters.common + parameters.spread * drawn))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that adds the offset of each row."""
    added_v = offsets_v(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + added_v)

    count = len(channels(session.protocol)[0])
    note = f"{count} channels, {added_v.min():.3g} to {added_v.max():.3g} V"
    cost = EffectCost(vector_passes_per_frame=1, random_numbers=count)
    return VoltageStep(NAME, STAGE, cost, note, apply)
