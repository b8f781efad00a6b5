"""SysTick (ARMv7-M manual B3.3), from the processor's clock or an eighth of it."""

from eitskin_emulator.clocktime import BoardClock
from eitskin_emulator.peripherals.nvic import SYSTICK, Nvic
from eitskin_emulator.schedule import Event, Schedule

ENABLE, INTERRUPT, FROM_CPU, WRAPPED = 1, 2, 4, 1 << 16


class SysTick:
    """Counts down from LOAD to 0 and begins again."""

    def __init__(self, clock: BoardClock, schedule: Schedule, nvic: Nvic) -> None:
        self._clock, self._schedule, self._nvic = clock, schedule, nvic
        self._event = Event(self._wrap)
        self.reset()

    def reset(self) -> None:
        """As after a reset."""
        self._control = self._load = 0
        self._wrapped = False
        self._began = 0  # when it last had the value LOAD
        self._schedule.set(self._event, None)

    def clock_changed(self) -> None:
        """The processor's clock has another frequency: the period begins again."""
        if self._control & ENABLE:
            self._begin(self._clock.now)

    def read(self, offset: int) -> int:
        """A register, from its own start."""
        if offset == 0x0:
            wrapped, self._wrapped = self._wrapped, False
            return self._control | (WRAPPED if wrapped else 0)
        if offset == 0x4:
            return self._load
        if offset == 0x8:
            if not self._control & ENABLE:
                return 0
            passed = (self._clock.now - self._began) // self._tick()
            return max(self._load - passed, 0)
        return 0

    def write(self, offset: int, value: int) -> None:
        """A register, from its own start."""
        if offset == 0x0:
            before, self._control = self._control, value & 7
            if self._control & ENABLE and not before & ENABLE:
                self._begin(self._clock.now)
            elif not self._control & ENABLE:
                self._schedule.set(self._event, None)
        elif offset == 0x4:
            self._load = value & 0xFFFFFF
        elif offset == 0x8:
            self._wrapped = False
            if self._control & ENABLE:
                self._begin(self._clock.now)

    def _tick(self) -> int:
        return self._clock.cycle_ticks * (1 if self._control & FROM_CPU else 8)

    def _begin(self, now: int) -> None:
        self._began = now
        self._schedule.set(
            self._event, now + (self._load + 1) * self._tick() if self._load else None
        )

    def _wrap(self, at: int) -> None:
        self._wrapped = True
        if self._control & INTERRUPT:
            self._nvic.pend(SYSTICK)
        self._begin(at)
