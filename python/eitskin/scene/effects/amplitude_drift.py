"""The current's amplitude wanders: a slope, and a random walk.

References and gain resistors drift with temperature and age; over a session that is a slope to
first order, with a random walk (the integral of white noise, whose deviation grows with the square
root of time; Allan, Proc. IEEE 54, 1966) on top. All voltages scale alike. I(t) = I_0 (1 + slope t
+ walk), t from the session's first frame, where it is 0.
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
    """The slope and the walk."""

    slope_per_min: float = parameter(
        0.01, "1/min", "relative change of the amplitude a minute", low=-10, high=10
    )
    walk_per_sqrt_min: float = parameter(
        0.0, "1/sqrt(min)", "deviation of the walk after a minute", low=0, high=10
    )


def walk(parameters: Parameters, session: EffectSession) -> FloatArray:
    """The random walk's value at each frame (n_frames,), 0 at the first. Draws nothing if it is
    still."""
    if parameters.walk_per_sqrt_min == 0:
        return np.zeros(session.n_frames)
    step = parameters.walk_per_sqrt_min * sqrt(1 / (60 * session.rate_hz))
    steps = step * session.stream(NAME).standard_normal(session.n_frames - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """One factor a frame."""
    ages_min = (session.times_s() - session.times_s()[0]) / 60
    factors = 1 + parameters.slope_per_min * ages_min + walk(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v * factors[frame])

    drawn = session.n_frames - 1 if parameters.walk_per_sqrt_min else 0
    note = (
        f"{100 * parameters.slope_per_min:g} % a minute, walk"
        f" {100 * parameters.walk_per_sqrt_min:g} % in a minute"
    )
    return VoltageStep(
        NAME, STAGE, EffectCost(vector_passes_per_frame=1, random_numbers=drawn), note, apply
    )
