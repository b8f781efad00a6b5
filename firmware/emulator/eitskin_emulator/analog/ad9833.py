"""The AD9833 waveform generator (data sheet Rev. G): decodes the bits that are shifted in, and
gives its output at any time.

A bit is taken at each falling edge of SCLK while FSYNC is low; 16 make a word, fewer are forgotten
when FSYNC rises (figure 4). In SPI modes 0 and 3 data changes at that very edge: the emulator lets
the part see the bit after (mode 0) or before it (mode 3), either of which garbles every word. SCLK
must be high when FSYNC falls (t11): mode 1 is decoded, and counted in ``early_clocks``.

The accumulator takes 28 bits and runs from MCLK in the board's time; changes take effect when the
word's last bit is in (7 or 8 MCLK cycles later on silicon). The output is the sine itself: the
steps of the part's ROM (12 bits of phase) and converter (10 bits) are harmonics that alias onto the
excitation only from 950 kHz on, where front end and filter have ended. After power-up the registers
hold what no program may rely on: here RESET clear and a frequency of 1 kHz. What follows the pin is
linear.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin_emulator.clocktime import TICKS_PER_S
from eitskin_emulator.peripherals.spi import SpiFrame

B28, HLB, FSELECT, PSELECT, RESET, SLEEP1, SLEEP12, OPBITEN, MODE = (
    1 << k for k in (13, 12, 11, 10, 8, 7, 6, 5, 1)
)
FULL_TURN = 1 << 28
WORD_BITS = 16
WAVEFORMS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "sine": lambda turn: np.sin(2 * np.pi * turn),
    "triangle": lambda turn: 1 - 4 * np.abs(turn - 0.5),
    "square": lambda turn: np.where(
        turn < 0.5, -1.0, 1.0
    ),  # the top bit; a square at half the frequency (DIV2 = 0) is not distinguished
}


@dataclass(frozen=True)
class Course:
    """From ``start`` on the accumulator is ``phase`` + ``step`` a cycle of MCLK, plus ``offset``,
    and gives ``waveform``."""

    start: int
    phase: int
    step: int
    offset: int
    waveform: str
    running: bool


class Ad9833:
    """``words`` are those that it took, in order; ``mclk_hz`` is its clock now."""

    def __init__(self) -> None:
        self.mclk_hz = 0
        self.oscillator_hz = 0  # of a module that has its own; 0: none
        self.words: list[int] = []
        self.ignored_bits = self.early_clocks = 0
        self._selected_at: int | None = None  # when FSYNC fell
        self._shift, self._bits, self._before = 0, 0, 0
        self._control = 0
        self._freq = [round(1000 * FULL_TURN / 8e6)] * 2
        self._low: list[int | None] = [None, None]
        self._phase = [0, 0]
        self.courses = [self._course(0, 0)]
        self.took: Callable[[int, int], None] = lambda at, word: None

    # ---- the bus ----

    def fsync(self, at: int, level: int) -> None:
        """FSYNC changes."""
        if level:
            self.ignored_bits += self._bits
            self._selected_at = None
        else:
            self._selected_at = at
        self._shift = self._bits = 0

    def shifted(self, frame: SpiFrame) -> None:
        """Bits have been clocked on the bus."""
        value = self._seen(frame)
        self._before = frame.value & 1
        if self._selected_at is None or self._selected_at > frame.start:
            self.ignored_bits += frame.bits if self._selected_at is not None else 0
            return
        self.early_clocks += frame.cpol == 0
        self._shift = self._shift << frame.bits | value
        self._bits += frame.bits
        if self._bits >= WORD_BITS:
            self._bits -= WORD_BITS
            self._word(self._shift >> self._bits & 0xFFFF, frame.end)

    def _seen(self, frame: SpiFrame) -> int:
        """The bits on SDATA at the falling edges."""
        mask = (1 << frame.bits) - 1
        if frame.cpol != frame.cpha:
            return frame.value
        if frame.cpol == 0:
            return frame.value << 1 & mask | frame.value & 1
        return self._before << (frame.bits - 1) | frame.value >> 1

    # ---- registers ----

    def _word(self, word: int, at: int) -> None:
        self.words.append(word)
        kind = word >> 14
        if kind == 0:
            if (word ^ self._control) & B28:
                self._low = [None, None]
            self._control = word
        elif kind in (1, 2):
            self._frequency(kind - 1, word & 0x3FFF)
        else:
            self._phase[word >> 13 & 1] = word & 0xFFF
        self._go_on(at)
        self.took(at, word)

    def _frequency(self, register: int, value: int) -> None:
        if self._control & B28:
            low = self._low[register]
            if low is None:
                self._low[register] = value
            else:
                self._freq[register] = value << 14 | low
                self._low[register] = None
        elif self._control & HLB:
            self._freq[register] = self._freq[register] & 0x3FFF | value << 14
        else:
            self._freq[register] = self._freq[register] & ~0x3FFF | value

    def set_mclk(self, at: int, hz: int) -> None:
        """MCLK changes; 0: it stands still."""
        hz = self.oscillator_hz or hz
        if hz != self.mclk_hz:
            phase = self._accumulator(at)
            self.mclk_hz = hz
            self.courses.append(self._course(at, phase))

    def _go_on(self, at: int) -> None:
        course = self._course(at, self._accumulator(at))
        if course != self.courses[-1]:
            self.courses.append(course)

    def _accumulator(self, at: int) -> int:
        return int(self.phases(np.array([at], dtype=np.int64), self.courses[-1])[0])

    def _course(self, at: int, phase: int) -> Course:
        control = self._control
        step = self._freq[1 if control & FSELECT else 0]
        if control & RESET:
            phase = step = 0
        if control & SLEEP1 or not self.mclk_hz:
            step = 0
        offset = self._phase[1 if control & PSELECT else 0] << 16
        running = not control & (RESET | SLEEP12)
        return Course(at, phase, step, offset, _waveform(control), running)

    # ---- the output ----

    @property
    def frequency_hz(self) -> float:
        """The frequency of the output; 0: no output."""
        course = self.courses[-1]
        return course.step / FULL_TURN * self.mclk_hz if course.running else 0.0

    def phases(self, times: IntArray, course: Course) -> IntArray:
        """The accumulator (.,), 28 bits, without the phase register."""
        if not (course.step and self.mclk_hz):
            return np.full(len(times), course.phase, dtype=np.int64)
        cycles = (times - course.start) // (TICKS_PER_S // self.mclk_hz)
        return np.asarray((course.phase + course.step * cycles) % FULL_TURN)

    def output(self, times: IntArray, *, peek: bool = False) -> FloatArray:
        """From -1 to 1 (.,) at ascending ``times``, 0 at mid-scale; ``times`` go forward from call
        to call, but for a ``peek``."""
        courses = self.courses
        while not peek and len(courses) > 1 and courses[1].start <= times[0]:
            courses.pop(0)
        out = np.zeros(len(times))
        for k, course in enumerate(courses):
            first = 0 if k == 0 else int(np.searchsorted(times, course.start))
            last = (
                len(times)
                if k + 1 == len(courses)
                else int(np.searchsorted(times, courses[k + 1].start))
            )
            if course.running and first < last:
                phase = (self.phases(times[first:last], course) + course.offset) % FULL_TURN
                out[first:last] = WAVEFORMS[course.waveform](phase / FULL_TURN)
        return out


def _waveform(control: int) -> str:
    if control & OPBITEN:
        return "square"
    return "triangle" if control & MODE else "sine"
