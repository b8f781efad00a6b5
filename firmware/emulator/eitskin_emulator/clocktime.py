"""The board's time in ticks of 1/432 MHz: every clock that the firmware may set up from 8 or 16 MHz
is a whole number of them.

The processor's part of it is instructions: one cycle each at the clock that RCC is set to. That is
an assumption, and times are estimates: a Cortex-M7 issues up to two instructions per cycle, and
waits for flash, divisions and mispredicted branches. ``timing`` replaces the assumption by a lower
and an upper bound. What does not depend on the processor (slots, samples, bits on wires) is exact.
"""

from typing import Protocol

TICKS_PER_S = 432_000_000
TICKS_PER_US = TICKS_PER_S // 1_000_000


def period_ticks(hz: float) -> int:
    """Ticks (at least 1) of a period at ``hz``, rounded."""
    return max(round(TICKS_PER_S / hz), 1)


class TickCount(Protocol):
    """A number that counts by itself, as ctypes holds it."""

    value: int


class BoardClock:
    """Now, in ticks: what had passed before the running slice, and the instructions in it."""

    def __init__(self) -> None:
        self.cycle_ticks = 27
        self.instruction_ticks = 27  # an instruction takes so long
        self._base = 0
        self._count: TickCount | None = None  # of the running slice's instructions
        self._counted = 0  # of which are in _base

    @property
    def now(self) -> int:
        """Ticks since power came."""
        count = self._count
        return (
            self._base
            if count is None
            else self._base + (count.value - self._counted) * self.instruction_ticks
        )

    @property
    def now_s(self) -> float:
        """Seconds since power came."""
        return self.now / TICKS_PER_S

    def slice_begins(self, count: TickCount) -> None:
        """From now on ``count`` counts instructions, from 0."""
        self._count, self._counted = count, 0

    def slice_ends(self, executed: int) -> None:
        """Note that the slice has executed so many instructions."""
        self._base += (executed - self._counted) * self.instruction_ticks
        self._count = None

    def set_cycle_ticks(self, ticks: int) -> None:
        """From now on a cycle takes so long, and an instruction a cycle."""
        self._base = self.now
        self._counted = 0 if self._count is None else self._count.value
        self.cycle_ticks = self.instruction_ticks = ticks

    def skip(self, ticks: int) -> None:
        """The processor stands still for so long (stalled, asleep, or entering an exception)."""
        self._base += ticks

    def skip_to(self, at: int) -> None:
        """The processor does nothing until ``at``."""
        self._base += max(at - self.now, 0)
