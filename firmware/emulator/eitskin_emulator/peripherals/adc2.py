"""ADC2, one conversion at a time, started by the program and waited for (RM0410 chapter 15); its
registers lie behind ADC1's."""

from collections.abc import Callable

from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.rcc import Rcc
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record

SR, CR1, CR2, SMPR1, SMPR2, SQR1, SQR3, DR = 0x00, 0x04, 0x08, 0x0C, 0x10, 0x2C, 0x34, 0x4C
EOC, ADON, SWSTART = 1 << 1, 1 << 0, 1 << 30
CYCLES = 3 + 12  # sampling, as SMPR is after a reset, and conversion


class SingleConverter(Registers):
    """``sample`` gives the code at a time (ticks) on a channel."""

    name, gate = "ADC2", ("APB2ENR", 9)

    def __init__(self, clock: BoardClock, rcc: Rcc, record: Record) -> None:
        super().__init__(record, dict.fromkeys((SR, CR1, CR2, SMPR1, SMPR2, SQR1, SQR3, DR), 0))
        self._clock, self._rcc = clock, rcc
        self._ends: int | None = None
        self.divisor = 2
        self.sample: Callable[[int, int], int] = lambda at, channel: 0

    def reset(self) -> None:
        """As after a reset."""
        self.values, self._ends = dict(self.reset_values), None

    def read(self, offset: int, size: int) -> int:
        if offset == SR and self._ends is not None and self._clock.now >= self._ends:
            self.values[SR] |= EOC
        if offset == DR:
            self.values[SR] &= ~EOC
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if not self._rcc.clocked(self.gate):
            self.hazard("written without its clock")
        if offset != CR2:
            if offset in (SMPR1, SMPR2, SQR1, CR1) and value:
                self.unmodelled("more than one quick conversion")
            super().write(offset, size, value)
            return
        self.values[CR2] = value & ~SWSTART
        if value & SWSTART and value & ADON:
            ticks = period_ticks(self._rcc.apb_hz(2) // self.divisor)
            self.values[DR] = self.sample(self._clock.now + 3 * ticks, self.values[SQR3] & 0x1F)
            self.values[SR] &= ~EOC
            self._ends = self._clock.now + CYCLES * ticks
