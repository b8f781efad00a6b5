"""Mean, amplitude, phase, noise, frequency and settling time of a burst of codes."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.bringup.predicted import CODE_V
from eitskin.device.client import Device
from eitskin.device.wire.packets import ProbedBurst

Row = tuple[int, int, int, int]
LEAST_V = 0.004  # five codes; a smaller amplitude is not a signal


@dataclass(frozen=True)
class Level:
    """A burst in volts at the converter: ``mean_v``, the complex ``amplitude_v`` against the
    board's clock, the rms of the residual (``rest_v``), and the ``span_codes`` from the lowest to
    the highest code. ``clipped``: a code lies at an end of the range."""

    mean_v: float
    amplitude_v: complex
    rest_v: float
    span_codes: int
    clipped: bool

    @property
    def size_v(self) -> float:
        return abs(self.amplitude_v)


def level_of(burst: ProbedBurst, hz: float, rate_hz: float) -> Level:
    """Fit a sine of ``hz`` and a mean to a burst."""
    volts = CODE_V * burst.codes.astype(np.float64)
    turn = 2 * np.pi * hz * (1e-6 * burst.start_us + np.arange(len(volts)) / rate_hz)
    columns = np.stack([np.ones(len(volts)), np.cos(turn), np.sin(turn)], axis=1)
    found, *_ = np.linalg.lstsq(columns, volts, rcond=None)
    rest = volts - columns @ found
    codes = burst.codes
    return Level(
        float(found[0]),
        complex(found[1], -found[2]),
        float(np.sqrt(np.mean(rest**2))),
        int(codes.max() - codes.min()),
        bool(codes.min() <= 0 or codes.max() >= 4095),
    )


def frequency_of(burst: ProbedBurst, rate_hz: float) -> float:
    """The frequency of the strongest line, to a hundredth of a line's width or so."""
    volts = burst.codes - burst.codes.mean()
    lines = np.abs(np.fft.rfft(volts * np.hanning(len(volts))))
    k = int(lines[1:-1].argmax()) + 1
    before, here, after = np.log(np.maximum(lines[k - 1 : k + 2], 1e-12))
    shift = 0.5 * (before - after) / (before - 2 * here + after)
    return float((k + shift) * rate_hz / len(volts))


def settled_us(burst: ProbedBurst, hz: float, rate_hz: float, share: float) -> float:
    """Return the time after the switch until the amplitude is within ``share`` of its last value,
    by half periods."""
    half = max(round(rate_hz / hz / 2), 2)
    volts = burst.codes.astype(np.float64)
    volts = volts - volts[len(volts) // 2 :].mean()
    sizes: FloatArray = np.array(
        [np.sqrt(np.mean(volts[at : at + half] ** 2)) for at in range(0, len(volts) - half, half)]
    )
    last = np.median(sizes[len(sizes) // 2 :])
    off = np.flatnonzero(np.abs(sizes - last) > share * last)
    began_us = burst.start_us - burst.switched_us
    return float(began_us + (1e6 * half / rate_hz * (off[-1] + 1) if len(off) else 0.0))


class Prober:
    """Takes bursts of fixed rows of ``device`` at the board's own excitation and rate."""

    def __init__(self, device: Device) -> None:
        self.device = device
        info = device.info()
        self.hz, self.rate_hz = 1e-3 * info.excitation_millihz, float(info.sample_rate_hz)

    def burst(self, row: Row | None, **how: object) -> ProbedBurst:
        """A burst of ``row``, as ``Device.probe``."""
        return self.device.probe(row, **how)  # type: ignore[arg-type]

    def level(self, row: Row | None, *, generator: bool = True, samples: int = 200) -> Level:
        """The level of ``row``."""
        burst = self.burst(row, generator=generator, samples=samples)
        return level_of(burst, self.hz, self.rate_hz)
