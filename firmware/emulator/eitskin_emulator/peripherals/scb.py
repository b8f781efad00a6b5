"""The system control space at 0xE000E000 (ARMv7-M manual B3.2): NVIC, SysTick and MPU by their
addresses, and the control block.

Faults go to their own handlers where SHCSR enables them, else to HardFault; one in HardFault locks
the processor up. Cache maintenance does nothing, for there are no caches.
"""

from collections.abc import Callable

from eitskin_emulator.memory import FLASH_ITCM
from eitskin_emulator.peripherals.dwt import Dwt
from eitskin_emulator.peripherals.mpu import Mpu
from eitskin_emulator.peripherals.nvic import (
    BUS_FAULT,
    FIRST_IRQ,
    HARD_FAULT,
    MEMORY_FAULT,
    PENDSV,
    PRIORITY_BITS,
    SYSTICK,
    USAGE_FAULT,
    Nvic,
)
from eitskin_emulator.peripherals.systick import SysTick
from eitskin_emulator.record import Record

CPUID = 0x411FC271  # Cortex-M7 r1p1
KEY = 0x05FA
SHCSR_BIT = {MEMORY_FAULT: 16, BUS_FAULT: 17, USAGE_FAULT: 18}
FORCED = 1 << 30
CACHE_OPERATIONS = range(0xF50, 0xF7C)
# CSSELR 0 is the data cache: 16 KB each, 4 ways of 128 sets, and 2 ways of 256, lines of 32 bytes
CCSIDR = {0: 0xF00FE019, 1: 0xF01FE009}
INSTRUCTION_ERROR, BREAKPOINT_ERROR = 1 << 16, 0
MMARVALID, BFARVALID, DACCVIOL, IACCVIOL, MSTKERR, PRECISERR, IBUSERR, STKERR = (
    *(1 << 7, 1 << 15, 1 << 1, 1 << 0, 1 << 4, 1 << 9, 1 << 8, 1 << 12),
)
INVSTATE, INVPC, UNDEFINSTR = 1 << 17, 1 << 18, 1 << 16


class SystemSpace:
    """0xE000E000. ``reset_asked`` is called when the program asks for a reset."""

    name, base = "SCS", 0xE000E000
    gate: tuple[str, int] | None = None
    whole_words = False

    def __init__(
        self,
        nvic: Nvic,
        systick: SysTick,
        mpu: Mpu,
        dwt: Dwt,
        record: Record,
        reset_asked: Callable[[], None],
    ) -> None:
        self.nvic, self.systick, self.mpu, self.dwt = nvic, systick, mpu, dwt
        self._record, self._reset_asked = record, reset_asked
        self.reset()

    def reset(self) -> None:
        """As after a reset; the chip boots through the flash's ITCM address (BOOT_ADD0 as
        delivered, RM0410 2.4)."""
        self.vtor = FLASH_ITCM
        self.cfsr = self.hfsr = self.mmfar = self.bfar = self.cpacr = 0
        self._shcsr = self._ccr_bits = self._csselr = self._scr = self._demcr = 0
        self._fpccr, self._prigroup = 0xC0000000, 0

    # ---- faults ----

    def fault(self, number: int, status: int, address: int | None = None) -> int | None:
        """Note a fault of kind ``number`` with its bits of CFSR. Returns the exception that is
        taken; None: the processor locks up."""
        self.cfsr |= status
        if address is not None and number == MEMORY_FAULT:
            self.mmfar, self.cfsr = address, self.cfsr | MMARVALID
        elif address is not None and number == BUS_FAULT:
            self.bfar, self.cfsr = address, self.cfsr | BFARVALID
        urgency = self.nvic.masked_urgency()
        if self._shcsr >> SHCSR_BIT[number] & 1 and self.nvic.urgency(number) < urgency:
            return number
        if urgency <= -1:
            return None
        self.hfsr |= FORCED
        return HARD_FAULT

    @property
    def data_cache_on(self) -> bool:
        """CCR.DC."""
        return bool(self._ccr_bits >> 16 & 1)

    # ---- registers ----

    def read(self, offset: int, size: int) -> int:
        word = self._word(offset & ~3)
        return word >> 8 * (offset & 3) & ((1 << 8 * size) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        if 0x400 <= offset < 0x500:
            self.nvic.write(offset, value, size)
            return
        if size != 4:
            shift = 8 * (offset & 3)
            mask = ((1 << 8 * size) - 1) << shift
            value = self._word(offset & ~3) & ~mask | value << shift & mask
            offset &= ~3
        if 0x100 <= offset < 0x400:
            self.nvic.write(offset, value, 4)
        elif 0x10 <= offset < 0x20:
            self.systick.write(offset - 0x10, value)
        elif 0xD90 <= offset < 0xDBC:
            self.mpu.write(offset - 0xD90, value)
        else:
            self._control(offset, value)

    def _word(self, offset: int) -> int:
        if 0x100 <= offset < 0x500:
            return self.nvic.read(offset)
        if 0x10 <= offset < 0x20:
            return self.systick.read(offset - 0x10)
        if 0xD90 <= offset < 0xDBC:
            return self.mpu.read(offset - 0xD90)
        if 0xD18 <= offset < 0xD24:
            at = offset - 0xD18 + 4
            return int.from_bytes(bytes(self.nvic.priority[at : at + 4]), "little")
        known: dict[int, int | Callable[[], int]] = {
            0xD00: CPUID,
            0xD04: self._icsr,
            0xD08: self.vtor,
            0xD0C: 0xFA050000 | self._prigroup << 8,
            0xD10: self._scr,
            0xD14: 0x00040200 | self._ccr_bits,
            0xD24: self._shcsr,
            0xD28: self.cfsr,
            0xD2C: self.hfsr,
            0xD34: self.mmfar,
            0xD38: self.bfar,
            0xD78: 0x09000003,
            0xD7C: 0x8303C003,
            0xD80: CCSIDR.get(self._csselr, 0),
            0xD84: self._csselr,
            0xD88: self.cpacr,
            0xDFC: self._demcr,
            0xF34: self._fpccr,
            0xF3C: 0,
            0xF40: 0x10110021,
            0xF44: 0x11000011,
        }
        value = known.get(offset)
        if value is None:
            self._record.unmodelled[f"read SCS+0x{offset:X}"] += 1
            return 0
        return value if isinstance(value, int) else value()

    def _icsr(self) -> int:
        active = self.nvic.active[-1] if self.nvic.active else 0
        best = self.nvic.best() or 0
        waiting = 1 << 22 if self.nvic.pending >> FIRST_IRQ else 0
        bits = (self.nvic.pending >> SYSTICK & 1) << 26 | (self.nvic.pending >> PENDSV & 1) << 28
        return active | best << 12 | waiting | bits | (1 << 11 if len(self.nvic.active) == 1 else 0)

    def _control(self, offset: int, value: int) -> None:
        if offset == 0xD04:
            for bit, number, set_it in (
                (28, PENDSV, 1),
                (27, PENDSV, 0),
                (26, SYSTICK, 1),
                (25, SYSTICK, 0),
            ):
                if value >> bit & 1:
                    self.nvic.pending = self.nvic.pending & ~(1 << number) | set_it << number
            self.nvic.changed = True
        elif offset == 0xD08:
            self.vtor = value & ~0x7F
        elif offset == 0xD0C:
            self._interrupt_control(value)
        elif offset == 0xD10:
            self._scr = value & 0x16
        elif offset == 0xD14:
            self._ccr_bits = value & 0x0007011B
        elif 0xD18 <= offset < 0xD24:
            for k in range(4):
                self.nvic.priority[offset - 0xD18 + 4 + k] = value >> 8 * k & PRIORITY_BITS
        elif offset == 0xD24:
            self._shcsr = value & 0x00070000
            self.nvic.enabled = self.nvic.enabled & ~0x70 | value >> 12 & 0x70
        elif offset == 0xD28:
            self.cfsr &= ~value
        elif offset == 0xD2C:
            self.hfsr &= ~value
        elif offset == 0xD84:
            self._csselr = value & 0xF
        elif offset == 0xD88:
            self.cpacr = value & 0x00F00000
        elif offset == 0xDFC:
            self._demcr, self.dwt.trace = value & 0x010F07F1, bool(value >> 24 & 1)
        elif offset == 0xF34:
            self._fpccr = value
        elif offset not in CACHE_OPERATIONS:
            self._record.unmodelled[f"write SCS+0x{offset:X}"] += 1

    def _interrupt_control(self, value: int) -> None:
        if value >> 16 != KEY:
            self._record.hazards["AIRCR written without its key"] += 1
            return
        self._prigroup = value >> 8 & 7
        self.nvic.group_shift = max(self._prigroup + 1, 4)
        if value >> 2 & 1:
            self._reset_asked()
