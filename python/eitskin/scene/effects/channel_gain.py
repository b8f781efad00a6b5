"""A gain for each measuring pair: in instruments with an amplifier per pair, gains do not match.

Resistors of 1 % make gains that differ by about 1 %. Each measuring pair (V+, V-) is a channel of
the instrument with the gain 1 + uniform(-spread, spread), drawn once; a part ``inverted`` of the
channels is wired the other way round and has the opposite sign. Two rows that are equal by
reciprocity are read by different channels, so their difference shows the mismatch; a difference
image relative to the reference (dv / v) cancels it.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, Stage, Voltages, VoltageStep
from eitskin.scene.scan import channels

NAME = "channel_gain"
STAGE = Stage.FRONT_END
ORDER = 60
SUMMARY = "Each measuring pair has its own gain."


@dataclass(frozen=True)
class Parameters:
    """The spread of the gains, and the fraction of them that is negative."""

    spread: float = parameter(
        0.01, "1", "each channel's gain differs from 1 by up to this", low=0, high=1
    )
    inverted: float = parameter(
        0.0, "1", "part of the channels whose inputs are swapped", low=0, high=1
    )


def gains(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Return the gain of each row's channel, (m,)."""
    pairs, number = channels(session.protocol)
    drawn = session.stream(NAME).uniform(-parameters.spread, parameters.spread, len(pairs))
    gain = 1 + drawn
    if parameters.inverted:
        swapped = session.stream(f"{NAME} sign").permutation(len(pairs))
        gain[swapped < round(parameters.inverted * len(pairs))] *= -1
    return np.asarray(gain[number])


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that multiplies each row by the gain of its channel."""
    factors = gains(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v * factors)

    count = len(channels(session.protocol)[0])
    note = f"{count} channels whose gains differ by up to {100 * parameters.spread:g} %"
    if parameters.inverted:
        note += f", {100 * parameters.inverted:g} % of them inverted"
    cost = EffectCost(
        vector_passes_per_frame=1, random_numbers=count * (2 if parameters.inverted else 1)
    )
    return VoltageStep(NAME, STAGE, cost, note, apply)
