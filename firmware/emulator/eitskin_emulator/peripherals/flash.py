"""The flash interface (RM0410 chapter 3): keys, erase by sectors, programming in the width that
PSIZE says.

One bank: while it erases or programs, the processor that runs from it stands still, and DMA and the
rest go on. Times are the data sheet's typical ones at 32-bit parallelism (STM32F767xx data sheet,
table "Flash memory programming"). Cells go from 1 to 0 only. While PG is set, the piece of flash
that holds a bank is registers to the processor; the program's own 256 KB cannot be programmed here
(recorded). Option bytes take keys, a word in OPTCR and its start bit, and stay as they are over
resets; OPTCR1 is read only. A loss of power never falls into an erase: that is one step.
"""

from collections.abc import Callable

from eitskin_emulator.clocktime import TICKS_PER_US
from eitskin_emulator.memory import FLASH, PIECES, Memories
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record

ACR, KEYR, OPTKEYR, SR, CR, OPTCR, OPTCR1 = (4 * k for k in range(7))
KEYS = (0x45670123, 0xCDEF89AB)
OPTION_KEYS = (0x08192A3B, 0x4C5D6E7F)
OPTLOCK, OPTSTRT = 1 << 0, 1 << 1
PG, SER, MER, STRT, LOCK = 1 << 0, 1 << 1, 1 << 2, 1 << 16, 1 << 31
EOP, PGPERR, ERSERR = 1 << 0, 1 << 6, 1 << 7
WORD_TICKS = 16 * TICKS_PER_US
SMALL, MIDDLE, LARGE = (size * 1024 for size in (32, 128, 256))
SECTORS = (
    *((SMALL * k, SMALL) for k in range(4)),
    (MIDDLE, MIDDLE),
    *((LARGE * k, LARGE) for k in range(1, 8)),
)
ERASE_TICKS = {
    32: 250_000 * TICKS_PER_US,
    128: 500_000 * TICKS_PER_US,
    256: 1_000_000 * TICKS_PER_US,
}
RESET_VALUES = {ACR: 0, KEYR: 0, OPTKEYR: 0, SR: 0, CR: LOCK, OPTCR: 0xFFFFAAFD, OPTCR1: 0x00400080}


class FlashInterface(Registers):
    """0x40023C00. ``stall`` stops the processor for a number of ticks; ``after_slice`` ends the
    slice, then calls its argument.

    ``word_programmed`` is called after each word.
    """

    name, base = "FLASH", 0x40023C00

    def __init__(
        self,
        memories: Memories,
        record: Record,
        stall: Callable[[int], None],
        after_slice: Callable[[Callable[[], None]], None],
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self._memories, self._stall, self._after_slice = memories, stall, after_slice
        self._keys: list[int] = []
        self._option_keys: list[int] = []
        self._options, self.options_programmed = RESET_VALUES[OPTCR], 0
        self._open_pieces = False
        self._barred = False
        self.words_programmed = self.sectors_erased = self.not_erased = 0
        self.word_programmed: Callable[[], None] = lambda: None

    def reset(self) -> None:
        """As after a reset."""
        self.values = {**self.reset_values, OPTCR: self._options}
        self._keys, self._option_keys, self._barred = [], [], False
        self._follow()

    def wait_states(self) -> int:
        """ACR.LATENCY."""
        return self.values[ACR] & 0xF

    def read(self, offset: int, size: int) -> int:
        return 0 if offset in (KEYR, OPTKEYR) else super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == KEYR:
            self._key(value)
        elif offset == SR:
            self.values[SR] &= ~value
        elif offset == CR:
            self._control(value)
        elif offset == OPTKEYR:
            self._option_keys.append(value)
            if tuple(self._option_keys) == OPTION_KEYS:
                self.values[OPTCR] &= ~OPTLOCK
            elif tuple(self._option_keys) != OPTION_KEYS[:1]:
                self.hazard("wrong key of the option bytes")
        elif offset == OPTCR:
            self._option_control(value)
        elif offset == OPTCR1:
            self.unmodelled("option bytes written")
        else:
            super().write(offset, size, value)

    def _key(self, value: int) -> None:
        self._keys.append(value)
        if self._barred or value != KEYS[len(self._keys) - 1]:
            self._barred = True  # until the next reset (3.3.5)
            self.hazard("wrong key")
        elif len(self._keys) == 2:
            self._keys = []
            self.values[CR] &= ~LOCK

    def _option_control(self, value: int) -> None:
        if self.values[OPTCR] & OPTLOCK:
            self.hazard("OPTCR written while it is locked")
            return
        self.values[OPTCR] = value & ~OPTSTRT
        if value & OPTSTRT:
            self._options = value & ~OPTSTRT | OPTLOCK
            self.options_programmed += 1
            self._stall(ERASE_TICKS[32])
        if value & OPTLOCK:
            self._option_keys = []

    def _control(self, value: int) -> None:
        if self.values[CR] & LOCK:
            self.hazard("CR written while it is locked")
            return
        self.values[CR] = value & ~STRT
        if value & STRT:
            self._erase(value)
        if bool(value & PG and not value & LOCK) != self._open_pieces:
            self._after_slice(self._follow)

    def _erase(self, value: int) -> None:
        number = value >> 3 & 0x1F
        if value & MER or not value & SER or number >= len(SECTORS):
            self.values[SR] |= ERSERR
            self.unmodelled("mass erase, or no such sector")
            return
        at, size = SECTORS[number]
        if at < PIECES[1][0] - FLASH:
            self.unmodelled("a sector of the program erased")
            return
        self._memories.flash[at : at + size] = b"\xff" * size
        self.sectors_erased += 1
        self.values[SR] |= EOP if value >> 24 & 1 else 0
        self._stall(ERASE_TICKS[size // 1024])

    def _follow(self) -> None:
        wanted = bool(self.values[CR] & PG and not self.values[CR] & LOCK)
        if wanted == self._open_pieces:
            return
        self._open_pieces = wanted
        for at, size in PIECES[1:]:
            if wanted:
                self._memories.open_piece(at, *self._accesses(at - FLASH, size))
            else:
                self._memories.close_piece(at)

    def _accesses(self, start: int, size: int) -> tuple[Callable[..., int], Callable[..., None]]:
        flash = self._memories.flash

        def load(engine: object, offset: int, width: int, data: object) -> int:
            return int.from_bytes(flash[start + offset : start + offset + width], "little")

        def store(engine: object, offset: int, width: int, value: int, data: object) -> None:
            if width != 1 << (self.values[CR] >> 8 & 3):
                self.values[SR] |= PGPERR
                return
            at = start + offset
            old = int.from_bytes(flash[at : at + width], "little")
            if value & ~old:
                self.not_erased += 1
                self.hazard("programmed where it is not erased")
            flash[at : at + width] = (old & value).to_bytes(width, "little")
            self.words_programmed += 1
            self._stall(WORD_TICKS)
            self.word_programmed()

        return load, store
