"""DMA1 and DMA2 (RM0410 chapter 8), one stream at a time: items go where the stream says when its
peripheral asks.

Modelled: direction, sizes that are equal, memory increment, circular mode, double buffer, half and
    full flags with their
interrupts as levels until they are cleared, errors for memory that does not exist. A stream whose
flags stand is not enabled (8.3.18 asks to clear them first). Transfers take no time and no bus;
FIFO, bursts and memory to memory are not modelled.
"""

from collections.abc import Callable

from eitskin_emulator.memory import Memories
from eitskin_emulator.peripherals.nvic import Nvic
from eitskin_emulator.record import Record

EN, DMEIE, TEIE, HTIE, TCIE = (1 << k for k in range(5))
CIRC, MINC, DBM, CT = 1 << 8, 1 << 10, 1 << 18, 1 << 19
FEIF, DMEIF, TEIF, HTIF, TCIF = 1 << 0, 1 << 2, 1 << 3, 1 << 4, 1 << 5
FLAG_SHIFT = (0, 6, 16, 22)
TO_MEMORY, FROM_MEMORY = 0, 1
IRQS = {1: (11, 12, 13, 14, 15, 16, 17, 47), 2: (56, 57, 58, 59, 60, 68, 69, 70)}
# requests by (DMA, stream, channel), RM0410 tables 26 and 27
REQUESTS = {
    (1, 1, 4): "USART3_RX",
    (1, 3, 4): "USART3_TX",
    (1, 4, 7): "USART3_TX",
    (2, 0, 0): "ADC1",
    (2, 4, 0): "ADC1",
}


class DmaStream:
    """One stream of a DMA."""

    def __init__(self, dma: "Dma", number: int) -> None:
        self.dma, self.number = dma, number
        self.control = self.left = self.whole = self.peripheral = self.memory0 = self.memory1 = 0
        self.fifo = 0x21

    @property
    def enabled(self) -> bool:
        return bool(self.control & EN)

    @property
    def request(self) -> str | None:
        """The peripheral that requests its transfers."""
        return REQUESTS.get((self.dma.number, self.number, self.control >> 25 & 0xF))

    @property
    def item_bytes(self) -> int:
        return 1 << (self.control >> 13 & 3)

    @property
    def direction(self) -> int:
        return self.control >> 6 & 3

    def until_interrupt(self) -> int | None:
        """Items from here to the next flag that interrupts; None: none does."""
        if not self.enabled:
            return None
        if self.control & TEIE and self.dma.memories.find(self._address(), self.item_bytes) is None:
            return 1
        half = self.left - self.whole // 2
        if self.control & HTIE and half > 0:
            return half
        if self.control & TCIE:
            return self.left
        return (
            self.left + self.whole - self.whole // 2
            if self.control & HTIE and self.control & (CIRC | DBM)
            else None
        )

    def put(self, data: bytes) -> int:
        """Move items from the peripheral to memory. Returns how many were taken before the stream
        ended."""
        size, taken = self.item_bytes, 0
        items = len(data) // size
        while taken < items and self.enabled:
            n = min(items - taken, self.left)
            if not self.dma.memories.write(
                self._address(),
                data[taken * size : (taken + n) * size] if self._steps else data[-size:],
            ):
                self._fail()
                break
            taken += n
            self._moved(n)
        return taken

    def get(self, items: int) -> bytes:
        """Move up to the given number of items from memory to the peripheral."""
        out = bytearray()
        size = self.item_bytes
        while items > 0 and self.enabled:
            n = min(items, self.left)
            data = self.dma.memories.read(self._address(), n * size if self._steps else size)
            if data is None:
                self._fail()
                break
            out += data if self._steps else data * n
            items -= n
            self._moved(n)
        return bytes(out)

    @property
    def _steps(self) -> bool:
        return bool(self.control & MINC)

    def _address(self) -> int:
        base = self.memory1 if self.control & DBM and self.control & CT else self.memory0
        return base + ((self.whole - self.left) * self.item_bytes if self._steps else 0)

    def _moved(self, n: int) -> None:
        before, self.left = self.left, self.left - n
        half = self.whole - self.whole // 2
        if before > half >= self.left:
            self.dma.raise_flag(self.number, HTIF)
        if self.left == 0:
            self.dma.raise_flag(self.number, TCIF)
            if self.control & (CIRC | DBM):
                self.left = self.whole
                self.control ^= CT if self.control & DBM else 0
            else:
                self.control &= ~EN

    def _fail(self) -> None:
        self.control &= ~EN
        self.dma.raise_flag(self.number, TEIF)


class Dma:
    """Eight streams. ``users`` update their data for transfers; they are called before the program
    reads."""

    whole_words = True

    def __init__(
        self,
        number: int,
        memories: Memories,
        nvic: Nvic,
        record: Record,
        cached: Callable[[int], bool],
    ) -> None:
        self.number, self.name = number, f"DMA{number}"
        self.base, self.gate = 0x40026000 + 0x400 * (number - 1), ("AHB1ENR", 20 + number)
        self.memories, self._nvic, self._record, self._cached = memories, nvic, record, cached
        self.bring_up_to_date: Callable[[], None] = lambda: None
        self.stream_changed: Callable[[], None] = lambda: None
        self.clocked: Callable[[], bool] = lambda: True
        self.reset()

    def reset(self) -> None:
        """As after a reset."""
        self.streams = [DmaStream(self, k) for k in range(8)]
        self._flags = [0] * 8
        for irq in IRQS[self.number]:
            self._nvic.set_line(irq, False)

    def serving(self, request: str, direction: int) -> DmaStream | None:
        """The enabled stream that ``request`` is routed to."""
        if not self.clocked():
            return None
        for stream in self.streams:
            if stream.enabled and stream.request == request and stream.direction == direction:
                return stream
        return None

    def raise_flag(self, stream: int, flag: int) -> None:
        """Set a flag of ``stream``."""
        self._flags[stream] |= flag
        self._follow(stream)

    def _follow(self, stream: int) -> None:
        flags, control = self._flags[stream], self.streams[stream].control
        high = (flags & TCIF and control & TCIE) or (flags & HTIF and control & HTIE)
        high = high or (flags & TEIF and control & TEIE) or (flags & DMEIF and control & DMEIE)
        self._nvic.set_line(IRQS[self.number][stream], bool(high))

    def read(self, offset: int, size: int) -> int:
        self.bring_up_to_date()
        if offset in (0x0, 0x4):
            first = 0 if offset == 0x0 else 4
            return sum(self._flags[first + k] << FLAG_SHIFT[k] for k in range(4))
        if offset < 0x10:
            return 0
        number, register = divmod(offset - 0x10, 0x18)
        if number > 7:
            self._record.unmodelled[f"{self.name}: read +0x{offset:02X}"] += 1
            return 0
        one = self.streams[number]
        return (one.control, one.left, one.peripheral, one.memory0, one.memory1, one.fifo)[
            register // 4
        ]

    def write(self, offset: int, size: int, value: int) -> None:
        self.bring_up_to_date()
        if offset in (0x8, 0xC):
            first = 0 if offset == 0x8 else 4
            for k in range(4):
                self._flags[first + k] &= ~(value >> FLAG_SHIFT[k] & 0x3D)
                self._follow(first + k)
        elif offset >= 0x10 and (offset - 0x10) // 0x18 < 8:
            number, register = divmod(offset - 0x10, 0x18)
            self._stream_write(self.streams[number], register // 4, value)
        self.stream_changed()

    def _stream_write(self, one: DmaStream, register: int, value: int) -> None:
        if register == 0:
            self._set_control(one, value)
        elif one.enabled and not (one.control & DBM and register in (3, 4)):
            self._record.hazards[
                f"{self.name}: stream {one.number} written while it is enabled"
            ] += 1
        elif register == 1:
            one.left = one.whole = value & 0xFFFF
        elif register == 2:
            one.peripheral = value
        elif register == 3:
            one.memory0 = value
        elif register == 4:
            one.memory1 = value
        else:
            one.fifo = value
            if value & 4:
                self._record.unmodelled[f"{self.name}: FIFO mode"] += 1

    def _set_control(self, one: DmaStream, value: int) -> None:
        starts = value & EN and not one.enabled
        if one.enabled:
            free = EN | DMEIE | TEIE | HTIE | TCIE
            one.control = one.control & ~free | value & free
            if not value & EN:
                self.raise_flag(one.number, TCIF)  # a stream that is disabled sets it too (8.3.14)
        else:
            one.control = value
        self._follow(one.number)
        if starts:
            one.control &= ~EN
            self._start(one)

    def _start(self, one: DmaStream) -> None:
        if self._flags[one.number]:
            self._record.hazards[
                f"{self.name}: stream {one.number} enabled with flags standing"
            ] += 1
            return
        if one.left == 0:
            self._record.hazards[
                f"{self.name}: stream {one.number} enabled with nothing to move"
            ] += 1
            return
        if (
            one.request is None
            or one.direction > FROM_MEMORY
            or one.control >> 11 & 3 != one.control >> 13 & 3
        ):
            self._record.unmodelled[
                f"{self.name}: stream {one.number} with CR 0x{one.control:08X}"
            ] += 1
        for address in {one.memory0, one.memory1 if one.control & DBM else one.memory0}:
            if self._cached(address):
                self._record.hazards[f"{self.name}: stream {one.number} on cached memory"] += 1
        one.whole = one.left
        one.control |= EN
