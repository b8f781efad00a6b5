"""The wire between board and host: 1 Mbaud both ways, bytes with the times at which they are
whole."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from eitskin_emulator.clocktime import TICKS_PER_S, BoardClock
from eitskin_emulator.schedule import NEVER

BAUD = 1_000_000
FRAME_BITS = 10
TOLERANCE = 0.03


@dataclass
class ByteRun:
    """Bytes one after the other: byte k is whole at ``first_end + k * frame_ticks``."""

    data: bytes
    first_end: int
    frame_ticks: int
    taken: int = 0

    def ended(self, at: int) -> int:
        """Return how many of all bytes are complete at ``at``."""
        return (
            0
            if at < self.first_end
            else min((at - self.first_end) // self.frame_ticks + 1, len(self.data))
        )

    @property
    def last_end(self) -> int:
        return self.first_end + (len(self.data) - 1) * self.frame_ticks


class SerialLine:
    """Both directions; ``host_sends`` is called when the host begins to send."""

    def __init__(self, clock: BoardClock, baud: int = BAUD) -> None:
        self._clock = clock
        self.frame_ticks = FRAME_BITS * TICKS_PER_S // baud
        self._down: deque[ByteRun] = deque()
        self._up: deque[ByteRun] = deque()
        self._host_free_at = 0
        self.heard_at: int | None = None  # when the host's last byte reaches the board
        self.host_sends: Callable[[], None] = lambda: None

    def agrees(self, frame_ticks: int) -> bool:
        """Return whether a side with frames of this length understands the line."""
        return abs(frame_ticks - self.frame_ticks) <= TOLERANCE * self.frame_ticks

    # ---- the host's end ----

    def send(self, data: bytes) -> None:
        """Send ``data`` from the host, from now on or after the bytes that it sent before."""
        if data:
            start = max(self._clock.now, self._host_free_at)
            self._host_free_at = start + len(data) * self.frame_ticks
            self.heard_at = self._host_free_at
            self._down.append(ByteRun(data, start + self.frame_ticks, self.frame_ticks))
            self.host_sends()

    def receive(self, at: int) -> bytes:
        """Return the bytes that the board sent and the host has completely by ``at``."""
        return _take(self._up, at)

    def up_next_end(self) -> int:
        """When the host has the next byte; NEVER if none is on its way."""
        return (
            self._up[0].first_end + self._up[0].taken * self._up[0].frame_ticks
            if self._up
            else NEVER
        )

    # ---- the board's end ----

    def from_board(self, data: bytes, start: int, frame_ticks: int) -> None:
        """The board sends ``data`` from ``start`` on."""
        if data:
            self._up.append(ByteRun(data, start + frame_ticks, frame_ticks))

    def to_board(self, at: int) -> tuple[bytes, int]:
        """Return the bytes that have arrived at the board by ``at`` and were not taken before, and
        the time at which the last one was complete."""
        ends = [
            run.first_end + (run.ended(at) - 1) * run.frame_ticks
            for run in self._down
            if run.ended(at)
        ]
        return _take(self._down, at), max(ends, default=0)

    def arrives(self, number: int) -> int:
        """Return when the ``number``-th byte from here will be complete at the board; NEVER if
        fewer bytes are on their way."""
        for run in self._down:
            left = len(run.data) - run.taken
            if number <= left:
                return run.first_end + (run.taken + number - 1) * run.frame_ticks
            number -= left
        return NEVER

    def last_arrives(self) -> int:
        """When the last byte that is on its way will be whole; NEVER if none is."""
        return self._down[0].last_end if self._down else NEVER

    def clear(self) -> None:
        """Lose the bytes that are on their way."""
        self._down.clear()
        self._up.clear()


def _take(runs: deque[ByteRun], at: int) -> bytes:
    out = bytearray()
    while runs:
        run = runs[0]
        ended = run.ended(at)
        out += run.data[run.taken : ended]
        run.taken = ended
        if ended < len(run.data):
            break
        runs.popleft()
    return bytes(out)


def resampled(data: bytes, sent_frame_ticks: int, read_frame_ticks: int) -> bytes:
    """Return what a receiver whose bits last ``read_frame_ticks`` / 10 makes of bytes sent at
    ``sent_frame_ticks`` / 10 a bit."""
    bits = [bit for byte in data for bit in (0, *(byte >> k & 1 for k in range(8)), 1)]
    level = [*bits, 1, 1, 1, 1]
    sent, read = sent_frame_ticks / FRAME_BITS, read_frame_ticks / FRAME_BITS
    out, at, end = bytearray(), 0.0, len(bits) * sent

    def line(time: float) -> int:
        return level[min(int(time / sent), len(level) - 1)]

    while at < end:
        if line(at) == 1:  # waits for a start bit
            at += read / 16
            continue
        out.append(sum(line(at + (k + 1.5) * read) << k for k in range(8)))
        at += 9.5 * read
    return bytes(out)
