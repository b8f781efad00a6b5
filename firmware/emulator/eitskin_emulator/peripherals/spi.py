"""SPI3 as a master that only sends (RM0410 chapter 35): frames leave one after the other at the
rate that BR sets.

The FIFO holds 32 bits. Modelled: CPOL, CPHA, BR, DS, LSBFIRST, SPE, TXE, FTLVL, BSY; reception
reads 0, and interrupts, DMA and CRC are not modelled. NSS is the program's own pin.
"""

from collections.abc import Callable
from dataclasses import dataclass

from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.rcc import Rcc
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import Event, Schedule

CR1, CR2, SR, DR = 0x00, 0x04, 0x08, 0x0C
SPE, MSTR, LSB_FIRST = 1 << 6, 1 << 2, 1 << 7
FIFO_BITS = 32
RESET_VALUES = {CR1: 0, CR2: 0x0700, SR: 0, DR: 0, 0x10: 7, 0x14: 0, 0x18: 0, 0x1C: 0, 0x20: 2}


@dataclass(frozen=True)
class SpiFrame:
    """Bits that went out, the first sent in the highest place, from ``start`` to ``end``
    (ticks)."""

    value: int
    bits: int
    cpol: int
    cpha: int
    start: int
    end: int


class Spi(Registers):
    """``sent`` gets every frame after its last bit; ``connected`` returns whether clock and data
    reach their pins."""

    whole_words = False

    def __init__(
        self,
        name: str,
        base: int,
        gate: tuple[str, int],
        clock: BoardClock,
        schedule: Schedule,
        rcc: Rcc,
        record: Record,
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self.name, self.base, self.gate = name, base, gate
        self._clock, self._schedule, self._rcc = clock, schedule, rcc
        self._event = Event(self._frame_out)
        self.sent: Callable[[SpiFrame], None] = lambda frame: None
        self.connected: Callable[[], bool] = lambda: True
        self.frames = 0
        self._queue: list[SpiFrame] = []

    def reset(self) -> None:
        """As after a reset."""
        self.values = dict(self.reset_values)
        self._queue.clear()
        self._schedule.set(self._event, None)

    @property
    def bits(self) -> int:
        """The bits of a frame."""
        size = self.values[CR2] >> 8 & 0xF
        return 8 if size < 3 else size + 1

    def read(self, offset: int, size: int) -> int:
        if offset == SR:
            now = self._clock.now
            waiting = sum(frame.bits for frame in self._queue if frame.start > now)
            level = min(-(-waiting // 8), 3) if waiting < FIFO_BITS else 3
            busy = any(frame.end > now for frame in self._queue)
            return (
                (1 << 1 if waiting <= FIFO_BITS // 2 else 0) | level << 11 | (1 << 7 if busy else 0)
            )
        return 0 if offset == DR else super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == DR:
            self._send(value, size)
            return
        if offset == CR1 and self._queue and (value ^ self.values[CR1]) & 0xFF:
            self.hazard("CR1 written while a frame is on its way")
        super().write(offset, size, value)

    def _send(self, value: int, size: int) -> None:
        control, now, bits = self.values[CR1], self._clock.now, self.bits
        if not (control & SPE and control & MSTR):
            self.hazard("DR written while it is off or no master")
            return
        if bits > 8 * size:
            self.hazard("DR written narrower than a frame")
        if sum(frame.bits for frame in self._queue if frame.start > now) + bits > FIFO_BITS:
            self.hazard("DR written while the FIFO is full")
            return
        bit = period_ticks(self._rcc.apb_hz(1)) * (2 << (control >> 3 & 7))
        for _ in range(2 if bits <= 8 and size == 2 else 1):  # data packing (RM0410 35.5.9)
            word = value & (1 << bits) - 1
            value >>= bits
            if control & LSB_FIRST:
                word = int(f"{word:0{bits}b}"[::-1], 2)
            start = max(now, self._queue[-1].end if self._queue else now)
            self._queue.append(
                SpiFrame(word, bits, control >> 1 & 1, control & 1, start, start + bits * bit)
            )
        self._schedule.set(self._event, self._queue[0].end)

    def _frame_out(self, at: int) -> None:
        frame = self._queue.pop(0)
        self.frames += 1
        if self.connected():
            self.sent(frame)
        self._schedule.set(self._event, self._queue[0].end if self._queue else None)
