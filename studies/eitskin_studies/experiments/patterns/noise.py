"""The noise of each row, by its source and by the gain in front of the converter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.frames.front_end import CONVERTER_REACH_V, SHARE_USED, SOURCE_REACH_V, Demand, suitable
from eitskin.skin.protocol import Protocol
from eitskin.tuning.configuration import BASE_SAMPLES

BITS, CONVERTER_V = 12, 3.3  # of the NUCLEO-F767ZI
JITTER_CODES = 1.2  # rms of a sample: 8 codes from peak to peak, analogue ground done well
MAX_CURRENT_A = 0.5e-3  # of the source of docs/guide/hardware.md
AMPLIFIER_V, OUTPUT_V, THERMAL_V = 3.2e-9, 60e-9, 18e-9  # per root Hz: AD8421; 19 kohm
BURST_S = 80e-6
HEADROOM = 1.25  # half the converter's range over the greatest |V0| that it must hold
MAX_STEP = 6  # a programmable gain: 1 to 64 in powers of 2


@dataclass(frozen=True, eq=False)
class Rows:
    """The untouched rows of a pattern: ``v0_v`` (m,) in V at 1 mA, the number of each row's drive
    (m,), and what the pattern asks of the front end."""

    v0_v: FloatArray
    drive: IntArray
    demand: Demand


def rows_of(protocol: Protocol, v0_v: FloatArray, demand: Demand) -> Rows:
    """The rows of ``protocol``."""
    pairs = np.unique(protocol.drive_measure[:, :2], axis=0, return_inverse=True)[1]
    return Rows(v0_v, np.asarray(pairs, dtype=np.int64).reshape(-1), demand)


Noise = Callable[[Rows, Rows, float], FloatArray]


def volts(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """The same sigma in V for every row of every pattern."""
    return np.full(len(rows.v0_v), sigma_v)


def converter(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """One gain for the pattern: sigma is the same part of the greatest voltage."""
    return _of_range(np.full(len(rows.v0_v), np.abs(rows.v0_v).max()), adjacent, sigma_v)


def converter_by_drive(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """A gain for each drive: sigma is the same part of the drive's greatest voltage."""
    size = np.abs(rows.v0_v)
    top = np.array([size[rows.drive == drive].max() for drive in rows.drive])
    return _of_range(top, adjacent, sigma_v)


def converter_by_row(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """A gain for each row, 1 to 64 times that of the pattern in powers of 2."""
    return _of_range(np.abs(rows.v0_v).max() / row_gain(rows), adjacent, sigma_v)


def both(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """Equal parts of the adjacent pattern's variance from volts and from the converter."""
    return _sum(volts, converter, rows, adjacent, sigma_v)


def both_by_row(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """The same with a gain for each row."""
    return _sum(volts, converter_by_row, rows, adjacent, sigma_v)


def front_end(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """The front end of docs/guide/hardware.md with the resistors that suit the pattern."""
    chosen = suitable(rows.demand)
    return _physical(np.full(len(rows.v0_v), chosen.gain), chosen.current_a)


def front_end_by_row(rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    """The same with the current that its source can reach, a divider or resistor that lets the
    greatest row use the converter as before, and a gain for each row behind it."""
    current_a = min(MAX_CURRENT_A, SOURCE_REACH_V / rows.demand.drive_ohm)
    least = SHARE_USED * CONVERTER_REACH_V / (rows.demand.row_ohm * current_a)
    return _physical(least * row_gain(rows), current_a)


def row_gain(rows: Rows) -> FloatArray:
    """The gain of each row (m,) over the pattern's: the greatest step that keeps its |V0| within
    the greatest of the pattern."""
    size = np.abs(rows.v0_v)
    steps = np.floor(np.log2(size.max() / np.maximum(size, size.max() / 2**MAX_STEP)))
    return np.asarray(2.0**steps)


NOISES: Mapping[str, Noise] = {
    "volts": volts,
    "converter, one gain": converter,
    "converter, gain per drive": converter_by_drive,
    "converter, gain per row": converter_by_row,
    "both, one gain": both,
    "both, gain per row": both_by_row,
    "front end as described": front_end,
    "front end, gain per row": front_end_by_row,
}


def _of_range(top_v: FloatArray, adjacent: Rows, sigma_v: float) -> FloatArray:
    return np.asarray(sigma_v * top_v / np.abs(adjacent.v0_v).max())


def _sum(one: Noise, other: Noise, rows: Rows, adjacent: Rows, sigma_v: float) -> FloatArray:
    half_v = sigma_v / np.sqrt(2)
    return np.hypot(one(rows, adjacent, half_v), other(rows, adjacent, half_v))


def _physical(gain: FloatArray, current_a: float) -> FloatArray:
    """Sigma (m,) in V of a model for 1 mA. White noise of density e gives an amplitude over a burst
    of T the deviation e / sqrt(T); sigma per sample of n gives sigma sqrt(2 / n)."""
    code_v = CONVERTER_V / 2**BITS
    sample_v = code_v * np.hypot(JITTER_CODES, 1 / np.sqrt(12)) / gain
    density_v = np.sqrt(AMPLIFIER_V**2 + (OUTPUT_V / np.maximum(gain, 1)) ** 2 + THERMAL_V**2)
    at_electrode_v = np.hypot(sample_v * np.sqrt(2 / BASE_SAMPLES), density_v / np.sqrt(BURST_S))
    return np.asarray(at_electrode_v * 1e-3 / current_a)
