"""USART3, 8 bits without parity (RM0410 chapter 34), and the serial line to the host, which always
speaks 1 Mbaud.

Bytes take ten bit times. At another rate than the line's (beyond 3 %) both sides sample the other's
bits at their own times, which gives garbage and framing errors, as it does on a wire. Transmission
and reception go by DMA or by single bytes. A byte lies in the transmit register from DMA's transfer
until the shifter takes it. Not modelled: oversampling by 8, parity, 7 or 9 bits, hardware flow
control, noise detection.
"""

from collections.abc import Callable

from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.dma import FROM_MEMORY, TO_MEMORY, Dma, DmaStream
from eitskin_emulator.peripherals.nvic import Nvic
from eitskin_emulator.peripherals.rcc import Rcc
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import NEVER, Event, Schedule
from eitskin_emulator.serial_line import SerialLine, resampled

CR1, CR2, CR3, BRR, GTPR, RTOR, RQR, ISR, ICR, RDR, TDR = (4 * k for k in range(11))
UE, RE, TE, IDLEIE, RXNEIE, TCIE, TXEIE = 1 << 0, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7
EIE, DMAR, DMAT = 1 << 0, 1 << 6, 1 << 7
FE, ORE, IDLE, RXNE, TC, TXE = 1 << 1, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7
CLEARABLE = FE | ORE | IDLE | TC | 1 << 0 | 1 << 2
FRAME_BITS = 10
MAX_BEHIND = 50  # bytes that may have left before they are put on the line
IRQ = 39
RESET_VALUES = {
    CR1: 0,
    CR2: 0,
    CR3: 0,
    BRR: 0,
    GTPR: 0,
    RTOR: 0,
    RQR: 0,
    ISR: TC | TXE,
    ICR: 0,
    RDR: 0,
    TDR: 0,
}


class Usart(Registers):
    """USART3 on DMA1; ``tx_connected`` and ``rx_connected`` return whether its pins have that
    function."""

    name, base = "USART3", 0x40004800
    gate = ("APB1ENR", 18)

    def __init__(
        self,
        clock: BoardClock,
        schedule: Schedule,
        nvic: Nvic,
        rcc: Rcc,
        dma: Dma,
        line: SerialLine,
        record: Record,
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self._clock, self._schedule, self._nvic, self._rcc, self._dma, self.line = (
            clock,
            schedule,
            nvic,
            rcc,
            dma,
            line,
        )
        self._event = Event(self._due)
        self.tx_connected: Callable[[], bool] = lambda: True
        self.rx_connected: Callable[[], bool] = lambda: True
        self.bytes_lost = 0
        self._set_up()

    def reset(self) -> None:
        """As after a reset."""
        self._schedule.set(self._event, None)
        self._nvic.set_line(IRQ, False)
        self._set_up()

    def _set_up(self) -> None:
        self.values = dict(self.reset_values)
        self._flags = TC
        self._shift_free_at = 0  # when all that was given has left
        self._served_from = 0  # since when a stream is there to send
        self._stream: DmaStream | None = None
        self._idle_at = NEVER

    # ---- sending: a byte lies in the transmit register until the shifter is free, which takes it
    # for ten bit times ----

    @property
    def frame_ticks(self) -> int:
        """A byte with start and stop bit."""
        return FRAME_BITS * max(self.values[BRR], 1) * period_ticks(self._rcc.apb_hz(1))

    @property
    def _sends(self) -> bool:
        return self.values[CR1] & (UE | TE) == UE | TE and self.values[BRR] > 0

    def _room_at(self) -> int:
        """When the transmit register is free: the shifter begins with the byte before."""
        return self._shift_free_at - self.frame_ticks

    def _send(self, data: bytes, start: int) -> None:
        self._shift_free_at = start + len(data) * self.frame_ticks
        if not self.tx_connected():
            return
        if not self.line.agrees(self.frame_ticks):
            data = resampled(data, self.frame_ticks, self.line.frame_ticks)
        self.line.from_board(data, start, self.frame_ticks)

    def _sending_stream(self) -> DmaStream | None:
        """The stream that sends, if one does."""
        if not (self._sends and self.values[CR3] & DMAT):
            return None
        return self._dma.serving("USART3_TX", FROM_MEMORY)

    def _pump_out(self, now: int) -> None:
        stream = self._sending_stream()
        if stream is None:
            return
        first, start = self._next_transfer()
        if now >= first:
            n = 1 if now < start else 2 + (now - start) // self.frame_ticks
            self._send(stream.get(n), start)

    def _next_transfer(self) -> tuple[int, int]:
        """When DMA moves the next byte, and when that begins to leave; the one after it moves
        then."""
        first = max(self._served_from, self._room_at())
        return first, max(first, self._shift_free_at)

    # ---- receiving ----

    def _pump_in(self, now: int) -> None:
        data, last_end = self.line.to_board(now)
        if not data:
            return
        listening = (
            self.values[CR1] & (UE | RE) == UE | RE and self.values[BRR] > 0 and self.rx_connected()
        )
        if not listening or not self._rcc.clocked(self.gate):
            self.bytes_lost += len(data)
            return
        if not self.line.agrees(self.frame_ticks):
            data = resampled(data, self.line.frame_ticks, self.frame_ticks)
            self._flags |= FE
            if self.values[CR3] & DMAR:
                data = data[::2]  # frames without a stop bit are not requested (34.5.15)
        self._idle_at = last_end + self.frame_ticks
        self._take(data)

    def _take(self, data: bytes) -> None:
        stream = self._dma.serving("USART3_RX", TO_MEMORY) if self.values[CR3] & DMAR else None
        if self._flags & ORE and self.values[CR3] & DMAR:
            self.bytes_lost += len(data)
            return
        taken = stream.put(data) if stream is not None else 0
        for byte in data[taken:]:
            if self._flags & RXNE:
                self._flags |= ORE
                self.bytes_lost += 1
            else:
                self._flags |= RXNE
                self.values[RDR] = byte

    # ---- time ----

    def bring_up_to_date(self, at: int | None = None) -> None:
        """Move the bytes that have moved by now (or ``at``)."""
        now = self._clock.now if at is None else at
        self._pump_out(now)
        self._pump_in(now)
        if now >= self._idle_at:
            self._flags |= IDLE
            self._idle_at = NEVER
        self._line()

    def _line(self) -> None:
        control, status = self.values[CR1], self._status()
        high = (status & IDLE and control & IDLEIE) or (status & (RXNE | ORE) and control & RXNEIE)
        high = high or (status & TC and control & TCIE) or (status & TXE and control & TXEIE)
        high = high or (status & (FE | ORE) and self.values[CR3] & EIE and self.values[CR3] & DMAR)
        self._nvic.set_line(IRQ, bool(high) and bool(control & UE))

    def _status(self) -> int:
        now = self._clock.now
        status = self._flags & ~TC
        if now >= self._room_at():
            status |= TXE
        if now >= self._shift_free_at and self._flags & TC:
            status |= TC
        enabled = self.values[CR1]
        return status | (1 << 21 if enabled & TE else 0) | (1 << 22 if enabled & RE else 0)

    def plan(self) -> None:
        """Work out when something happens next that the program hears of."""
        soonest = NEVER
        control = self.values[CR1]
        if self._sends:
            stream = self._sending_stream()
            if stream is not None and self._stream is None:
                self._served_from = self._clock.now
            self._stream = stream
            if stream is not None:
                number = stream.until_interrupt() or stream.left
                first, start = self._next_transfer()
                soonest = (
                    first
                    if number == 1
                    else start + (min(number - 2, MAX_BEHIND)) * self.frame_ticks
                )
            for enabled, at in ((TXEIE, self._room_at()), (TCIE, self._shift_free_at)):
                if control & enabled and at > self._clock.now:
                    soonest = min(soonest, at)
        if control & RE:
            soonest = min(soonest, self._next_arrival(), self._idle_at)
        self._schedule.set(self._event, None if soonest == NEVER else max(soonest, self._clock.now))

    def _next_arrival(self) -> int:
        stream = self._dma.serving("USART3_RX", TO_MEMORY) if self.values[CR3] & DMAR else None
        if stream is None:
            return self.line.arrives(1)
        until = stream.until_interrupt()
        return min(
            self.line.arrives(until) if until is not None else NEVER, self.line.last_arrives()
        )

    def _due(self, at: int) -> None:
        self.bring_up_to_date(at)
        self.plan()

    # ---- registers ----

    def read(self, offset: int, size: int) -> int:
        self.bring_up_to_date()
        if offset == ISR:
            return self._status()
        if offset == RDR:
            self._flags &= ~RXNE
            self._line()
        return 0 if offset in (ICR, RQR) else super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        self.bring_up_to_date()
        if offset == ICR:
            self._flags &= ~(value & CLEARABLE & ~TC)
        elif offset == TDR:
            if self._sends:
                if self._clock.now < self._room_at():
                    self.hazard("TDR written while it is full")
                self._send(bytes([value & 0xFF]), max(self._clock.now, self._shift_free_at))
        elif offset in (CR1, CR2, CR3) and value & UNMODELLED[offset]:
            self.unmodelled(f"bits 0x{value & UNMODELLED[offset]:08X} of CR{offset // 4 + 1}")
            super().write(offset, size, value)
        else:
            super().write(offset, size, value)
        self._line()
        self.plan()


UNMODELLED = {
    CR1: 0xFFFFFFFF & ~(UE | RE | TE | IDLEIE | RXNEIE | TCIE | TXEIE),
    CR2: 0xFFFFFFFF,
    CR3: 0xFFFFFFFF & ~(EIE | DMAR | DMAT),
}
