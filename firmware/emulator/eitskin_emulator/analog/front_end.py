"""Generator, multiplexers, skin and converter together: the voltages at the converter at given
times.

The amplitude goes from one row's to the next one's as exp(-t / tau), tau = 1.5 us: source, cables,
skin and amplifier as one first-order lag. Sixteen microseconds leave 2e-5 of a step.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin_emulator.analog.ad9833 import Ad9833
from eitskin_emulator.analog.adg1206 import ELECTRODES, Multiplexers, Switching
from eitskin_emulator.analog.converter import CODE_V, STEPS, codes
from eitskin_emulator.analog.fixture import Fixture
from eitskin_emulator.analog.skin import AnalogSkin
from eitskin_emulator.clocktime import TICKS_PER_S

TAU_TICKS = 1.5e-6 * TICKS_PER_S
INPUT_CHANNEL, SENSE_CHANNEL = 3, 10
GAIN, MODEL_A = 3.0, 1e-3  # a skin's amplitudes are for the current of its model
SOURCE_A, SENSE_OHM, SENSE_STEPS_A_VOLT = 0.5e-3, 1000.0, 4096 / 3.3  # amplitude
# the resistance that loses as much amplitude on 10 kohm as the simulated circuit, whose 167 kohm at
# 50 kHz are mostly a capacitance; two ADG1206, data sheet
SOURCE_OUT_OHM, MULTIPLEXERS_OHM = 800e3, 240.0
KEPT = 8  # lags that are remembered: samples are asked for at most one conversion after their time


class FrontEnd:
    """``connected`` tells whether the converter's pin is in analog mode. ``before_switch`` lets
    pending samples be taken."""

    def __init__(self, generator: Ad9833, multiplexers: Multiplexers, skin: AnalogSkin) -> None:
        self.generator, self.multiplexers, self.skin = generator, multiplexers, skin
        self.connected: Callable[[], bool] = lambda: True
        self.before_switch: Callable[[], None] = lambda: None
        self.sense_connected: Callable[[], bool] = lambda: True
        # what the fitted parts give; a maker's mistake is another value
        self.source_a = SOURCE_A  # amplitude
        self.gain = GAIN
        self.supplied = True  # +-15 V
        self.source_ohm = SOURCE_OUT_OHM  # output impedance
        self.bias_codes, self.noise_codes = 0.0, 0.0  # off the middle; rms
        self.tau_ticks = TAU_TICKS
        # electrode that each address of I+, I-, V+, V- joins, None: nothing
        self.wired: list[list[int | None]] = [list(range(ELECTRODES)) for _ in range(4)]
        self.fixture: Fixture | None = None  # in place of the skin
        self._random = np.random.default_rng(1)
        self.samples = self.unsettled = 0
        self._lags: list[tuple[int, float, float]] = [
            (-(1 << 60), 0.0, 0.0)
        ]  # from a time on: target, and what is left then
        self.drive_switched: Callable[[int], None] = lambda at: None
        multiplexers.switched = self._switched

    def _switched(self, switching: Switching) -> None:
        self.before_switch()
        target = self._target_v(switching)
        start, before, left = self._lags[-1]
        reached = before + left * float(np.exp(-(switching.at - start) / self.tau_ticks))
        self._lags.append((switching.at, target, reached - target))
        del self._lags[:-KEPT]
        self.drive_switched(switching.at)

    def sample(self, times: IntArray, channel: int) -> npt.NDArray[np.uint16]:
        """Codes (.,) at ascending ``times`` (ticks)."""
        if channel != INPUT_CHANNEL or not self.connected():
            return np.zeros(len(times), dtype=np.uint16)
        self.samples += len(times)
        scale = self.gain * self.source_a / MODEL_A if self.supplied else 0.0
        volts = scale * self._amplitudes(times) * self.generator.output(times)
        off = self.bias_codes if self.supplied else -STEPS / 2  # an amplifier that is off gives 0 V
        noise = self.noise_codes * self._random.standard_normal(len(times))
        return codes(volts + CODE_V * (off + noise))

    def _target_v(self, switching: Switching) -> float:
        """The amplitude by 1 mA between the electrodes that are really joined."""
        one, two, three, four = (self._really(k, one) for k, one in enumerate(switching.joined))
        joined = (one, two, three, four)
        if self.fixture is None:
            return self.skin.amplitude_v(switching.at, joined)
        load_ohm = self.fixture.load_ohm(joined) + MULTIPLEXERS_OHM
        return MODEL_A * self.fixture.transfer_ohm(joined) / (1 + load_ohm / self.source_ohm)

    def _really(self, multiplexer: int, electrode: int | None) -> int | None:
        return None if electrode is None else self.wired[multiplexer][electrode]

    def sense(self, at: int, channel: int) -> int:
        """The code of the voltage over the sense resistor at ``at`` (ticks): half the reference,
        and what flows back through I-."""
        if channel != SENSE_CHANNEL or not self.sense_connected():
            return 0
        flows = None not in self.multiplexers.joined[:2]
        now = float(self.generator.output(np.array([at], dtype=np.int64), peek=True)[0])
        v = self.source_a * SENSE_OHM * now if flows else 0.0
        return min(max(round(2048 + v * SENSE_STEPS_A_VOLT), 0), 4095)

    def _amplitudes(self, times: IntArray) -> FloatArray:
        out = np.empty(len(times))
        for k, (start, target, left) in enumerate(self._lags):
            first = 0 if k == 0 else int(np.searchsorted(times, start))
            last = (
                len(times)
                if k + 1 == len(self._lags)
                else int(np.searchsorted(times, self._lags[k + 1][0]))
            )
            if first < last:
                out[first:last] = (
                    target
                    if left == 0
                    else target + left * np.exp(-(times[first:last] - start) / self.tau_ticks)
                )
        return out
