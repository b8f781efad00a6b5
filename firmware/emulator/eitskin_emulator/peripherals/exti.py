"""External interrupts (RM0410 chapter 11): line 16 alone, the supply's detector, on its rise."""

from eitskin_emulator.peripherals.nvic import Nvic
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record

IMR, RTSR, PR, PVD, PVD_IRQ = 0x00, 0x08, 0x14, 1 << 16, 1


class Exti(Registers):
    """0x40013C00."""

    name, base = "EXTI", 0x40013C00

    def __init__(self, nvic: Nvic, record: Record) -> None:
        super().__init__(record, {IMR: 0, 0x04: 0, RTSR: 0, 0x0C: 0, 0x10: 0, PR: 0})
        self._nvic = nvic

    def reset(self) -> None:
        """As after a reset."""
        self.values = dict(self.reset_values)

    def supply_fell(self) -> None:
        """The detector's output rises."""
        if self.values[RTSR] & PVD:
            self.values[PR] |= PVD
        self._follow()

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == PR:
            self.values[PR] &= ~value
        else:
            super().write(offset, size, value)
        self._follow()

    def _follow(self) -> None:
        self._nvic.set_line(PVD_IRQ, bool(self.values[PR] & self.values[IMR] & PVD))
