"""Compute touches after each drive on this host from recorded frames, in step with a board, and
compare them with the board's, bit by bit."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.core.fast import AlignedFrame, FastCore, FastTouch
from eitskin.core.results import Reconstruction
from eitskin.device.wire.link_table import DriveTouch, RawFlags
from eitskin.device.wire.packets import BoardInfo, DriveTouches, RawFrame
from eitskin.errors import FrameError
from eitskin.skin.protocol import Protocol

Numbers = tuple[bytes, ...]


class DrivesTwin:
    """The tracker ``fast`` of an engine whose reference a tare has set. ``same`` and ``different``
    count drives that were compared: all of a frame since the board began."""

    def __init__(self, fast: FastCore, protocol: Protocol, board: BoardInfo) -> None:
        self._fast, self._board = fast, board
        self._drives = _in_order(self._fast, protocol)
        self._reported: dict[int, dict[int, Numbers]] = defaultdict(dict)
        self._next: int | None = None
        self._found: Sequence[Touch] | None = None
        self.compares = False  # reports after drives were asked for
        self.same = self.different = 0

    def hear(self, packet: DriveTouches) -> None:
        """Keep the touches after a drive; its frame comes later."""
        head, self.compares = packet.head, True
        self._reported[head.frame][head.drive] = _numbers(packet.touches)

    def forget(self) -> None:
        """A frame is missing here: what follows is inconclusive until the board begins again."""
        self._next = None

    def take(self, raw: RawFrame) -> AlignedFrame | None:
        """Take the next frame's drives. Returns the aligned frame, or None if it was not aligned or
        frames are missing here."""
        reported = self._reported.pop(raw.frame, {})
        if raw.flags & RawFlags.BEGUN:
            self._next, self._found = raw.frame, None
            try:
                self._fast.begin()
            except FrameError:
                self._next = None
        if raw.frame != self._next:
            self._next = None
            return None
        self._next = (raw.frame + 1) % 2**32
        for number, middle_us in self._drives_at(raw.time_us):
            rows = self._fast.rows[number]
            here = self._fast.drive(number, raw.voltage_v[rows], middle_us / 1e6)
            if self.compares:
                same = reported.get(number, ()) == _numbers(here)
                self.same, self.different = self.same + same, self.different + (not same)
        if not raw.flags & RawFlags.ALIGNED:
            return None
        if self._found is not None:
            self._fast.confirm(self._found)
        self._found = None
        aligned = self._fast.aligned(raw.voltage_v)
        self.different += aligned.trusted != bool(raw.flags & RawFlags.TRUSTED)
        return aligned

    def found(self, result: Reconstruction) -> Reconstruction:
        """Keep the touches that the solver found in the last frame, which the drives of the next
        one take into account; return the result with the touches and the diagnostics that are
        reported."""
        self._found = result.touches
        reported = self._fast.followed(result)
        return replace(reported, info=self._fast.named(reported.info))

    def followed(self) -> tuple[Touch, ...]:
        """The touches of the last frame where it was not solved."""
        return self._fast.report(None)

    def _drives_at(self, time_us: int) -> list[tuple[int, int]]:
        """Drives of a scan that began at ``time_us``, and their middles by the board's clock."""
        board, first, found = self._board, 0, []
        burst_us = ceil(board.samples * 1_000_000 / board.sample_rate_hz)
        for number in self._drives:
            count = len(self._fast.rows[number])
            half_us = ((count - 1) * board.slot_us + burst_us) // 2
            found.append((number, (time_us + first * board.slot_us + half_us) % 2**32))
            first += count
        return found


def _in_order(fast: FastCore, protocol: Protocol) -> list[int]:
    """Return the numbers of the drives in the order of measurement."""
    first = {int(rows[0]): number for number, rows in enumerate(fast.rows)}
    return [first[int(row)] for row in protocol.scan_rows if int(row) in first]


def _numbers(touches: Sequence[DriveTouch] | Sequence[FastTouch]) -> Numbers:
    """Return each touch's numbers as they are on the wire."""
    return tuple(
        np.array([touch.id & 0xFFFF, touch.confirmed, touch.x_mm, touch.y_mm, touch.vx_mm_per_s,
                  touch.vy_mm_per_s, touch.strength_s_per_m_mm2, touch.radius_mm,
                  touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2],
                 dtype="<f4").tobytes()
        for touch in touches
    )  # fmt: skip
