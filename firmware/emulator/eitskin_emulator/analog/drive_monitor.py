"""Checks the firmware's control of the current at every write to multiplexers or generator
(``tests/firmware`` and ``sim:`` have the same in C). A violation makes a test fail with its
sentence:

- I+ and I-, or V+ and V-, are on one electrode.
- An address changes while its multiplexer is enabled.
- The generator takes a word other than its reset while a multiplexer is enabled.
- Current flows though no host has asked, or 1 s after its last packet, where the owner has not
  allowed it.
"""

from collections.abc import Callable

from eitskin_emulator.analog.ad9833 import B28, RESET, Ad9833
from eitskin_emulator.analog.adg1206 import Multiplexers
from eitskin_emulator.clocktime import TICKS_PER_S

MAX_LOGGED = 100


class DriveMonitor:
    """``violations`` in words, of the multiplexers' own too. ``heard_at`` gives when the host's
    last byte came (None: none since power); ``may_be_silent`` whether the owner lets current flow
    without a host."""

    def __init__(
        self,
        generator: Ad9833,
        multiplexers: Multiplexers,
        heard_at: Callable[[], int | None],
        may_be_silent: Callable[[], bool],
    ) -> None:
        self._generator, self._multiplexers = generator, multiplexers
        self._heard_at, self._may_be_silent = heard_at, may_be_silent
        self._own: list[str] = []
        self._started_at = 0

    @property
    def violations(self) -> list[str]:
        return self._multiplexers.violations + self._own

    def start(self, at: int) -> None:
        """The processor starts: a host that it has not heard since has asked for nothing."""
        self._started_at = at

    def switched(self, at: int) -> None:
        """The multiplexers have another state."""
        plus, minus, v_plus, v_minus = self._multiplexers.joined
        if plus is not None and plus == minus:
            self._note(at, f"I+ and I- are both on electrode {plus}")
        if v_plus is not None and v_plus == v_minus:
            self._note(at, f"V+ and V- are both on electrode {v_plus}")
        self.look(at)

    def word(self, at: int, word: int) -> None:
        """The generator took ``word``."""
        stops = word >> 14 == 0 and word & B28 and word & RESET
        if not stops and any(one is not None for one in self._multiplexers.joined):
            self._note(at, f"the generator took 0x{word:04X} while multiplexers are enabled")
        self.look(at)

    def look(self, at: int) -> None:
        """At any time: current only while a host is heard that asked."""
        joined = self._multiplexers.joined
        if self._generator.frequency_hz == 0 or None in joined[:2]:
            return
        heard = self._heard_at()
        if heard is not None and self._started_at <= heard and at - heard <= TICKS_PER_S:
            return
        if not self._may_be_silent():
            silent = heard is not None and heard >= self._started_at
            last = "1 s after the host's last packet" if silent else "though no host has asked"
            self._note(at, f"current flows {last}")

    def _note(self, at: int, what: str) -> None:
        if len(self._own) < MAX_LOGGED:
            self._own.append(f"{at / TICKS_PER_S * 1e6:.3f} us: {what}")
