"""Samples, codes and amplitude that the firmware makes of a voltage over time."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_hardware.spice.elements import ADC_F, ADC_OHM

SAMPLE_S = 1e-6  # at 1 MHz
APERTURE_S = 3 / 27e6  # three cycles of the converter's clock
SAMPLES = 80
REFERENCE_V, STEPS = 3.3, 4096


def sampler(node: str = "converter") -> tuple[str, ...]:
    """Return the converter's switch and capacitor as lines of a deck: closed for 3 cycles of 27 MHz
    before each sample."""
    return (
        f"VSH sh 0 pulse(0 1 {SAMPLE_S - APERTURE_S:g} 1n 1n {APERTURE_S:g} {SAMPLE_S:g})",
        f"BSH {node} held i = v({node},held)*v(sh)/{ADC_OHM:g}",
        f"CSH held 0 {ADC_F:g}",
    )


def codes(course: FloatArray, start_s: float, samples: int = SAMPLES) -> FloatArray:
    """Return the codes of ``samples`` samples from ``start_s`` on, from the held voltage in column
    1 of ``course``. A sample is held from its instant to the next aperture."""
    at = start_s + SAMPLE_S * np.arange(samples) + 0.4 * (SAMPLE_S - APERTURE_S)
    volts = np.interp(at, course[:, 0], course[:, 1])
    return np.asarray(np.clip(np.round(volts / (REFERENCE_V / STEPS)), 0, STEPS - 1))


def demodulated(
    codes_or_volts: FloatArray, start_s: float, frequency_hz: float = 50_000.0
) -> complex:
    """Return the complex amplitude of equidistant samples."""
    phase = 2 * np.pi * frequency_hz * (start_s + SAMPLE_S * np.arange(len(codes_or_volts)))
    return complex(2 * np.mean(codes_or_volts * np.exp(-1j * phase)))
