"""The packets of a stream: started, resumed after the board was away, and stopped.
``Device.stream`` and a session read them packet by packet."""

import time
from typing import Protocol

from eitskin.device.exchange import AWAY_S, CommandExchange
from eitskin.device.link import FramePart, Streamed
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.explain import reply_text
from eitskin.device.wire.link_table import Drive, Stream, StreamCommand
from eitskin.device.wire.packets import (
    DriveTouches,
    FrameEvents,
    RawFrame,
    SolvedImage,
    SolvedTouches,
)
from eitskin.errors import DeviceError, EitskinError

SILENCES = 3
COMMAND_S = 1.0
STOP_S = 3.5  # that a board may take to stop
LEAVE_S = 0.5  # as much where somebody waits at the terminal for the program to end


class PacketStream(Protocol):
    """Packets and events as they come.

    Attributes:
        over: nothing will come any more.
    """

    over: bool

    def next(self, tick_s: float | None) -> Streamed | None:
        """The next packet or event. None if nothing came for a while, for ``tick_s`` at most (None:
        as long as a silence may last), or the stream is over.

        Raises:
            DeviceError: the board refuses (no model, not tared), is gone, or has gone silent.
        """

    def stop(self, limit_s: float = STOP_S) -> bool:
        """Tell the board to stop, and let others read; False if it does not answer within
        ``limit_s``, which is not an error. May be called twice."""


def packet_stream(device: CommandExchange, what: Stream, every: int, frames: int) -> PacketStream:
    """``what`` of every ``every``-th frame, ``frames`` of them (0: until it is stopped). The first
    ``next`` starts it."""
    if device.replays:
        return RecordedPackets(device, what, every, frames)
    return BoardPackets(device, what, every, frames)


class _Progress:
    """The frames of a stream that have come, by kind."""

    def __init__(self, what: Stream, frames: int) -> None:
        self.what, self.wanted = what, frames
        self.restarts = 0  # of the board, when it last began to stream
        self._came = {kind: 0 for kind in Stream if kind & what & ~Stream.DRIVE_TOUCHES}

    def take(self, item: Streamed) -> bool:
        """Count ``item``; False if it is a frame's of a kind that was not asked for."""
        kind = _KIND.get(type(item))
        if kind is None:
            return True
        if kind is Stream.DRIVE_TOUCHES:  # of drives, not of frames
            return bool(kind & self.what)
        if kind not in self._came:
            return False
        self._came[kind] += 1
        return True

    @property
    def complete(self) -> bool:
        """Return whether every kind has come for every requested frame."""
        return bool(self.wanted) and min(self._came.values(), default=0) >= self.wanted

    @property
    def rest(self) -> int:
        """The number of frames that are still to come; 0: there is no limit."""
        return max(self.wanted - max(self._came.values(), default=0), 1) if self.wanted else 0


_KIND: dict[type, Stream] = {
    RawFrame: Stream.RAW,
    SolvedImage: Stream.IMAGE,
    SolvedTouches: Stream.TOUCHES,
    FrameEvents: Stream.EVENTS,
    DriveTouches: Stream.DRIVE_TOUCHES,
}


class BoardPackets:
    """The stream of a board."""

    def __init__(self, device: CommandExchange, what: Stream, every: int, frames: int) -> None:
        self._device, self._every = device, every
        self._progress = _Progress(what, frames)
        self._started = self._resuming = False
        self._silences, self._waited_s = 0, 0.0
        self.over = False

    def next(self, tick_s: float | None) -> Streamed | None:
        device = self._device
        if self._started:
            device.reader.go_on(self)
        else:
            device.reader.begin(self)
            if device.link.away:
                device.link.await_port(AWAY_S if tick_s is None else tick_s)
                return None
            device.link.drop_frames()  # of the stream before
            self._started = True
            self._start()
        if self._resuming:
            self._resuming = False
            self._resume()
        if self._progress.complete:
            self.over = True
            return None
        item = self._fetch(tick_s)
        if item is None:
            return None
        self._silences, self._waited_s = 0, 0.0
        if not self._progress.take(item):
            return None
        self._resuming = isinstance(item, LinkEvent) and item.kind in ("reconnected", "restarted")
        return item

    def _fetch(self, tick_s: float | None) -> Streamed | None:
        """The next item; where none comes for longer than a few frames take, find out why."""
        device = self._device
        patience_s = 1.0 + 4e-6 * self._every * max(device.board.frame_us, 1000)
        if tick_s is None or device.transport.capabilities.own_clock:
            item = device.next_item(patience_s)
            self._waited_s = patience_s
        else:
            began = time.monotonic()
            item = device.next_item(min(tick_s, max(patience_s - self._waited_s, 0.0)))
            self._waited_s += time.monotonic() - began
        if item is not None or self._waited_s < patience_s:
            return item
        self._waited_s = 0.0
        if device.link.ended:
            self.over = True
        elif not device.link.away:  # else its port is waited for
            self._silences += 1
            self.over = self._is_over()
        return None

    def stop(self, limit_s: float = STOP_S) -> bool:
        """A stream that another one of this thread took the place of is the board's no more."""
        ours, started = self._device.reader.end(self), self._started
        self._started, self.over = False, True
        if not ours or not started:
            return True
        if self._device.link.away:
            return False
        return self._device.bounded(limit_s, self._stop_board) is True

    def _stop_board(self) -> bool:
        try:
            self._device.send_command(StreamCommand(0), COMMAND_S)
        except EitskinError:
            return False
        return True

    def _start(self) -> None:
        device, progress = self._device, self._progress
        command = StreamCommand(int(progress.what), self._every, progress.rest)
        reply = device.send_command(command, COMMAND_S)
        if not reply.ok:
            raise DeviceError(f"{device.transport.name}: {reply_text(reply)}")
        progress.restarts = device.counters.restarts

    def _resume(self) -> None:
        """Continue after the board was unplugged, but only if it is the same board, with the same
        model and, for images, still with its reference."""
        device, what = self._device, self._progress.what
        before = device.board
        now = device.info()
        name = device.transport.name
        if now.serial != before.serial:
            raise DeviceError(
                f"{name}: another board came back ({now.serial} for {before.serial}); start again"
            )
        if now.model_crc != before.model_crc:
            raise DeviceError(f"{name}: the board came back with another model; start again")
        if what & ~Stream.RAW and not now.tared:
            raise DeviceError(
                f"{name}: the board restarted and has no reference frame; leave the skin untouched"
                " and start again"
            )
        self._start()

    def _is_over(self) -> bool:
        """After a while without packets: ask the board whether it has sent everything."""
        device, progress = self._device, self._progress
        before = device.board
        now = device.info()
        if device.link.keeps:
            return False  # it came while INFO was waited for
        if device.link.ended:
            return True
        if now.streaming == 0:
            same = (
                now.serial == before.serial
                and now.tared == before.tared
                and device.counters.restarts == progress.restarts
            )
            if progress.wanted and same and now.drive == Drive.ON:
                return True  # it has sent all that was asked for, and some of it was lost
            self._resume()
        elif self._silences >= SILENCES:
            if device.transport.capabilities.instrument:
                raise DeviceError(
                    f"{device.transport.name}: the instrument sends no frame any more; see whether"
                    " it still sends lines of its layout, and check its cable and power"
                )
            faults = ", ".join(code.name.lower().replace("_", " ") for code in now.fault_codes)
            raise DeviceError(
                f"{device.transport.name}: the board answers but sends no frame; it reports"
                f" {faults or 'no fault'}: reset it"
            )
        return False


class RecordedPackets:
    """The recorded packets of the kinds that were asked for."""

    def __init__(self, device: CommandExchange, what: Stream, every: int, frames: int) -> None:
        self._device, self._what = device, what
        self._every, self._frames = every, frames
        self._places: dict[int, int] = {}  # of each frame's number
        self.over = self._begun = False

    def next(self, tick_s: float | None) -> Streamed | None:
        if self._begun:
            self._device.reader.go_on(self)
        else:
            self._device.reader.begin(self)
            self._begun = True
        item = self._device.next_item(0.0)
        if item is None:
            self.over = True
            return None
        if isinstance(item, DriveTouches):
            return item if self._what & Stream.DRIVE_TOUCHES else None
        if not isinstance(item, FramePart):
            return item
        place = self._places.setdefault(item.frame, len(self._places))
        if self._frames and place >= self._frames * self._every:
            self.over = True
            return None
        wanted = _KIND[type(item)] & self._what and place % self._every == 0
        return item if wanted else None

    def stop(self, limit_s: float = STOP_S) -> bool:
        self._device.reader.end(self)
        return True  # a recording needs no word
