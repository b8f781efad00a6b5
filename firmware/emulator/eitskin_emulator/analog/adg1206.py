"""ADG1206 multiplexers (data sheet Rev. C), four for electrodes 0 to 15 and four for 16 to 31 on
the same address lines: which electrode each joins, and whether they were broken before they made.

Address and enable come as the levels that pins drive; a pin that drives nothing counts as low (the
board's pull-downs). The part's own transition time (at most 140 ns) is part of the settling. An
address that changes while its enable is high, or sooner after it went low than the slowest part
takes to open (tOFF(EN)), may join two electrodes; so do two enables of one of I+, I-, V+ and V-.
All are recorded.
"""

from collections.abc import Callable
from dataclasses import dataclass

from eitskin_emulator.clocktime import TICKS_PER_S

NAMES = ("I+", "I-", "V+", "V-")
OFF_TICKS = 140 * TICKS_PER_S // 10**9  # the longest tOFF(EN), -40 to 125 C on +-15 V (table 1)
MAX_LOGGED = 20_000
ELECTRODES, OF_ONE_PART = 32, 16


@dataclass(frozen=True)
class Switching:
    """From ``at`` on these electrodes are joined (None: off), [I+, I-, V+, V-]."""

    at: int
    joined: tuple[int | None, int | None, int | None, int | None]


class Multiplexers:
    """``switched`` hears of each change."""

    def __init__(self) -> None:
        self._address = self._enable = 0
        self._off_at = [-OFF_TICKS] * 4
        self.switched: Callable[[Switching], None] = lambda switching: None
        self.joined: tuple[int | None, int | None, int | None, int | None] = (None,) * 4
        self.log: list[Switching] = []
        self.changes = 0
        self.violations: list[str] = []

    def set_addresses(self, at: int, address: int) -> None:
        """The 16 address lines: four bits each."""
        changed = address ^ self._address
        for k, name in enumerate(NAMES):
            if changed >> 4 * k & 0xF:
                if self._enable & 0x11 << k:
                    self._violation(at, f"{name} changed its address while enabled")
                elif at < self._off_at[k] + OFF_TICKS:
                    self._violation(at, f"{name} changed its address before it was open")
        self._address = address
        self._follow(at)

    def set_enables(self, at: int, enable: int) -> None:
        """Set the eight enables; those of electrodes 0 to 15 are the lowest bits."""
        for k, name in enumerate(NAMES):
            if self._enable & ~enable & 0x11 << k:
                self._off_at[k] = at
            if enable & 0x11 << k == 0x11 << k:
                self._violation(at, f"{name} is on two electrodes")
        self._enable = enable
        self._follow(at)

    def release(self, at: int) -> None:
        """Let all lines float at once, because the processor is reset. This does not count as a
        switching order of the program."""
        self._address = self._enable = 0
        self._off_at = [at] * 4
        self._follow(at)

    def _follow(self, at: int) -> None:
        joined = (self._electrode(0), self._electrode(1), self._electrode(2), self._electrode(3))
        if joined != self.joined:
            self.joined = joined
            self.changes += 1
            one = Switching(at, joined)
            if len(self.log) < MAX_LOGGED:
                self.log.append(one)
            self.switched(one)

    def _electrode(self, k: int) -> int | None:
        for part in range(ELECTRODES // OF_ONE_PART):
            if self._enable >> 4 * part + k & 1:
                return OF_ONE_PART * part + (self._address >> 4 * k & 0xF)
        return None

    def _violation(self, at: int, what: str) -> None:
        if len(self.violations) < MAX_LOGGED:
            self.violations.append(f"{at / TICKS_PER_S * 1e6:.3f} us: {what}")
