"""The phase of the alternating current: displacement current in the skin, and a capacitive
interface under the electrodes.

At the angular frequency w the conductivity of the skin becomes the admittivity sigma + j w eps_0
eps_r (Maxwell), and the charge-transfer resistance of an interface lies parallel to the capacitance
C of its double layer (Randles, Discuss. Faraday Soc. 1, 1947, without diffusion): z(w) = z / (1 + j
w C z). Metal in water has 0.1 to 0.4 F/m2 (Bard and Faulkner, Electrochemical Methods), which
almost shorts the interface at 50 kHz. z is that of ``contact_impedance``; without that effect,
electrodes stay ideal shunts, and only the skin has a phase. The demodulator gives the part in phase
with the current, or the magnitude with the sign of that part.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from eitskin.config import parameter
from eitskin.scene.effect import (
    ComplexArray,
    EffectCost,
    EffectSession,
    FloatArray,
    PhaseStep,
    Stage,
)

NAME = "phase"
STAGE = Stage.EXCITATION
ORDER = 10
SUMMARY = "Capacitances shift the phase of voltages; the solve is complex."
SHARED = {"frequency_hz": "excitation frequency"}
VACUUM_F_PER_M = 8.8541878128e-12
NO_CONTACT_OHM_M2 = 1e4
"""From this impedance on an electrode counts as not touching (detached ones are solved so), and so
has no double layer either."""


@dataclass(frozen=True)
class Parameters:
    """The frequency, the two capacitances, and the conversion of a complex voltage to a number."""

    frequency_hz: float = parameter(
        50e3, "Hz", "excitation frequency", low=0, high=1e9, open_low=True
    )
    relative_permittivity: float = parameter(
        80.0, "1", "permittivity of the skin; water has 78 to 80", low=0, high=1e8
    )
    capacitance_f_per_m2: float = parameter(
        0.1, "F/m2", "capacitance of the double layer per contact area", low=0, high=1e3
    )
    readout: str = parameter("in_phase", "", "what is measured", choices=("in_phase", "magnitude"))


def admittivity(
    conductivity: FloatArray, frequency_hz: float, relative_permittivity: float
) -> ComplexArray:
    """Return sigma + j w eps (E,) in S/m."""
    return np.asarray(
        conductivity + 2j * pi * frequency_hz * VACUUM_F_PER_M * relative_permittivity
    )


def interface(
    impedance_ohm_m2: FloatArray, frequency_hz: float, capacitance_f_per_m2: float
) -> ComplexArray:
    """Return the charge-transfer resistance parallel to the double layer, (L,) in ohm m2; an ideal
    shunt and a missing contact stay unchanged."""
    touching = impedance_ohm_m2 < NO_CONTACT_OHM_M2
    susceptance = 2 * pi * frequency_hz * capacitance_f_per_m2 * touching
    return np.asarray(impedance_ohm_m2 / (1 + 1j * susceptance * impedance_ohm_m2))


def in_phase(voltage: ComplexArray) -> FloatArray:
    """Return the result of synchronous demodulation with the current's phase."""
    return np.ascontiguousarray(voltage.real)


def magnitude(voltage: ComplexArray) -> FloatArray:
    """Return the amplitude, with the sign of the part in phase."""
    return np.asarray(np.copysign(np.abs(voltage), voltage.real))


def make(parameters: Parameters, session: EffectSession) -> PhaseStep:
    """Return the step with the coefficients of the complex solve and the demodulator."""
    hertz = parameters.frequency_hz
    permittivity, capacitance = parameters.relative_permittivity, parameters.capacitance_f_per_m2
    return PhaseStep(
        name=NAME,
        cost=EffectCost(vector_passes_per_frame=2),
        note=(
            f"complex solve at {hertz:g} Hz, eps_r {permittivity:g}, {capacitance:g} F/m2;"
            f" {parameters.readout} read"
        ),
        frequency_hz=hertz,
        admittivity=lambda conductivity: admittivity(conductivity, hertz, permittivity),
        contact=lambda impedance: interface(impedance, hertz, capacitance),
        readout=in_phase if parameters.readout == "in_phase" else magnitude,
    )
