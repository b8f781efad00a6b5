"""A board's frames as they come, each with everything that came of it."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from eitskin.device.client import Device
from eitskin.device.link import LinkEvent
from eitskin.device.sample import Sample
from eitskin.device.wire.explain import status_text
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import (
    BoardStats,
    Fault,
    FollowedTouches,
    FrameEvents,
    RawFrame,
    Solved,
    SolvedImage,
    SolvedTouches,
)
from eitskin.errors import DeviceError

WRAP_US = 2**32
LATE_US = 1_000_000


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What came of one frame. ``time_us`` counts from the first frame of the stream and does not
    wrap; ``board_us`` is the board's own clock when the scan began. At least one of the packets
    is there."""

    number: int
    time_us: int
    board_us: int
    raw: RawFrame | None = None
    image: SolvedImage | None = None
    touches: SolvedTouches | None = None
    events: FrameEvents | None = None

    @property
    def solved(self) -> Solved | None:
        """What the solver said, where the frame was solved."""
        if self.touches is not None:
            return self.touches.solved
        return None if self.image is None else self.image.solved

    @property
    def refused(self) -> str | None:
        """Why the board's core refused the frame; None where it did not."""
        solved = self.solved
        return status_text(solved.status) if solved is not None and solved.status else None


@dataclass(frozen=True, eq=False)
class LiveDrive:
    """Touches after a drive, and the instant they hold for, by the same clocks."""

    time_us: int
    board_us: int
    followed: FollowedTouches


@dataclass
class LiveSummary:
    """What a stream amounted to. Times are the board's own, in us: solve and touches of each solved
    frame."""

    frames: int = 0
    drives: int = 0
    refused: int = 0
    faults: int = 0
    first_us: int = 0
    last_us: int = 0
    solve_us: Sample = field(default_factory=Sample)
    link: dict[str, int] = field(default_factory=dict)
    board: BoardStats | None = None

    def add(self, frame: LiveFrame) -> None:
        if not self.frames:
            self.first_us = frame.time_us
        self.frames += 1
        self.last_us = frame.time_us
        if frame.solved is not None:
            self.refused += frame.solved.status != 0
            self.solve_us.add(frame.solved.solve_us + frame.solved.touch_us)

    @property
    def rate_hz(self) -> float | None:
        """Streamed frames a second of the board's time."""
        span = self.last_us - self.first_us
        return 1e6 * (self.frames - 1) / span if span > 0 else None

    @property
    def solve_quantiles_us(self) -> tuple[float, float] | None:
        """Median and 99th percentile; None where nothing was solved, or the board tells no times (a
        simulated one)."""
        if self.solve_us.largest <= 0:
            return None
        return self.solve_us.quantile(0.5), self.solve_us.quantile(0.99)

    def as_dict(self) -> dict[str, Any]:
        quantiles = self.solve_quantiles_us or (None, None)
        return {
            "frames": self.frames,
            "drives": self.drives,
            "refused": self.refused,
            "faults": self.faults,
            "frames_a_second": self.rate_hz,
            "solve_us_p50": quantiles[0],
            "solve_us_p99": quantiles[1],
            "link": self.link,
            "board": None if self.board is None else self.board.as_dict(),
        }

    def lines(self) -> list[str]:
        rate = "" if self.rate_hz is None else f", {self.rate_hz:.1f} a second of the board's time"
        link = self.link
        gaps, missing, dropped = (link.get(name, 0) for name in ("gaps", "missing", "dropped"))
        text = f"{self.frames} frames{rate}; {gaps} gaps ({missing} packets missing)"
        text += f", {dropped} dropped here"
        if link.get("lines_skipped"):
            text += f", {link['lines_skipped']} lines skipped"
        if self.board is not None:
            text += f", {self.board.packets_dropped} dropped by the board"
        lines = [text]
        if self.drives:
            lines.append(f"touches were told after {self.drives} drives")
        if self.solve_quantiles_us is not None:
            p50, p99 = self.solve_quantiles_us
            lines.append(
                f"solve and touches on the board: p50 {p50 / 1e3:.2f} ms, p99 {p99 / 1e3:.2f} ms"
            )
        if self.faults:
            lines.append(f"{self.faults} faults were reported")
        if self.refused:
            lines.append(f"{self.refused} frames refused by the board's core")
        return lines


Item = LiveFrame | LiveDrive | Fault | LinkEvent


def follow(
    device: Device, what: Stream, *, every: int = 1, frames: int = 0
) -> Generator[Item, None, None]:
    """``Device.stream``, the packets of each frame put together. A frame is complete when its last
    kind came or another frame begins."""
    return put_together(device.stream(what, every=every, frames=frames), what)


def put_together(
    items: Iterator[Any], what: Stream, clock: "Clock | None" = None
) -> Generator[Item, None, None]:
    """Frames out of a stream's packets, timed by ``clock``; ``items`` is closed with it."""
    try:
        yield from _put_together(items, what, clock or Clock())
    finally:
        if isinstance(items, Generator):
            items.close()


def _put_together(items: Iterator[Any], what: Stream, clock: "Clock") -> Iterator[Item]:
    wanted = bin(what & ~Stream.FOLLOWED).count("1")
    parts: dict[str, Any] = {}
    number: int | None = None
    for item in items:
        if isinstance(item, Fault | LinkEvent):
            yield item
            continue
        if isinstance(item, FollowedTouches):
            board_us = item.head.time_us
            yield LiveDrive(clock.elapsed_us(board_us), board_us, item)
            continue
        kind = _KINDS.get(type(item))
        if kind is None:
            continue
        if item.frame != number or kind in parts:
            if parts:
                yield _frame(clock, parts)
            parts, number = {}, item.frame
        parts[kind] = item
        if len(parts) == wanted:
            yield _frame(clock, parts)
            parts, number = {}, None
    if parts:
        yield _frame(clock, parts)


def replayed(
    device: Device, what: Stream, *, every: int = 1, frames: int = 0
) -> Generator[Item, None, None]:
    """As ``follow``, of a recording: what a live stream would have shown, which is all but the
    quiet frames of tares, timed from the first frame that is none."""
    start: int | None = None
    count = 0
    for item in follow(device, what):
        if isinstance(item, LiveDrive):
            start = item.time_us if start is None else start
            yield replace(item, time_us=item.time_us - start)
        elif not isinstance(item, LiveFrame):
            yield item
        elif item.raw is None or not item.raw.quiet:
            start = item.time_us if start is None else start
            if frames and count >= frames * every:
                return
            if count % every == 0:
                yield replace(item, time_us=item.time_us - start)
            count += 1


_KINDS = {RawFrame: "raw", SolvedImage: "image", SolvedTouches: "touches", FrameEvents: "events"}


class Clock:
    """The board's clock, which wraps after 71 minutes, as one that does not."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._elapsed_us = 0

    def elapsed_us(self, board_us: int) -> int:
        """Since the first time that was asked for; a restarted board goes on from where it was."""
        if self._last is not None:
            step = (board_us - self._last) % WRAP_US
            if step > WRAP_US - LATE_US:  # a frame is told of after drives of the next one
                return self._elapsed_us + step - WRAP_US
            self._elapsed_us += step if step < WRAP_US // 2 else 0
        self._last = board_us
        return self._elapsed_us


def _frame(clock: Clock, parts: dict[str, Any]) -> LiveFrame:
    first = next(iter(parts.values()))
    board_us = (first if isinstance(first, RawFrame | FrameEvents) else first.solved).time_us
    return LiveFrame(first.frame, clock.elapsed_us(board_us), board_us, **parts)


def finish(summary: LiveSummary, device: Device) -> LiveSummary:
    """Add what the link and the board counted; a board that does not answer any more leaves its
    part out."""
    summary.link = device.counters.as_dict()
    if not device.transport.replays and not device.link.ended:
        try:
            summary.board = device.stats()
        except DeviceError:
            summary.board = None
    return summary
