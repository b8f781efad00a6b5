"""The loop behind ``Device.stream``: frames as they come, and what to do when none do."""

from collections.abc import Iterator
from contextlib import suppress

from eitskin.device.exchange import CommandExchange, Streamed
from eitskin.device.link import LinkEvent
from eitskin.device.wire.explain import reply_text
from eitskin.device.wire.link_table import Drive, Stream, StreamCommand
from eitskin.device.wire.packets import (
    FollowedTouches,
    FrameEvents,
    RawFrame,
    SolvedImage,
    SolvedTouches,
)
from eitskin.errors import DeviceError, EitskinError

SILENCES = 3
COMMAND_S = 1.0


class _Progress:
    """Which frames of a stream came, by kind."""

    def __init__(self, what: Stream, frames: int) -> None:
        self.what, self.wanted = what, frames
        self.restarts = 0  # of the board, when it was last told to stream
        self._came = {kind: 0 for kind in Stream if kind & what & ~Stream.FOLLOWED}

    def take(self, item: Streamed) -> bool:
        """Count ``item``; False where it is a frame's of a kind that was not asked for."""
        kind = _KIND.get(type(item))
        if kind is None:
            return True
        if kind is Stream.FOLLOWED:  # of drives, not of frames
            return bool(kind & self.what)
        if kind not in self._came:
            return False
        self._came[kind] += 1
        return True

    @property
    def complete(self) -> bool:
        """Every kind came for every frame that was wanted."""
        return bool(self.wanted) and min(self._came.values(), default=0) >= self.wanted

    @property
    def rest(self) -> int:
        """Frames that are still to come, 0 where there is no limit."""
        return max(self.wanted - max(self._came.values(), default=0), 1) if self.wanted else 0


_KIND: dict[type, Stream] = {
    RawFrame: Stream.RAW,
    SolvedImage: Stream.IMAGE,
    SolvedTouches: Stream.TOUCHES,
    FrameEvents: Stream.EVENTS,
    FollowedTouches: Stream.FOLLOWED,
}


def stream(device: CommandExchange, what: Stream, every: int, frames: int) -> Iterator[Streamed]:
    if device.transport.replays:
        yield from _replay(device, what, every, frames)
        return
    progress = _Progress(what, frames)
    device.drop_kept()
    _start(device, progress, every)
    try:
        silent = 0
        while not progress.complete:
            item = device.next_item(1.0 + 4e-6 * every * max(device.board.frame_us, 1000))
            if item is None:
                if device.link.ended:
                    return
                silent += 1
                if _is_over(device, progress, every, silent):
                    return
                continue
            silent = 0
            if not progress.take(item):
                continue
            yield item
            if isinstance(item, LinkEvent) and item.kind in ("reconnected", "restarted"):
                _resume(device, progress, every)
    finally:
        _stop(device)


def _start(device: CommandExchange, progress: _Progress, every: int) -> None:
    reply = device.send_command(StreamCommand(int(progress.what), every, progress.rest), COMMAND_S)
    if not reply.ok:
        raise DeviceError(f"{device.transport.name}: {reply_text(reply)}")
    progress.restarts = device.counters.restarts


def _stop(device: CommandExchange) -> None:
    """However the stream ended; a board that is gone cannot be stopped, and that is not what went
    wrong."""
    with suppress(EitskinError):
        device.send_command(StreamCommand(0), COMMAND_S)


def _resume(device: CommandExchange, progress: _Progress, every: int) -> None:
    """Go on after the board was away: only if it is the same, with the same model and, for images,
    still with its reference."""
    before = device.board
    now = device.info()
    name = device.transport.name
    if now.serial != before.serial:
        raise DeviceError(
            f"{name}: another board came back ({now.serial} for {before.serial}); start again"
        )
    if now.model_crc != before.model_crc:
        raise DeviceError(f"{name}: the board came back with another model; start again")
    if progress.what & ~Stream.RAW and not now.tared:
        raise DeviceError(
            f"{name}: the board restarted and has no reference frame; leave the skin untouched and"
            " start again"
        )
    _start(device, progress, every)


def _is_over(device: CommandExchange, progress: _Progress, every: int, silent: int) -> bool:
    """Nothing came for a while: whether that is because the board has sent all, found out by asking
    it."""
    before = device.board
    now = device.info()
    if device.keeps:
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
        _resume(device, progress, every)
    elif silent >= SILENCES:
        faults = ", ".join(code.name.lower().replace("_", " ") for code in now.fault_codes)
        raise DeviceError(
            f"{device.transport.name}: the board answers but sends no frame; it reports"
            f" {faults or 'no fault'}: reset it"
        )
    return False


def _replay(device: CommandExchange, what: Stream, every: int, frames: int) -> Iterator[Streamed]:
    """What was recorded, of the kinds asked for."""
    numbers: dict[int, int] = {}
    while True:
        item = device.next_item(0.0)
        if item is None:
            return
        kind = _KIND.get(type(item))
        if kind is None:
            yield item
            continue
        if isinstance(item, FollowedTouches):
            if kind & what:
                yield item
            continue
        assert isinstance(item, (RawFrame, SolvedImage, SolvedTouches, FrameEvents))
        place = numbers.setdefault(item.frame, len(numbers))
        if frames and place >= frames * every:
            return
        if kind & what and place % every == 0:
            yield item
