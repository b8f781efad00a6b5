"""The amplitude of the current drifts: a slope, and a random walk.

References and gain resistors drift with temperature and age. Over a session this is a slope to
first order, plus a random walk (the integral of white noise, whose deviation grows with the square
root of time; Allan, Proc. IEEE 54, 1966). All voltages scale alike: I(t) = I_0 (1 + slope t +
walk), with t from the session's first frame, where the walk is 0.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, Stage, Voltages, VoltageStep

NAME = "amplitude_drift"
STAGE = Stage.EXCITATION
ORDER = 30
SUMMARY = "The current's amplitude drifts slowly."


@dataclass(frozen=True)
class Parameters:
    """The slope and the random walk."""

    slope_per_min: float = parameter(
        0.01, "1/min", "relative change of the amplitude per minute", low=-10, high=10
    )
    walk_per_sqrt_min: float = parameter(
        0.0, "1/sqrt(min)", "standard deviation of the walk after a minute", low=0, high=10
    )


def walk(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Return the value of the random walk at each frame (n_frames,), 0 at the first. No random
    number is drawn if its deviation is 0."""
    if parameters.walk_per_sqrt_min == 0:
        return np.zeros(session.n_frames)
    step = parameters.walk_per_sqrt_min * sqrt(1 / (60 * session.rate_hz))
    steps = step * session.stream(NAME).standard_normal(session.n_frames - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that multiplies each frame by one factor."""
    ages_min = (session.times_s() - session.times_s()[0]) / 60
    factors = 1 + parameters.slope_per_min * ages_min + walk(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v * factors[frame])

    drawn = session.n_frames - 1 if parameters.walk_per_sqrt_min else 0
    note = (
        f"{100 * parameters.slope_per_min:g} % per minute, walk"
        f" {100 * parameters.walk_per_sqrt_min:g} % in a minute"
    )
    return VoltageStep(
        NAME, STAGE, EffectCost(vector_passes_per_frame=1, random_numbers=drawn), note, apply
    )
