"""Jitter of sampling: each sample is taken slightly early or late, which changes the measured
amplitude of the sine.

A sample at t + d of a sin(w t) is demodulated by 2 sin(w t) as a [cos(w d) - cos(2 w t + w d)]. Let
d be normal with deviation s / w, independent from sample to sample, and let N samples be spaced
evenly over whole periods (at least three per period, no two phases coinciding in the second
harmonic). Then the measured amplitude has exactly

    mean      a exp(-s^2 / 2)
    variance  a^2 / N [(1 - exp(-s^2))^2 / 2 + (1 - exp(-s^2)) / 2]    (about a^2 s^2 / (2 N))

and, being a mean of N, is nearly normal. The factor s = 2 pi f d is the classical bound on a
converter's SNR by its clock (Shinagawa, Akazawa and Wakimoto, IEEE J. Solid-State Circuits 25,
1990). Small signals get small errors.
"""

from dataclasses import dataclass
from math import exp, expm1, pi, sqrt

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "jitter"
STAGE = Stage.DIGITISE
ORDER = 10
SUMMARY = "Samples are taken slightly early or late."
SHARED = {"frequency_hz": "excitation frequency"}


@dataclass(frozen=True)
class Parameters:
    """The jitter of the clock, and the number of samples per value."""

    jitter_ns: float = parameter(
        10.0, "ns", "standard deviation of a sample's time", low=0, high=1e9
    )
    frequency_hz: float = parameter(
        50e3, "Hz", "excitation frequency", low=0, high=1e9, open_low=True
    )
    samples: int = parameter(
        64, "", "number of samples per demodulated voltage", low=3, high=1_000_000
    )


def amplitude_error(parameters: Parameters) -> tuple[float, float]:
    """Return mean and standard deviation of the measured amplitude, both relative to the true
    one."""
    s = 2 * pi * parameters.frequency_hz * parameters.jitter_ns * 1e-9
    spread = -expm1(-s * s)
    return exp(-s * s / 2), sqrt((spread * spread + spread) / (2 * parameters.samples))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that scales each row by its own random amplitude, drawn for each frame."""
    mean, deviation = amplitude_error(parameters)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(
            v * (mean + deviation * session.stream(NAME, frame).standard_normal(len(v)))
        )

    rows = session.protocol.n_rows
    note = (
        f"{parameters.jitter_ns:g} ns at {parameters.frequency_hz:g} Hz: {100 * deviation:.3g} % of"
        " each voltage"
    )
    cost = EffectCost(vector_passes_per_frame=2, random_numbers_per_frame=rows)
    return VoltageStep(NAME, STAGE, cost, note, apply)
