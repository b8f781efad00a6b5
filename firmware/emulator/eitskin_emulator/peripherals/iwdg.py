"""The independent watchdog (RM0410 chapter 30), from the 32 kHz LSI; a written PR or RLR is busy
for five of its periods."""

from collections.abc import Callable

from eitskin_emulator.clocktime import BoardClock, period_ticks
from eitskin_emulator.peripherals.registers import Registers
from eitskin_emulator.record import Record
from eitskin_emulator.schedule import Event, Schedule

LSI_TICKS = period_ticks(32_000)
START, UNLOCK, RELOAD = 0xCCCC, 0x5555, 0xAAAA
KR, PR, RLR, SR, WINR = (4 * k for k in range(5))
APB1_FREEZE, DEVICE_ID = 0x8, 0x10016451
RESET_VALUES = {KR: 0, PR: 0, RLR: 0xFFF, SR: 0, WINR: 0xFFF}


class Iwdg(Registers):
    """0x40003000. ``expired`` is called when nobody fed it in time."""

    name, base = "IWDG", 0x40003000

    def __init__(
        self, clock: BoardClock, schedule: Schedule, record: Record, expired: Callable[[], None]
    ) -> None:
        super().__init__(record, RESET_VALUES)
        self._clock, self._schedule = clock, schedule
        self._event = Event(lambda at: expired())
        self._on = self._open = False
        self._busy_until = self._expires_at = 0
        self.feeds = 0

    def reset(self) -> None:
        """As after a reset: off."""
        self.values = dict(self.reset_values)
        self._on = self._open = False
        self._schedule.set(self._event, None)

    @property
    def running(self) -> bool:
        """Return whether it has been started."""
        return self._on

    @property
    def timeout_ticks(self) -> int:
        """From a feed to the reset."""
        return LSI_TICKS * (4 << min(self.values[PR], 6)) * (self.values[RLR] + 1)

    def read(self, offset: int, size: int) -> int:
        if offset == SR:
            return 3 if self._clock.now < self._busy_until else 0
        return super().read(offset, size)

    def write(self, offset: int, size: int, value: int) -> None:
        if offset == KR:
            self._open = value == UNLOCK
            self._on = self._on or value == START
            self.feeds += value == RELOAD
            if self._on and value in (START, RELOAD):
                self._begin()
        elif offset == WINR:
            self.unmodelled("a window")
        elif not self._open:
            self.hazard("PR or RLR written while it is locked")
        else:
            self._busy_until = self._clock.now + 5 * LSI_TICKS
            super().write(offset, size, value & (7 if offset == PR else 0xFFF))
            if self._on:
                self._begin()

    def hold(self, ticks: int) -> None:
        """Stand still for so long."""
        if self._on:
            self._expires_at += ticks
            self._schedule.set(self._event, self._expires_at)

    def _begin(self) -> None:
        self._expires_at = self._clock.now + self.timeout_ticks
        self._schedule.set(self._event, self._expires_at)


class DebugControl(Registers):
    """DBGMCU, 0xE0042000 (RM0410 40.16): what a debugger's halt stops. Power resets it alone."""

    name, base = "DBGMCU", 0xE0042000

    def __init__(self, record: Record) -> None:
        super().__init__(record, {0x0: DEVICE_ID, 0x4: 0, APB1_FREEZE: 0, 0xC: 0})

    @property
    def stops_watchdog(self) -> bool:
        """Return whether the watchdog stands still while the processor is halted."""
        return bool(self.values[APB1_FREEZE] >> 12 & 1)
