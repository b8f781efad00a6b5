"""The cycle counter (DWT_CYCCNT, ARMv7-M manual C1.8); on a Cortex-M7 its registers open by
DWT_LAR, and TRCENA turns it on.

It counts the processor's cycles as the board's clock does, sleep included.
"""

from eitskin_emulator.clocktime import BoardClock
from eitskin_emulator.record import Record

KEY = 0xC5ACCE55


class Dwt:
    """0xE0001000."""

    name, base = "DWT", 0xE0001000
    gate: tuple[str, int] | None = None
    whole_words = True

    def __init__(self, clock: BoardClock, record: Record) -> None:
        self._clock, self._record = clock, record
        self.trace = False
        self.reset()

    def reset(self) -> None:
        """As after a reset."""
        self._open = self._on = self.trace = False
        self._held = self._began = 0

    def read(self, offset: int, size: int) -> int:
        if offset == 0x0:
            return 0x40000000 | int(self._on)
        if offset == 0x4:
            return self._count()
        if offset == 0xFB4:
            return 1 if self._open else 3
        self._record.unmodelled[f"read DWT+0x{offset:X}"] += 1
        return 0

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == 0xFB0:
            self._open = value == KEY
        elif not (self._open and self.trace):
            self._record.hazards["DWT written while it is locked or off"] += 1
        elif offset == 0x0:
            self._held, self._began, self._on = self._count(), self._clock.now, bool(value & 1)
        elif offset == 0x4:
            self._held, self._began = value, self._clock.now
        else:
            self._record.unmodelled[f"write DWT+0x{offset:X}"] += 1

    def _count(self) -> int:
        passed = (self._clock.now - self._began) // self._clock.cycle_ticks if self._on else 0
        return (self._held + passed) & 0xFFFFFFFF
