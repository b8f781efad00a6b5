"""One command and its answer at a time, sent again where it was lost; what a board streams between
is kept."""

import random
import time
from collections import deque
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from eitskin.device.check import check_board, no_answer
from eitskin.device.link import Link, LinkEvent, PumpedLink, Reconnect, Tap, ThreadedLink
from eitskin.device.transport import Transport
from eitskin.device.wire.codec import Packet
from eitskin.device.wire.explain import command_name, reply_text
from eitskin.device.wire.layout import Command
from eitskin.device.wire.link_table import GetInfo, Keepalive, PacketType, ReplyStatus
from eitskin.device.wire.packets import (
    BoardHashes,
    BoardInfo,
    BoardStats,
    Fault,
    FollowedTouches,
    FrameEvents,
    RawFrame,
    Reply,
    SolvedImage,
    SolvedTouches,
)
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.device.wire.sequence import LinkCounters
from eitskin.errors import DeviceError, EitskinError, UsageError

Answer = Reply | BoardInfo | BoardStats | BoardHashes
ANSWERED_BY: dict[int, type] = {
    PacketType.GET_INFO: BoardInfo,
    PacketType.GET_STATS: BoardStats,
    PacketType.GET_HASHES: BoardHashes,
}
Streamed = (
    RawFrame
    | SolvedImage
    | SolvedTouches
    | FollowedTouches
    | FrameEvents
    | Fault
    | BoardStats
    | LinkEvent
)

Self = TypeVar("Self", bound="CommandExchange")

TRIES = 3
ANSWER_S = 1.0
AWAY_S = 0.2
INBOX = 1024


class Deadline:
    """Counts down ``timeout_s`` by the host's clock; where the board runs only while it is asked,
    by what it sends: no packet takes less than a millisecond there, so that a board that talks
    without answering is given up too.
    """

    def __init__(self, synchronous: bool, timeout_s: float) -> None:
        self._end = None if synchronous else time.monotonic() + timeout_s
        self._rest_s = timeout_s

    def rest_s(self) -> float:
        """Seconds left; call it once for each packet."""
        if self._end is not None:
            return self._end - time.monotonic()
        self._rest_s -= 1e-3
        return self._rest_s


class CommandExchange:
    """A board that was found, whose version fits and that answers. ``board`` is what INFO last
    said.

    Commands are sent again with the same request number where no answer comes, so that one lost
    packet is not noticed; after ``TRIES`` the board is taken to be dead.

    Raises:
        DeviceError: no answer, or another version.
    """

    def __init__(
        self, transport: Transport, *, room: int = 1024, reconnect: Reconnect | None = None
    ) -> None:
        self.link: Link
        if transport.synchronous:
            self.link = PumpedLink(transport)
        else:
            self.link = ThreadedLink(transport, room=room, reconnect=reconnect)
        # a board remembers the last request; the numbers of two runs of the host must not meet
        self._request = 0 if transport.synchronous else random.randrange(1, 2**31)
        self._inbox: deque[Streamed] = deque()
        self._connected = False
        self._tap: Tap | None = None
        try:
            self.board = self.info()
        except BaseException:
            self.close()
            raise
        self._connected = True

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def transport(self) -> Transport:
        return self.link.transport

    @property
    def counters(self) -> LinkCounters:
        """What came over the link so far, gaps and refused packets included."""
        return self.link.counters

    def close(self) -> None:
        """Let go of the port, after a word to the board, whose current stops; may be called
        twice."""
        if self._connected and not self.transport.replays and not self.link.away:
            with suppress(EitskinError):
                self.link.send(PacketType.KEEPALIVE, Keepalive(0).payload(0))
        self._connected = False
        self.link.close()

    def record(self, tap: Tap | None) -> None:
        """Give each packet that is accepted to ``tap`` as it comes, before anything else; None
        stops that. A ``Recorder`` goes beside it."""
        if self._tap is not None:
            self.link.end_tap(self._tap)
        self._tap = tap
        if tap is not None:
            self.link.begin_tap(lambda last: None, tap)

    def info(self) -> BoardInfo:
        """Ask what the board is, which model it has and how it scans.

        Raises:
            DeviceError: no answer, or another version.
        """
        if self.transport.replays:
            info = self._recorded_info()
        else:
            answer = self.ask(GetInfo(), ANSWER_S)
            assert isinstance(answer, BoardInfo)
            info = answer
        check_board(info, self.transport.name)
        self.board = info
        return info

    def next_item(self, timeout_s: float) -> Streamed | None:
        """What comes next, kept back or from the link; None if nothing does within ``timeout_s``.
        Replies are passed over."""
        if self._inbox:
            return self._inbox.popleft()
        for _ in range(10_000):
            item = self.link.next(timeout_s)
            if item is None:
                return None
            self._keep(item)
            if self._inbox:
                return self._inbox.popleft()
        raise DeviceError(
            f"{self.transport.name}: ten thousand packets and none of use; is it an eitskin board?"
        )

    @property
    def keeps(self) -> bool:
        """Something came while a command waited for its answer, and was not fetched yet."""
        return bool(self._inbox)

    def drop_kept(self) -> None:
        """Forget the frames that came while commands waited for their answers; faults and events
        stay."""
        self._inbox = deque(item for item in self._inbox if isinstance(item, Fault | LinkEvent))

    def _keep(self, item: Packet | LinkEvent) -> Answer | None:
        """Keep what is for a stream's reader; return answers to commands."""
        if isinstance(item, LinkEvent):
            self._put(item)
            return None
        if item.lost:
            why = "lost on the way, or dropped by the board for lack of room"
            self._put(LinkEvent("gap", item.lost, why))
        try:
            content = parse(item.type, item.payload)
        except MalformedPacket:
            self.counters.malformed += 1
            return None
        if isinstance(content, BoardInfo) and content.request == 0:
            if self._connected:
                self._put(LinkEvent("restarted", text="the board restarted"))
            return None
        if isinstance(content, Answer):
            return content
        if content is not None:
            self._put(content)
        return None

    def _put(self, item: Streamed) -> None:
        if len(self._inbox) >= INBOX:
            self._inbox.popleft()
            self.counters.dropped += 1
        self._inbox.append(item)

    def _recorded_info(self) -> BoardInfo:
        while (item := self.link.next(0.0)) is not None:
            if isinstance(item, Packet) and item.type == PacketType.INFO:
                content = parse(item.type, item.payload)
                assert isinstance(content, BoardInfo)
                return content
            self._keep(item)
        raise DeviceError(
            f"{self.transport.name}: the recording holds no INFO of its board; it was cut before it"
            " began"
        )

    def command(self, command: Command, timeout_s: float) -> Reply:
        """One command that the board must take.

        Raises:
            DeviceError: no answer, or the board refuses.
        """
        answer = self.ask(command, timeout_s)
        assert isinstance(answer, Reply)
        return answer

    def send_command(self, command: Command, timeout_s: float) -> Reply:
        """One command and the reply to it, whatever its status.

        Raises:
            DeviceError: no answer.
        """
        answer = self.ask(command, timeout_s, refuse=False)
        assert isinstance(answer, Reply)
        return answer

    def ask(self, command: Command, timeout_s: float, *, refuse: bool = True) -> Answer:
        """One command and the answer to it: a reply, or the packet that was asked for.

        Raises:
            DeviceError: no answer, or, with ``refuse``, the board refuses.
            UsageError: a number does not fit its field.
        """
        if self.transport.replays:
            raise DeviceError(
                f"{self.transport.name} is a recording: {command_name(command.TYPE)} needs a board"
            )
        self._request = self._request % (2**32 - 1) + 1
        try:
            payload = command.payload(self._request)
        except Exception as error:
            raise UsageError(
                f"{command_name(command.TYPE)}: a number does not fit its field ({error})"
            ) from None
        before = replace(self.counters)
        left = TRIES
        while left:
            self._await_port()
            if left == 1:
                self.link.decoder.forget_sequence()
            self.link.send(command.TYPE, payload)
            answer = self._await_answer(command, timeout_s)
            if answer is not None:
                if refuse and isinstance(answer, Reply) and not answer.ok:
                    raise DeviceError(f"{self.transport.name}: {reply_text(answer)}")
                return answer
            left = TRIES if self.link.away else left - 1
        what = command_name(command.TYPE)
        raise DeviceError(no_answer(self.link, before, what, TRIES * timeout_s))

    def _await_port(self) -> None:
        """Wait while the port is gone.

        Raises:
            DeviceError: it is gone for good.
        """
        while self.link.away:
            item = self.link.next(AWAY_S)
            if item is not None:
                self._keep(item)

    def _await_answer(self, command: Command, timeout_s: float) -> Answer | None:
        deadline = Deadline(self.transport.synchronous, timeout_s)
        while (rest := deadline.rest_s()) > 0:
            item = self.link.next(rest)
            if item is None:
                return None
            answer = self._keep(item)
            if answer is None or answer.request != self._request:
                continue
            if isinstance(answer, Reply):
                expects_more = command.TYPE in ANSWERED_BY and answer.status == ReplyStatus.OK
                if answer.command == command.TYPE and not expects_more:
                    return answer
            elif isinstance(answer, ANSWERED_BY.get(command.TYPE, ())):
                return answer
        return None
