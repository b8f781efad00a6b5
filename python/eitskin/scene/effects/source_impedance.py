"""A current source with a finite output impedance: a larger load gets less current.

The current of the source divides between its output impedance (a resistance parallel to stray
capacitance) and the load, so the load gets the share 1 / (1 + Z_load Y_out), Y_out = 1 / R + j w C.
Howland sources reach some 100 kohm to 1 Mohm at 50 kHz, with tens of pF (Bertemes-Filho, Felipe and
Vincence, Circuits and Systems 4, 2013). The load is the skin with its contacts, seen from the
driven pair, and whatever lies in series (the on-resistance of two multiplexers). If no ``phase`` is
named, the part in phase with the current is used, in real arithmetic.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import EffectCost, EffectSession, LoadedStep, Loads, Stage, Voltages

NAME = "source_impedance"
STAGE = Stage.EXCITATION
ORDER = 20
SUMMARY = "The source loses current to its own output impedance."
SHARED = {"frequency_hz": "excitation frequency"}


@dataclass(frozen=True)
class Parameters:
    """The output impedance, and the resistance in series with the skin."""

    resistance_ohm: float = parameter(500e3, "ohm", "output resistance", low=0, open_low=True)
    capacitance_pf: float = parameter(
        20.0, "pF", "stray capacitance parallel to it", low=0, high=1e9
    )
    frequency_hz: float = parameter(
        50e3, "Hz", "excitation frequency; 0 is direct current", low=0, high=1e9
    )
    series_ohm: float = parameter(
        0.0, "ohm", "resistance in series with the skin, such as closed switches", low=0, high=1e9
    )


def share(load_ohm: Voltages, parameters: Parameters) -> Voltages:
    """Return the part of the current that passes the load, (m,); for real loads the part in phase,
    which is real."""
    total = load_ohm + parameters.series_ohm
    conductance = 1 / parameters.resistance_ohm
    susceptance = 2 * pi * parameters.frequency_hz * parameters.capacitance_pf * 1e-12
    if np.iscomplexobj(total):
        return np.asarray(1 / (1 + total * (conductance + 1j * susceptance)))
    real, imaginary = 1 + total * conductance, total * susceptance
    return np.asarray(real / (real * real + imaginary * imaginary))


def make(parameters: Parameters, session: EffectSession) -> LoadedStep:
    """Return the step that scales each row by the share of current that the load of its drive pair
    gets."""

    def apply(v: Voltages, loads: Loads, time_s: float, frame: int) -> Voltages:
        return np.asarray(v * share((loads.source_v - loads.sink_v) / loads.current_a, parameters))

    note = f"{parameters.resistance_ohm:g} ohm parallel to {parameters.capacitance_pf:g} pF"
    return LoadedStep(NAME, STAGE, EffectCost(vector_passes_per_frame=3), note, apply)
