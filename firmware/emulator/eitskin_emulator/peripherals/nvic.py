"""Exceptions by priority (ARMv7-M manual B1.5, B3.4): the NVIC's interrupts, whose lines are
levels, and the core's own.

A line that is high makes its interrupt pending, and again when its handler returns and it is still
high: a flag that a handler forgets brings it back for ever. The STM32F7 has 110 interrupts and 16
levels (the upper four bits of a priority).
"""

from eitskin_emulator.cpu import RegisterSet

NMI, HARD_FAULT, MEMORY_FAULT, BUS_FAULT, USAGE_FAULT = 2, 3, 4, 5, 6
SVCALL, PENDSV, SYSTICK = 11, 14, 15
FIRST_IRQ = 16
INTERRUPTS = 110
FIXED = {1: -3, 2: -2, HARD_FAULT: -1}
THREAD_PRIORITY = 256
PRIORITY_BITS = 0xF0
CORE_EXCEPTIONS = (1 << HARD_FAULT) | (1 << 2) | (1 << SVCALL) | (1 << PENDSV) | (1 << SYSTICK)


class Nvic:
    """State of all exceptions; sets of them are integers, bit n is exception n."""

    def __init__(self, masks: RegisterSet) -> None:
        self._masks = masks
        self.reset()

    def reset(self) -> None:
        """As after a reset."""
        self.enabled = CORE_EXCEPTIONS
        self.pending = 0
        self.lines = 0
        self.active: list[int] = []
        self.priority = [0] * (FIRST_IRQ + INTERRUPTS + 2)
        self.group_shift = 4
        self.changed = True

    # ---- lines and pending ----

    def set_line(self, irq: int, high: bool) -> None:
        """A peripheral's interrupt line is ``high`` or low."""
        bit = 1 << (FIRST_IRQ + irq)
        if high:
            if not self.lines & bit:
                self.lines |= bit
                if not self.is_active(FIRST_IRQ + irq):
                    self.pend(FIRST_IRQ + irq)
        elif self.lines & bit:
            self.lines &= ~bit

    def pend(self, number: int) -> None:
        """Make exception ``number`` pending."""
        self.pending |= 1 << number
        self.changed = True

    def is_active(self, number: int) -> bool:
        """Return whether its handler has begun and not returned."""
        return number in self.active

    # ---- which is next ----

    def urgency(self, number: int) -> int:
        """The group priority of exception ``number``: less is more urgent."""
        fixed = FIXED.get(number)
        return (
            fixed
            if fixed is not None
            else (self.priority[number] & PRIORITY_BITS) >> self.group_shift
        )

    def running_urgency(self) -> int:
        """The most urgent priority of the handlers that have begun, without the masks."""
        return min((self.urgency(number) for number in self.active), default=THREAD_PRIORITY)

    def masked_urgency(self) -> int:
        """The same, with PRIMASK, BASEPRI and FAULTMASK."""
        primask, basepri, faultmask = self._masks.read()
        urgency = self.running_urgency()
        if basepri & PRIORITY_BITS:
            urgency = min(urgency, (basepri & PRIORITY_BITS) >> self.group_shift)
        if primask & 1:
            urgency = min(urgency, 0)
        return min(urgency, -1) if faultmask & 1 else urgency

    def best(self) -> int | None:
        """The most urgent exception that is pending and enabled; of equals the least number."""
        candidates = self.pending & self.enabled
        best: int | None = None
        while candidates:
            number = (candidates & -candidates).bit_length() - 1
            candidates &= candidates - 1
            if best is None or (self.urgency(number), self.priority[number]) < (
                self.urgency(best),
                self.priority[best],
            ):
                best = number
        return best

    def enter(self, number: int) -> None:
        """Its handler begins."""
        self.pending &= ~(1 << number)
        self.active.append(number)
        self.changed = True

    def leave(self) -> int | None:
        """The last handler returns: its number; None: there was none."""
        if not self.active:
            return None
        number = self.active.pop()
        if self.lines >> number & 1:
            self.pending |= 1 << number
        self.changed = True
        return number

    # ---- registers, 0xE000E100 on; offsets from 0xE000E000 ----

    def read(self, offset: int) -> int:
        """A word."""
        if 0x400 <= offset < 0x400 + INTERRUPTS + 2:
            at = offset - 0x400 + FIRST_IRQ
            return int.from_bytes(bytes(self.priority[at : at + 4]).ljust(4, b"\0"), "little")
        word = offset % 0x80 // 4
        shift = FIRST_IRQ + 32 * word
        if offset < 0x200:
            return self.enabled >> shift & 0xFFFFFFFF
        if offset < 0x300:
            return self.pending >> shift & 0xFFFFFFFF
        return sum(1 << (number - shift) for number in self.active if shift <= number < shift + 32)

    def write(self, offset: int, value: int, size: int) -> None:
        """A word, or single priorities."""
        if offset >= 0x400:
            for k in range(size):
                if offset - 0x400 + k < INTERRUPTS:
                    self.priority[offset - 0x400 + k + FIRST_IRQ] = value >> 8 * k & PRIORITY_BITS
        else:
            word = offset % 0x80 // 4
            bits = (value & (1 << max(min(INTERRUPTS - 32 * word, 32), 0)) - 1) << (
                FIRST_IRQ + 32 * word
            )
            if offset < 0x180:
                self.enabled |= bits
            elif offset < 0x200:
                self.enabled &= ~bits
            elif offset < 0x280:
                self.pending |= bits
            elif offset < 0x300:
                self.pending &= ~bits | self.lines  # a level that is high stays
        self.changed = True
