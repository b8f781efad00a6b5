"""Charge injection: a switch that closes pushes a small charge onto its wire.

The charge Q of the gate on the capacitance C of the line makes a step Q / C, which decays with the
time constant tau (an ADG1206 typically injects 0.5 pC; its datasheet). Both measuring lines of a
pair get nearly the same charge, and the amplifier sees the difference: the charge of each
electrode's switch on each line differs by up to ``spread``. The demodulator multiplies by 2 sin(w
t) and averages over a window of whole periods, which begins ``dwell_us`` after switching with phase
0. Of the step a exp(-t / tau) it keeps

    a (2 / T) exp(-dwell / tau) (1 - exp(-T / tau)) w / (1 / tau^2 + w^2)

for a window T (an elementary integral); at frequency 0 it keeps the mean over the window. A line
whose electrode stays the same from row to row gets no charge. The voltage does not depend on the
signal.
"""

from dataclasses import dataclass
from math import exp, expm1, isclose, pi

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectCost, EffectSession, FloatArray, Stage, Voltages, VoltageStep
from eitskin.scene.scan import switched

NAME = "charge_injection"
STAGE = Stage.FRONT_END
ORDER = 30
SUMMARY = "Closing switches leave charge on the measuring lines."
SHARED = {"frequency_hz": "excitation frequency"}


@dataclass(frozen=True)
class Parameters:
    """The charge, the line, and the window of the demodulator."""

    charge_pc: float = parameter(0.5, "pC", "mean charge of a closing switch", low=-1e6, high=1e6)
    spread: float = parameter(
        0.3, "1", "each switch's charge differs by up to this part", low=0, high=1
    )
    capacitance_pf: float = parameter(
        100.0, "pF", "capacitance of a line with its wire", low=0, open_low=True
    )
    settling_us: float = parameter(
        20.0, "us", "time constant with which the charge decays", low=0, open_low=True
    )
    dwell_us: float = parameter(40.0, "us", "time from switching to window", low=0, high=1e9)
    window_us: float = parameter(
        100.0, "us", "length of the window: whole periods", low=0, high=1e9, open_low=True
    )
    frequency_hz: float = parameter(
        50e3, "Hz", "frequency of the demodulator; 0 is direct current", low=0, high=1e9
    )

    def __post_init__(self) -> None:
        periods = self.frequency_hz * self.window_us * 1e-6
        if not isclose(periods, round(periods), rel_tol=1e-6) or (
            self.frequency_hz and round(periods) < 1
        ):
            raise ConfigError(
                f"window_us = {self.window_us:g} is {periods:g} periods of {self.frequency_hz:g}"
                " Hz; give whole periods"
            )


def kept_by_demodulator(parameters: Parameters) -> float:
    """Return the part of the step Q / C that remains in the demodulated voltage."""
    tau, window = parameters.settling_us * 1e-6, parameters.window_us * 1e-6
    at_start = exp(-parameters.dwell_us / parameters.settling_us)
    decayed = -expm1(-window / tau)
    if parameters.frequency_hz == 0:
        return at_start * decayed * tau / window
    omega = 2 * pi * parameters.frequency_hz
    return at_start * decayed * 2 * omega / (window * (1 / tau**2 + omega**2))


def charges_pc(parameters: Parameters, session: EffectSession) -> FloatArray:
    """Return the charge of each electrode's switch on the lines V+ and V-, (2, L). No random number
    is drawn if the spread is 0."""
    count = session.skin.electrodes.count
    charges = np.full((2, count), parameters.charge_pc)
    if parameters.spread:
        charges = charges * (
            1 + session.stream(NAME).uniform(-parameters.spread, parameters.spread, (2, count))
        )
    return charges


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that adds a constant to each row, drawn once."""
    plus, minus = session.protocol.drive_measure[:, 2:].T
    charges, moved = charges_pc(parameters, session), switched(session.protocol)
    onto_plus, onto_minus = charges[0, plus] * moved[:, 2], charges[1, minus] * moved[:, 3]
    offsets_v = (
        (onto_plus - onto_minus) / parameters.capacitance_pf * kept_by_demodulator(parameters)
    )

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + offsets_v)

    drawn = charges.size if parameters.spread else 0
    largest_v = float(np.abs(offsets_v).max())
    note = (
        f"{parameters.charge_pc:g} pC on {parameters.capacitance_pf:g} pF: up to {largest_v:.3g} V"
        " per row"
    )
    return VoltageStep(
        NAME, STAGE, EffectCost(vector_passes_per_frame=1, random_numbers=drawn), note, apply
    )
