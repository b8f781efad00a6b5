"""One command and its answer at a time; a command that was lost is sent again. Packets that a board
streams in between stay in the link's queue."""

import random
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import NoReturn, TypeVar

from eitskin.device.check import check_board, no_answer
from eitskin.device.link import (
    ROOM,
    Answer,
    Link,
    PumpedLink,
    Reconnect,
    Streamed,
    Tap,
    ThreadedLink,
)
from eitskin.device.transport import Transport
from eitskin.device.wire.explain import command_name, reply_text
from eitskin.device.wire.layout import Command
from eitskin.device.wire.link_table import GetInfo, Keepalive, PacketType, ReplyStatus
from eitskin.device.wire.packets import BoardHashes, BoardInfo, BoardStats, ProbedBurst, Reply
from eitskin.device.wire.sequence import LinkCounters
from eitskin.errors import DeviceError, EitskinError, UsageError
from eitskin.threads import OneReader, refuse_copy, within

ANSWERED_BY: dict[int, type] = {
    PacketType.GET_INFO: BoardInfo,
    PacketType.GET_STATS: BoardStats,
    PacketType.GET_HASHES: BoardHashes,
    PacketType.PROBE: ProbedBurst,
}

Self = TypeVar("Self", bound="CommandExchange")
T = TypeVar("T")

TRIES = 3
ANSWER_S = 1.0
AWAY_S = 120.0  # that a command waits for a port that is gone
WORD_S = 0.2  # that the last word to a board may take
OTHERS = (
    "a board has one stream: read that one, or share it as a Session's consumers or by  --to udp:"
)


class CommandExchange:
    """A board that was found, whose version fits and that answers. ``board`` is the last
    INFO.

    Commands are sent again with the same request number where no answer comes, so that one lost
    packet does no harm. A board that does not answer ``TRIES`` times has fallen silent.

    Threads may share a device: commands wait for their turn, and each gets its own answer, also
    beside a stream. Frames go to one thread; another one that asks for them is refused.

    Raises:
        DeviceError: no answer, or another version.
    """

    def __init__(
        self, transport: Transport, *, room: int = ROOM, reconnect: Reconnect | None = None
    ) -> None:
        self.link: Link
        pumped = transport.capabilities.own_clock
        if pumped:
            self.link = PumpedLink(transport, room)
        else:
            self.link = ThreadedLink(transport, room, reconnect=reconnect)
        # a board remembers the last request; the numbers of two runs of the host must not meet
        self._request = 0 if pumped else random.randrange(1, 2**31)
        self.asking = threading.RLock()  # held where several commands belong together
        self._tap: Tap | None = None
        self.reader = OneReader(f"the frames of {transport.name}", OTHERS)
        try:
            self.board = self.info()
        except BaseException:
            self.close()
            raise
        self.link.connected = True

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def transport(self) -> Transport:
        return self.link.transport

    @property
    def replays(self) -> bool:
        """Return whether it is a recording, which answers no requests."""
        return self.transport.capabilities.replays

    @property
    def counters(self) -> LinkCounters:
        """The counters of the link so far, including gaps and refused packets."""
        return self.link.counters

    def close(self) -> None:
        """Tell the board to stop its current, and close the port. May be called twice, and from any
        thread. It takes only a moment, even if the port does not respond."""
        if self.link.connected and not self.replays and not self.link.away:
            with suppress(EitskinError):
                self.bounded(WORD_S, self._say_goodbye)
        self.link.connected = False
        self.link.close()

    def _say_goodbye(self) -> None:
        self.link.send(PacketType.KEEPALIVE, Keepalive(0).payload(0))

    def bounded(self, limit_s: float, action: Callable[[], T]) -> T | None:
        """Return the result of ``action``, which talks to the board, or None if it takes longer
        than ``limit_s``. A board with a clock of its own is a part of this program and answers;
        there is no limit."""
        if self.transport.capabilities.own_clock:
            return action()
        return within(limit_s, action)

    def __reduce__(self) -> NoReturn:
        refuse_copy(f"the device {self.transport.name}", "open its URL in the other process")

    def record(self, tap: Tap | None) -> None:
        """Pass each accepted packet to ``tap`` on arrival, before any other use; None stops that. A
        ``Recorder`` also works at the same time."""
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
        if self.replays:
            info = self._recorded_info()
        else:
            answer = self.ask(GetInfo(), ANSWER_S)
            assert isinstance(answer, BoardInfo)
            info = answer
        check_board(info, self.transport.name)
        self.board = info
        return info

    def next_item(self, timeout_s: float) -> Streamed | None:
        """Return the next streamed item; None if nothing comes within ``timeout_s``.

        Raises:
            DeviceError: the port is gone for good.
            UsageError: another thread reads the stream.
        """
        self.reader.check()
        return self.link.next(timeout_s)

    def _recorded_info(self) -> BoardInfo:
        found = self.link.answer(lambda one: isinstance(one, BoardInfo), float("inf"))
        if found is None:
            raise DeviceError(
                f"{self.transport.name}: the recording holds no INFO of its board; it was cut"
                " before it began"
            )
        assert isinstance(found, BoardInfo)
        return found

    def command(self, command: Command, timeout_s: float) -> Reply:
        """Send one command, which the board must accept.

        Raises:
            DeviceError: no answer, or the board refuses.
        """
        answer = self.ask(command, timeout_s)
        assert isinstance(answer, Reply)
        return answer

    def send_command(self, command: Command, timeout_s: float) -> Reply:
        """Send one command, and return the reply, whatever its status is.

        Raises:
            DeviceError: no answer.
        """
        answer = self.ask(command, timeout_s, refuse=False)
        assert isinstance(answer, Reply)
        return answer

    def ask(self, command: Command, timeout_s: float, *, refuse: bool = True) -> Answer:
        """Send one command, and return the answer: a reply, or the requested packet.

        Raises:
            DeviceError: no answer, or, with ``refuse``, the board refuses.
            UsageError: a number does not fit its field.
        """
        if self.replays:
            raise DeviceError(
                f"{self.transport.name} is a recording: {command_name(command.TYPE)} needs a board"
            )
        with self.asking:  # one command at a time; other threads wait for their turn
            return self._ask(command, timeout_s, refuse)

    def _ask(self, command: Command, timeout_s: float, refuse: bool) -> Answer:
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
            self.link.await_port(AWAY_S)
            if self.link.away:
                raise DeviceError(
                    f"{self.transport.name}: the port is gone, and did not come back within"
                    f" {AWAY_S:g} s: plug it in and try again"
                )
            if left == 1:
                self.link.decoder.forget_sequence()
            self.link.send(command.TYPE, payload)
            answer = self.link.answer(lambda one: self._fits(one, command), timeout_s)
            if answer is not None:
                if refuse and isinstance(answer, Reply) and not answer.ok:
                    raise DeviceError(f"{self.transport.name}: {reply_text(answer)}")
                return answer
            left = TRIES if self.link.away else left - 1
        what = command_name(command.TYPE)
        raise DeviceError(no_answer(self.link, before, what, TRIES * timeout_s))

    def _fits(self, answer: Answer, command: Command) -> bool:
        """Return whether this is the answer to ``command``, which was sent last."""
        if answer.request != self._request:
            return False
        if isinstance(answer, Reply):
            expects_more = command.TYPE in ANSWERED_BY and answer.status == ReplyStatus.OK
            return answer.command == command.TYPE and not expects_more
        return isinstance(answer, ANSWERED_BY.get(command.TYPE, ()))
