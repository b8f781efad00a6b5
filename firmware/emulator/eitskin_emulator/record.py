"""The events of an emulated board that tests or users need to know."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Record:
    """Counts since power-up; the keys describe in words what was counted.

    Attributes:
        unmodelled: accesses to addresses and settings that the emulator does not model.
        clock_off: accesses to peripherals whose clock RCC has not enabled: they read 0 and ignore
            writes.
        hazards: what silicon may do otherwise, or forbids: too few wait states, DMA on cached
            memory, a wrong order of steps.
        interrupts: exceptions taken, by exception number (IRQ n is 16 + n).
        resets: why the processor started again, in order.
        faults: what the processor ran into, in order: kind, program counter, address.
        instructions: executed.
        asleep_ticks: passed in WFI.
    """

    unmodelled: Counter[str] = field(default_factory=Counter)
    clock_off: Counter[str] = field(default_factory=Counter)
    hazards: Counter[str] = field(default_factory=Counter)
    interrupts: Counter[int] = field(default_factory=Counter)
    resets: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    instructions: int = 0
    asleep_ticks: int = 0
