"""A board's commands with their answers, and what it streams, whatever kind of device is behind
it."""

from __future__ import annotations

import random
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from eitskin.core.results import SIGNS, SOLVERS, Options, check_options
from eitskin.device.check import check_board, no_answer
from eitskin.device.link import Link, LinkEvent, PumpedLink, Reconnect, Tap, ThreadedLink
from eitskin.device.transport import Transport
from eitskin.device.wire import commands
from eitskin.device.wire.codec import LinkCounters, Packet
from eitskin.device.wire.commands import Command
from eitskin.device.wire.explain import command_name, reply_text
from eitskin.device.wire.packets import (
    BoardInfo,
    BoardStats,
    Fault,
    PacketType,
    RawFrame,
    Reply,
    ReplyStatus,
    SolvedImage,
    SolvedTouches,
    Stream,
)
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.errors import DeviceError, UsageError

Answer = Reply | BoardInfo | BoardStats
Streamed = RawFrame | SolvedImage | SolvedTouches | Fault | BoardStats | LinkEvent

TRIES = 3
ANSWER_S = 1.0
INBOX = 1024
TARE_FRAMES = 16


def _asked_millihz(info: BoardInfo) -> int:
    """The excitation that the board was asked for: a whole number of its periods fills a burst.
    INFO tells what the generator makes of it, which is not quite the same."""
    rate_millihz = 1000 * info.sample_rate_hz
    periods = round(info.excitation_millihz * info.samples / rate_millihz)
    return periods * rate_millihz // info.samples


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


class Device:
    """A board that was found, whose version fits and that answers. ``open_device`` makes one from a
    URL.

    Commands are sent again with the same request number where no answer comes, so that one lost
    packet is not noticed; after ``TRIES`` the board is taken to be dead. ``board`` is what INFO
    last said.

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

    def __enter__(self) -> Device:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def transport(self) -> Transport:
        return self.link.transport

    @property
    def counters(self) -> LinkCounters:
        """What came over the link so far, gaps and refused packets included."""
        return self.link.counters

    def close(self) -> None:
        """Let go of the port; may be called twice."""
        self.link.close()

    def record(self, tap: Tap | None) -> None:
        """Give each packet that is accepted to ``tap`` as it comes, before anything else; None
        stops that. A ``Recorder`` goes beside it."""
        if self._tap is not None:
            self.link.end_tap(self._tap)
        self._tap = tap
        if tap is not None:
            self.link.begin_tap(lambda last: None, tap)

    # ---- commands ----

    def info(self) -> BoardInfo:
        """Ask what the board is, which model it has and how it scans.

        Raises:
            DeviceError: no answer, or another version.
        """
        if self.transport.replays:
            info = self._recorded_info()
        else:
            answer = self._ask(commands.GetInfo(), ANSWER_S)
            assert isinstance(answer, BoardInfo)
            info = answer
        check_board(info, self.transport.name)
        self.board = info
        return info

    def stats(self, *, reset: bool = False) -> BoardStats:
        """The board's statistics; ``reset`` begins them anew."""
        answer = self._ask(commands.GetStats(int(reset)), ANSWER_S)
        assert isinstance(answer, BoardStats)
        return answer

    def tare(self, frames: int = TARE_FRAMES) -> None:
        """Take the reference from ``frames`` (1, or 4 to 1024) frames of the untouched skin.

        Raises:
            UsageError: another number of frames.
            DeviceError: the board refuses, or its core the frames.
        """
        if frames != 1 and not 4 <= frames <= 1024:
            raise UsageError(f"a tare of {frames} frames cannot be; use 1, or 4 to 1024")
        self._command(commands.Tare(frames), 3.0 + 2e-6 * self._frame_us * (frames + 4))
        self.board = replace(self.board, tared=1)

    def start_scene(self) -> None:
        """Begin what is to be touched, on a simulated or emulated board; call it after ``tare``.
        Nothing on a real one."""
        self.transport.begin_scene()

    def scan(
        self,
        *,
        excitation_hz: float | None = None,
        sample_rate_hz: int | None = None,
        samples: int | None = None,
        settle_us: int | None = None,
        check_every: int | None = None,
        frame_period_us: int | None = None,
    ) -> BoardInfo:
        """Change how frames are scanned; what is not named stays. The reference is forgotten.

        Raises:
            UsageError: a number is negative or does not fit its field.
            DeviceError: the board cannot do it; it keeps what it had.
        """
        now = self.board
        command = commands.Scan(
            excitation_millihz=(
                _asked_millihz(now) if excitation_hz is None else round(1000 * excitation_hz)
            ),
            sample_rate_hz=now.sample_rate_hz if sample_rate_hz is None else sample_rate_hz,
            samples=now.samples if samples is None else samples,
            settle_us=now.settle_us if settle_us is None else settle_us,
            check_every=now.check_every if check_every is None else check_every,
            reserved=0,
            frame_period_us=now.frame_period_us if frame_period_us is None else frame_period_us,
        )
        self._command(command, 2 * ANSWER_S)
        return self.info()

    def solver(self, options: Options) -> None:
        """Give the board's solver these of ``options``: iterations, max_touches, warm_start, sign,
        lambda_rel, gap_rel, solver, mac_limit, findings, and whether touches are tracked.

        Raises:
            UsageError: one is out of its range.
            DeviceError: the board refuses; it keeps what it had.
        """
        check_options(options)
        self._command(
            commands.Solver(
                options.iterations, options.max_touches, int(options.warm_start),
                SIGNS.index(options.sign),
                options.lambda_rel, options.gap_rel, SOLVERS.index(options.solver),
                options.mac_limit,
                options.findings, int(options.tracks),
            ),
            ANSWER_S,
        )  # fmt: skip

    def mask_row(self, row: int, *, bad: bool = True) -> None:
        """Leave protocol row ``row`` out of every frame, or use it again from the next tare on."""
        self._command(commands.MaskRow(row, int(bad)), ANSWER_S)

    def self_test(self) -> None:
        """Let the board run its model's golden frame.

        Raises:
            DeviceError: the image has other bits than the model states.
        """
        self._command(commands.SelfTest(), 10.0)

    def clear_faults(self) -> None:
        """Forget the faults that the board has raised; those that persist rise again."""
        self._command(commands.ClearFaults(), ANSWER_S)

    def reset(self) -> BoardInfo:
        """Restart the board and wait until it answers; its reference is gone."""
        self._command(commands.Reset(), ANSWER_S)
        self._connected = False  # what it says first is no news
        try:
            return self.info()
        finally:
            self._connected = True

    def upload_model(
        self, model: str | Path | bytes, progress: Callable[[int, int], None] | None = None
    ) -> BoardInfo:
        """Put a model into the board's other bank; the board verifies it, then swaps.
        ``progress(done, total)`` in bytes.

        Raises:
            FileError, ModelError: it cannot be read, or is no model.
            DeviceError: it does not fit the board, or the link broke; the old model stays.
        """
        from eitskin.device.upload import upload

        upload(self, model, progress)
        return self.info()

    # ---- streaming ----

    def stream(
        self, what: Stream = Stream.TOUCHES, *, every: int = 1, frames: int = 0
    ) -> Iterator[Streamed]:
        """``what`` of every ``every``-th frame, ``frames`` of them (0: until the iterator is
        closed), with faults and events of the link between them. Ends when a scene or a recording
        does.

        Raises:
            UsageError: ``what``, ``every`` or ``frames`` cannot be.
            DeviceError: the board refuses (no model, not tared), is gone, or has gone silent.
        """
        if not 0 < what <= 7 or not 1 <= every <= 0xFFFF or not 0 <= frames < 2**32:
            raise UsageError(
                f"stream: what = {int(what)}, every = {every}, frames = {frames} cannot be"
            )
        from eitskin.device.streaming import stream

        return stream(self, what, every, frames)

    # ---- for upload, streaming and recording ----

    @property
    def _frame_us(self) -> int:
        return max(self.board.frame_us, 1000)

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
            self._put(
                LinkEvent(
                    "gap", item.lost, "lost on the way, or dropped by the board for lack of room"
                )
            )
        try:
            content = parse(item.type, item.payload)
        except MalformedPacket:
            self.counters.malformed += 1
            return None
        if isinstance(content, BoardInfo) and content.request == 0:
            if self._connected:
                self._put(LinkEvent("restarted", text="the board began anew"))
            return None
        if isinstance(content, Reply | BoardInfo | BoardStats):
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

    def _command(self, command: Command, timeout_s: float) -> Reply:
        answer = self._ask(command, timeout_s)
        assert isinstance(answer, Reply)
        return answer

    def send_command(self, command: Command, timeout_s: float) -> Reply:
        """One command and the reply to it, whatever its status.

        Raises:
            DeviceError: no answer.
        """
        answer = self._ask(command, timeout_s, refuse=False)
        assert isinstance(answer, Reply)
        return answer

    def _ask(self, command: Command, timeout_s: float, *, refuse: bool = True) -> Answer:
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
        for attempt in range(TRIES):
            if attempt == TRIES - 1:
                self.link.decoder.forget_sequence()
            self.link.send(command.TYPE, payload)
            answer = self._await_answer(command, timeout_s)
            if answer is not None:
                if refuse and isinstance(answer, Reply) and not answer.ok:
                    raise DeviceError(f"{self.transport.name}: {reply_text(answer)}")
                return answer
        raise DeviceError(no_answer(self.link, command_name(command.TYPE), TRIES * timeout_s))

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
                expects_more = (
                    command.TYPE in (PacketType.GET_INFO, PacketType.GET_STATS)
                    and answer.status == ReplyStatus.OK
                )
                if answer.command == command.TYPE and not expects_more:
                    return answer
            elif isinstance(answer, BoardInfo) == (command.TYPE == PacketType.GET_INFO):
                return answer
        return None
