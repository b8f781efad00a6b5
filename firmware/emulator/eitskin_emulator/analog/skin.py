"""The skin as the multiplexers meet it: the amplitude of the voltage for the electrodes that are
joined, from a scene's frames.

Until the scene begins the untouched frames are shown, one a scan, over and over;
``restart_untouched`` begins with the first again. Then frame floor(t rate_hz) is shown, t the
board's time since the scene began, and the last one is held. A frame is one scan: which frame it
is, is decided when a scan begins (a row that comes before the one before it); where touches move,
each row is that of the time at which it is switched to. A frame's noise and front-end effects are
the scene's; the scene's ``adc`` effect is left out, since the emulated converter does that.

Electrodes that are no row of the scene's protocol, nor one with pairs exchanged or turned round,
give 0 V (counted in ``unknown_rows``); so does a pair that is not joined.
"""

from collections import Counter
from typing import Protocol as TypingProtocol

from eitskin.arrays import FloatArray
from eitskin.skin.protocol import Protocol
from eitskin_emulator.clocktime import TICKS_PER_S

Joined = tuple[int | None, int | None, int | None, int | None]


class Rows(TypingProtocol):
    """Frames by number: an array (n, m), or an object that computes them on request."""

    def __len__(self) -> int: ...
    def __getitem__(self, frame: int, /) -> FloatArray: ...


class Moving(Rows, TypingProtocol):
    """Frames that depend on when their rows are read."""

    def at(self, frame: int, time_s: float) -> FloatArray:
        """Return all rows (m,) at ``time_s`` after the beginning of the scene."""
        ...


class AnalogSkin:
    """``untouched_v`` (q, m) and ``frames_v`` (n rows of m): amplitudes in V, in the rows of
    ``protocol``, for its current; ``moving`` are ``frames_v`` where touches move while they are
    scanned."""

    def __init__(
        self,
        protocol: Protocol,
        untouched_v: FloatArray,
        frames_v: Rows,
        rate_hz: float,
        moving: Moving | None = None,
    ) -> None:
        self.protocol, self._moving = protocol, moving
        self.untouched_v, self.frames_v, self.rate_hz = untouched_v, frames_v, rate_hz
        self.rows = rows_of(protocol)
        self.unknown_rows: Counter[Joined] = Counter()
        self.scans = 0
        self._began: int | None = None
        self._row = len(protocol.drive_measure)
        self._shown: FloatArray = untouched_v[0]
        self._untouched_next = 0
        self._frame = -1  # of the scene, shown in this scan; -1 is an untouched one

    def begin(self, at: int) -> None:
        """Let the scene's time 0 be ``at`` (ticks)."""
        self._began = at

    def begin_again(self) -> None:
        """Let time 0 be when the scene ended."""
        assert self._began is not None
        self._began += round(len(self.frames_v) * TICKS_PER_S / self.rate_hz)

    def over(self, at: int) -> bool:
        """Return whether the scene has ended."""
        return self._began is not None and self.frame_number(at) >= len(self.frames_v)

    def frame_number(self, at: int) -> int:
        """Return the number of the scene's frame at ``at``; it may be beyond the last one."""
        assert self._began is not None
        return int((at - self._began) * self.rate_hz // TICKS_PER_S)

    def amplitude_v(self, at: int, joined: Joined) -> float:
        """V(V+) - V(V-), peak, that the excitation makes between the joined electrodes."""
        if None in joined:
            return 0.0
        found = self.rows.get(joined)  # type: ignore[arg-type]
        if found is None:
            self.unknown_rows[joined] += 1
            return 0.0
        row, sign = found
        if row < self._row or len(self._shown) == 1:
            self._next_frame(at)
        self._row = row
        if self._moving is not None and self._frame >= 0:
            self._shown = self._moving.at(self._frame, self._time_s(at))
        return sign * float(self._shown[row])

    def _time_s(self, at: int) -> float:
        """From the scene's beginning to ``at``."""
        assert self._began is not None
        return (at - self._began) / TICKS_PER_S

    def _next_frame(self, at: int) -> None:
        self.scans += 1
        if self._began is None or at < self._began:
            self._shown = self.untouched_v[self._untouched_next % len(self.untouched_v)]
            self._untouched_next += 1
            self._frame = -1
        else:
            self._frame = min(self.frame_number(at), len(self.frames_v) - 1)
            self._shown = self.frames_v[self._frame]


def rows_of(protocol: Protocol) -> dict[tuple[int, int, int, int], tuple[int, int]]:
    """Return row and sign for all electrodes [I+, I-, V+, V-] that follow from the protocol's rows,
    with exchanged pairs or reversed signs."""
    found: dict[tuple[int, int, int, int], tuple[int, int]] = {}
    table = protocol.drive_measure.tolist()
    for a, b, c, d, row in [(*row, k) for k, row in enumerate(table)]:
        found[a, b, c, d] = (row, 1)
    for a, b, c, d, row in [(*row, k) for k, row in enumerate(table)]:
        for p, q, r, s in ((a, b, c, d), (c, d, a, b)):
            for electrodes, sign in (
                ((p, q, r, s), 1),
                ((q, p, r, s), -1),
                ((p, q, s, r), -1),
                ((q, p, s, r), 1),
            ):
                found.setdefault(electrodes, (row, sign))
    return found
