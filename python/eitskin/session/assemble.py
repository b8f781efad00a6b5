"""Assemble the packets of a stream: the packets of one frame become one ``Frame``, with times by a
clock that does not wrap."""

from collections.abc import Iterable, Iterator

from eitskin.device.client import Device
from eitskin.device.link import FramePart, Streamed
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import (
    DriveTouches,
    Fault,
    FrameEvents,
    RawFrame,
    SolvedImage,
    SolvedTouches,
)
from eitskin.session.frame import DriveReport, Frame, Message
from eitskin.session.notices import notice_of

WRAP_US = 2**32
LATE_US = 1_000_000


class Assembler:
    """Takes the packets of a stream of ``wanted`` kinds in their order. A frame is complete when
    its last kind came, or another frame begins."""

    def __init__(self, wanted: Stream, clock: "Clock | None" = None) -> None:
        self._wanted = bin(wanted & ~Stream.DRIVE_TOUCHES).count("1")
        self._clock = clock or Clock()
        self._parts: dict[type, FramePart] = {}
        self._number: int | None = None

    def take(self, item: Streamed) -> list[Message]:
        """The messages that ``item`` completes."""
        if isinstance(item, Fault | LinkEvent):
            return [notice_of(item)]
        if isinstance(item, DriveTouches):
            board_us = item.head.time_us
            return [DriveReport(self._clock.elapsed_us(board_us), board_us, item)]
        done: list[Message] = []
        if item.frame != self._number or type(item) in self._parts:
            done += self.rest()
            self._number = item.frame
        self._parts[type(item)] = item
        if len(self._parts) == self._wanted:
            done += self.rest()
        return done

    def rest(self) -> list[Message]:
        """Return an incomplete frame at the end of a stream."""
        parts, self._parts, self._number = self._parts, {}, None
        return [_frame(self._clock, parts)] if parts else []


def assembled(items: Iterable[Streamed], wanted: Stream) -> Iterator[Message]:
    """The messages of packets that are there already, or of ``Device.stream``."""
    assembler = Assembler(wanted)
    for item in items:
        yield from assembler.take(item)
    yield from assembler.rest()


def read_frames(
    device: Device, what: Stream, *, every: int = 1, frames: int = 0
) -> Iterator[Message]:
    """Yield the messages of ``Device.stream``, for callers that need nothing else of a session."""
    return assembled(device.stream(what, every=every, frames=frames), what)


class Clock:
    """Makes a clock that does not wrap of the board's, which wraps after 71 minutes."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._elapsed_us = 0

    def elapsed_us(self, board_us: int) -> int:
        """Return the time since the first one; after a restart of the board it continues."""
        if self._last is not None:
            step = (board_us - self._last) % WRAP_US
            if step > WRAP_US - LATE_US:  # a frame comes after drives of the next one
                return self._elapsed_us + step - WRAP_US
            self._elapsed_us += step if step < WRAP_US // 2 else 0
        self._last = board_us
        return self._elapsed_us


def _frame(clock: Clock, parts: dict[type, FramePart]) -> Frame:
    first = next(iter(parts.values()))
    board_us = (first if isinstance(first, RawFrame | FrameEvents) else first.solved).time_us
    raw, image = parts.get(RawFrame), parts.get(SolvedImage)
    touches, events = parts.get(SolvedTouches), parts.get(FrameEvents)
    assert raw is None or isinstance(raw, RawFrame)
    assert image is None or isinstance(image, SolvedImage)
    assert touches is None or isinstance(touches, SolvedTouches)
    assert events is None or isinstance(events, FrameEvents)
    solved = touches or image
    return Frame(
        first.frame,
        clock.elapsed_us(board_us),
        board_us,
        raw=raw,
        solver_image=None if image is None else image.image,
        touches=() if touches is None else touches.touches,
        has_touches=touches is not None,
        info=None if solved is None else solved.solved,
        board_events=None if events is None else events.events,
    )
