"""ADC1 converting one regular channel on a timer's update (RM0410 chapter 15); a burst is worked
out at once, by numpy.

A trigger is followed by the sampling time, whose end is the instant that the front end is asked
for, and by 12 cycles of conversion (15.5). A trigger while it converts is ignored. With DMA, a
result that no stream takes before the next one sets OVR and stops the requests. Modelled
resolution: 12 bits, right-aligned. Results are in memory when DMA's flag says so, when the program
reads a register of ADC or DMA, or when the multiplexers switch; a program that watches memory alone
sees them late.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from eitskin.arrays import IntArray
from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.adc2 import SingleConverter
from eitskin_emulator.peripherals.dma import TO_MEMORY, Dma
from eitskin_emulator.peripherals.nvic import Nvic
from eitskin_emulator.peripherals.rcc import Rcc
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.peripherals.tim import Timer
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import NEVER, Event, Schedule

SR, CR1, CR2, SMPR1, SMPR2, SQR1, SQR3, DR, CCR = (
    0x00,
    0x04,
    0x08,
    0x0C,
    0x10,
    0x2C,
    0x34,
    0x4C,
    0x304,
)
EOC, STRT, OVR = 1 << 1, 1 << 4, 1 << 5
ADON, CONT, DMA, DDS, EOCS, SWSTART = 1 << 0, 1 << 1, 1 << 8, 1 << 9, 1 << 10, 1 << 30
SCAN, EOCIE, OVRIE = 1 << 8, 1 << 5, 1 << 26
TRIGGER_TIM2 = 0b1011  # EXTSEL, table 99
SAMPLING_CYCLES = (3, 15, 28, 56, 84, 112, 144, 480)
CONVERSION_CYCLES = 12
MAX_HZ = 36_000_000
IRQ = 18
SECOND = 0x100  # where ADC2 begins

Codes = npt.NDArray[np.uint16]
RESET_VALUES = {
    **{
        SR: 0,
        CR1: 0,
        CR2: 0,
        SMPR1: 0,
        SMPR2: 0,
        0x14: 0,
        0x18: 0,
        0x1C: 0,
        0x20: 0,
        0x24: 0xFFF,
        0x28: 0,
    },
    **{
        SQR1: 0,
        0x30: 0,
        SQR3: 0,
        0x38: 0,
        0x3C: 0,
        0x40: 0,
        0x44: 0,
        0x48: 0,
        DR: 0,
        0x300: 0,
        CCR: 0,
    },
}


class Adc(Registers):
    """ADC1 and the common registers, 0x40012000. ``sample(times, channel)`` gives the codes at
    those ticks."""

    name, base = "ADC1", 0x40012000
    gate = ("APB2ENR", 8)

    def __init__(
        self,
        clock: BoardClock,
        schedule: Schedule,
        nvic: Nvic,
        rcc: Rcc,
        dma: Dma,
        timer: Timer,
        record: Record,
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self.second = SingleConverter(clock, rcc, record)
        self._clock, self._schedule, self._nvic, self._rcc, self._dma, self._timer = (
            clock,
            schedule,
            nvic,
            rcc,
            dma,
            timer,
        )
        self._event = Event(self._due)
        self.sample: Callable[[IntArray, int], Codes] = lambda times, channel: np.zeros(
            len(times), dtype=np.uint16
        )
        timer.before_change, timer.after_change = self._take_triggers, self._plan
        self.conversions = self.ignored_triggers = 0
        self._waiting = np.zeros(0, dtype=np.int64)  # triggers whose conversions have not ended
        self._seen = self._clock.now
        self._last = -NEVER

    def reset(self) -> None:
        """As after a reset."""
        self.values = dict(self.reset_values)
        self._waiting = np.zeros(0, dtype=np.int64)
        self._seen, self._last = self._clock.now, -NEVER
        self._schedule.set(self._event, None)
        self._nvic.set_line(IRQ, False)

    # ---- time ----

    @property
    def clock_ticks(self) -> int:
        """A cycle of its clock."""
        return period_ticks(self._rcc.apb_hz(2)) * (2 + 2 * (self.values[CCR] >> 16 & 3))

    @property
    def channel(self) -> int:
        """The channel of the one conversion."""
        return self.values[SQR3] & 0x1F

    def _sampling_ticks(self) -> int:
        channel = self.channel
        word, at = (
            (self.values[SMPR2], 3 * channel)
            if channel < 10
            else (self.values[SMPR1], 3 * (channel - 10))
        )
        return SAMPLING_CYCLES[word >> at & 7] * self.clock_ticks

    def _conversion_ticks(self) -> int:
        return self._sampling_ticks() + CONVERSION_CYCLES * self.clock_ticks

    @property
    def _triggered(self) -> bool:
        control = self.values[CR2]
        return (
            bool(control & ADON and control >> 28 & 3)
            and self._rcc.clocked(self.gate)
            and self._timer.drives_converter
        )

    def _take_triggers(self, at: int) -> None:
        """Note the triggers until ``at``: the timer's course is about to change, or results are
        asked for."""
        if self._triggered and at > self._seen:
            times = self._timer.update_times(self._seen, at)
            if len(times):
                self._waiting = self._heard(times)
        self._seen = max(self._seen, at)

    def _heard(self, times: IntArray) -> IntArray:
        """Return the waiting triggers and those of ``times`` that do not fall into a conversion."""
        length = self._conversion_ticks()
        if times[0] >= self._last + length and (len(times) < 2 or times[1] - times[0] >= length):
            self._last = int(times[-1])
            return np.concatenate([self._waiting, times]) if len(self._waiting) else times
        heard = []
        for time in times.tolist():
            if time >= self._last + length:
                heard.append(time)
                self._last = time
            else:
                self.ignored_triggers += 1
        return np.concatenate([self._waiting, np.array(heard, dtype=np.int64)])

    # ---- results ----

    def bring_up_to_date(self, at: int | None = None) -> None:
        """Do the conversions that have ended by now (or ``at``)."""
        now = self._clock.now if at is None else at
        self._take_triggers(now)
        if not len(self._waiting):
            return
        ended = int(np.searchsorted(self._waiting, now - self._conversion_ticks(), side="right"))
        if ended:
            times, self._waiting = self._waiting[:ended], self._waiting[ended:]
            codes = self.sample(times + self._sampling_ticks(), self.channel)
            self.conversions += ended
            self._give(codes)

    def _give(self, codes: Codes) -> None:
        control, taken = self.values[CR2], 0
        if control & DMA and not self.values[SR] & OVR:
            stream = self._dma.serving("ADC1", TO_MEMORY)
            taken = 0 if stream is None else stream.put(codes.astype("<u2").tobytes())
            if taken:
                self.values[DR] = int(codes[taken - 1])
                self.values[SR] &= ~EOC  # DMA has read it
        left = len(codes) - taken
        self.values[SR] |= STRT
        if left:
            watched = control & EOCS or (
                control & DMA and control & DDS
            )  # 15.8.1: without DDS requests just end
            if watched and left + bool(self.values[SR] & EOC) > 1:
                self.values[SR] |= OVR
            if not self.values[SR] & OVR:
                self.values[DR] = int(codes[-1])
            self.values[SR] |= EOC
        self._line()

    def _line(self) -> None:
        status, enabled = self.values[SR], self.values[CR1]
        self._nvic.set_line(
            IRQ, bool((status & OVR and enabled & OVRIE) or (status & EOC and enabled & EOCIE))
        )

    def _due(self, at: int) -> None:
        self.bring_up_to_date(at)
        self._plan()

    def _plan(self) -> None:
        """When the program must be interrupted at the latest."""
        self._schedule.set(self._event, self._next_interrupt())

    def _next_interrupt(self) -> int | None:
        number: int | None = None
        control = self.values[CR2]
        if control & DMA and not self.values[SR] & OVR:
            stream = self._dma.serving("ADC1", TO_MEMORY)
            if stream is not None:
                number = stream.until_interrupt()
            elif self.values[CR1] & OVRIE and control & DDS:
                number = 1 if self.values[SR] & EOC else 2
        elif self.values[CR1] & EOCIE:
            number = 1
        if number is None:
            return None
        if number <= len(self._waiting):
            return int(self._waiting[number - 1]) + self._conversion_ticks()
        if not self._triggered:
            return None
        at = self._timer.update_after(self._seen, number - len(self._waiting))
        return None if at == NEVER else at + self._conversion_ticks()

    def plan(self) -> None:
        """A stream has changed."""
        self._plan()

    # ---- registers ----

    def read(self, offset: int, size: int) -> int:
        if SECOND <= offset < 2 * SECOND:
            return self.second.read(offset - SECOND, size)
        self.bring_up_to_date()
        if offset == DR:
            self.values[SR] &= ~EOC
            self._line()
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if SECOND <= offset < 2 * SECOND:
            self.second.write(offset - SECOND, size, value)
            return
        self.bring_up_to_date()
        if offset == SR:
            self.values[SR] &= value
        else:
            super().write(offset, size, value)
            if offset == CR2:
                self._control(value)
            elif offset == CR1 and value & ~(OVRIE | EOCIE):
                self.unmodelled("CR1: scan, resolution, injected or watchdog")
            elif offset == SQR1 and value >> 20 & 0xF:
                self.unmodelled("a sequence of several channels")
            elif offset == CCR and self._rcc.apb_hz(2) // (2 + 2 * (value >> 16 & 3)) > MAX_HZ:
                self.hazard("its clock is above 36 MHz")
        self._line()
        self._plan()

    def _control(self, value: int) -> None:
        if value & (CONT | SWSTART) or value >> 11 & 1:
            self.unmodelled("CR2: continuous, started by software, or left-aligned")
        if value >> 28 & 3 and (value >> 28 & 3 != 1 or value >> 24 & 0xF != TRIGGER_TIM2):
            self.unmodelled("CR2: a trigger other than the rising edge of TIM2's TRGO")
            self.values[CR2] &= ~(3 << 28)
        if not self._triggered:
            self._waiting = self._waiting[:0]
