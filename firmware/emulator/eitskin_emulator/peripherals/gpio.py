"""Pins (RM0410 chapter 6). A pin drives its level only as an output; alternate functions and analog
only in their modes.

Levels change at once. Not modelled: open drain (recorded), speeds, and the analog behaviour of a
pin in a wrong mode.
"""

from collections.abc import Callable

from eitskin_emulator.clocktime import BoardClock
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record

MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, LCKR, AFRL, AFRH = (4 * k for k in range(10))
INPUT, OUTPUT, ALTERNATE, ANALOG = range(4)
RESET = {"A": (0xA8000000, 0x0C000000, 0x64000000), "B": (0x00000280, 0x000000C0, 0x00000100)}


class GpioPort(Registers):
    """Port ``letter``. ``watch`` is called with the time, which pins drive, and their levels, when
    either changes."""

    def __init__(self, letter: str, clock: BoardClock, record: Record) -> None:
        number = ord(letter) - ord("A")
        self.name, self.base, self.gate = (
            f"GPIO{letter}",
            0x40020000 + 0x400 * number,
            ("AHB1ENR", number),
        )
        mode, speed, pull = RESET.get(letter, (0, 0, 0))
        values = {
            MODER: mode,
            OTYPER: 0,
            OSPEEDR: speed,
            PUPDR: pull,
            IDR: 0,
            ODR: 0,
            LCKR: 0,
            AFRL: 0,
            AFRH: 0,
        }
        super().__init__(record, values)
        self._clock = clock
        self.watch: Callable[[int, int, int], None] = lambda at, driven, levels: None
        self.mode_changed: Callable[[], None] = lambda: None
        self.driven = self.levels = 0
        self._mode, self._outputs = -1, 0
        self.outside = 0  # pins that something outside lifts
        self.lowered = 0  # pins that something outside pulls low, against a pull-up

    def reset(self) -> None:
        """As after a reset: all pins float."""
        self.values = dict(self.reset_values)
        self._follow()

    def mode(self, pin: int) -> int:
        """INPUT, OUTPUT, ALTERNATE or ANALOG."""
        return self.values[MODER] >> 2 * pin & 3

    def has_function(self, pin: int, function: int) -> bool:
        """Return whether ``pin`` is in alternate function ``function``."""
        word = self.values[AFRL] if pin < 8 else self.values[AFRH]
        return self.mode(pin) == ALTERNATE and word >> 4 * (pin & 7) & 0xF == function

    def read(self, offset: int, size: int) -> int:
        if offset == IDR:
            pulled = sum(1 << pin for pin in range(16) if self.values[PUPDR] >> 2 * pin & 3 == 1)
            open_levels = (pulled | self.outside) & ~self.lowered
            return self.levels & self.driven | open_levels & ~self.driven
        return 0 if offset == BSRR else super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == BSRR:
            self.values[ODR] = self.values[ODR] & ~(value >> 16) | value & 0xFFFF
        elif offset == ODR:
            self.values[ODR] = value & 0xFFFF
        elif offset == IDR:
            return
        else:
            if offset == OTYPER and value:
                self.unmodelled("open drain")
            super().write(offset, size, value)
            if offset in (MODER, AFRL, AFRH):
                self.mode_changed()
        self._follow()

    def _follow(self) -> None:
        mode = self.values[MODER]
        if mode != self._mode:
            self._mode, self._outputs = (
                mode,
                sum(1 << pin for pin in range(16) if mode >> 2 * pin & 3 == OUTPUT),
            )
        driven, levels = self._outputs, self.values[ODR] & self._outputs
        if (driven, levels) != (self.driven, self.levels):
            self.driven, self.levels = driven, levels
            self.watch(self._clock.now, driven, levels)
