"""Offsets of the channels: what each reads where there is nothing.

An amplifier's input offset and bias currents across its source are added to the signal
(Pallas-Areny and Webster, Sensors and Signal Conditioning); a standing common mode that is rejected
alike in every row is the same to a reader. The offset of a measuring pair (V+, V-) is common +
spread normal(), drawn once, in parts of the rms of the untouched frame V0. A difference image
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
SUMMARY = "Each measuring pair has an offset of its own."


@dataclass(frozen=True)
class Parameters:
    """What channels share, and how far they differ."""

    common: float = parameter(
        0.0, "1", "all channels' offset / rms of the untouched frame", low=-100, high=100
    )
    spread: float = parameter(
        0.01, "1", "standard deviation between channels / the same rms", low=0, high=100
    )


def offsets_v(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Each row's offset (m,) V."""
    pairs, number = channels(session.protocol)
    drawn = session.stream(NAME).standard_normal(len(pairs))[number]
    return np.asarray(session.v0_rms_v() * (parameters.common + parameters.spread * drawn))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Adds each row's."""
    added_v = offsets_v(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + added_v)

    count = len(channels(session.protocol)[0])
    note = f"{count} channels, {added_v.min():.3g} to {added_v.max():.3g} V"
    cost = EffectCost(vector_passes_per_frame=1, random_numbers=count)
    return VoltageStep(NAME, STAGE, cost, note, apply)
