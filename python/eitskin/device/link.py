"""A transport with its decoder: packets come out, commands go in.

Everything that a board sends goes through ONE queue. What is streamed waits there until it is
fetched; answers to commands wait beside it, so that a command never fetches a frame. The queue
holds ``room`` items. When it is full, the oldest frame goes, is counted in ``counters.dropped``,
and a ``LinkEvent`` "dropped" says how many are missing before the next item.
"""

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from eitskin.device.transport import LinkEvent, Transport
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import Keepalive, PacketType
from eitskin.device.wire.packets import (
    BoardHashes,
    BoardInfo,
    BoardStats,
    DriveTouches,
    Fault,
    FrameEvents,
    ProbedBurst,
    RawFrame,
    Reply,
    SolvedImage,
    SolvedTouches,
)
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.device.wire.sequence import LinkCounters
from eitskin.errors import DeviceError, EitskinError
from eitskin.threads import FairLock, within

Answer = Reply | BoardInfo | BoardStats | BoardHashes | ProbedBurst
FramePart = RawFrame | SolvedImage | SolvedTouches | FrameEvents
Streamed = FramePart | DriveTouches | Fault | LinkEvent
ROOM = 1024
ANSWERS = 64  # that nobody waits for; older ones are forgotten
USELESS = 10_000  # packets in a row that are neither streamed nor answers
READ_S = 0.1
CLOSE_S = 0.5  # that letting go of a port may take
KEEPALIVE_S = 0.25  # a board switches the current off if it receives nothing for a second
KEEPALIVE = Keepalive(1).payload(0)
PACKET_S = 1e-3  # no packet takes less of a board's own time

Tap = Callable[[Packet], None]


class Link(ABC):
    """The queue, and how packets get into it. Several threads may use it: each answer goes to
    whoever waits for its request. After ``close`` every call raises a DeviceError that says so, in
    whatever thread it waits.

    Attributes:
        connected: the board has answered; from now on an INFO without a request says that it
            restarted.
    """

    def __init__(self, transport: Transport, room: int = ROOM) -> None:
        self.transport, self.counters = transport, LinkCounters()
        self.decoder = Decoder(self.counters)
        self.connected = False
        self._queue: deque[Streamed] = deque()
        self._answers: deque[Answer] = deque(maxlen=ANSWERS)
        self._changed = threading.Condition()
        self._room, self._dropped = room, 0
        self._taps: list[Tap] = []
        self._tapping = threading.Lock()
        self._last = self._sequence = 0
        self._heard_s: float | None = None  # when something was sent last
        self._closed_by: str | None = None  # the name of the thread that closed it

    def begin_tap(self, begin: Callable[[int], None], tap: Tap) -> None:
        """Call ``begin`` with the last packet's sequence number, then ``tap`` with each packet
        after it, before anyone else gets it. An error of ``tap`` comes out of ``next``."""
        with self._tapping:
            begin(self._last)
            self._taps.append(tap)

    def end_tap(self, tap: Tap) -> None:
        """Stop calling ``tap``; nothing happens if it was not begun."""
        with self._tapping:
            self._taps = [one for one in self._taps if one != tap]

    @abstractmethod
    def next(self, timeout_s: float) -> Streamed | None:
        """Return the next item; None if nothing comes within ``timeout_s`` (of the board's time
        if it has its own clock).

        Raises:
            DeviceError: the port is gone for good.
        """

    @abstractmethod
    def answer(self, fits: Callable[[Answer], bool], timeout_s: float) -> Answer | None:
        """The answer that ``fits``; None if it does not come within ``timeout_s``. Raises as
        ``next``."""

    @abstractmethod
    def send(self, packet_type: int, payload: bytes) -> None:
        """Send one packet. Raises as ``next``."""

    @property
    def ended(self) -> bool:
        """Return whether no further frame will come and none is waiting."""
        return self.transport.ended and not self._queue

    @property
    def away(self) -> bool:
        """The port is gone, and is waited for."""
        return False

    def await_port(self, timeout_s: float) -> None:  # noqa: B027 -- most ports are never away
        """Wait while the port is not available, at most ``timeout_s``. Raises as ``next``."""

    @property
    def keeps(self) -> bool:
        """Return whether something waits to be fetched."""
        return bool(self._queue) or self._dropped > 0

    def drop_frames(self) -> None:
        """Drop the frames of a stream that was left; faults and events stay."""
        with self._changed:
            self._queue = deque(one for one in self._queue if isinstance(one, Fault | LinkEvent))

    def begin_scene(self) -> int | None:
        """``Transport.begin_scene``, with no other thread at the port."""
        return self.transport.begin_scene()

    @abstractmethod
    def close(self) -> None:
        """Stop, and close the port, within CLOSE_S whatever the port does."""

    def _note_closed(self) -> None:
        with self._changed:
            self._closed_by = self._closed_by or threading.current_thread().name
            self._changed.notify_all()

    def _refuse_closed(self) -> None:
        if self._closed_by is not None:
            raise DeviceError(
                f"{self.transport.name}: it was closed, in thread {self._closed_by!r}; open it"
                " again"
            )

    # ---- into the queue and out of it ----

    def _route(self, packet: Packet, *, bounded: bool) -> None:
        """Parse ``packet`` into the queue, or beside it if it is an answer."""
        try:
            content = parse(packet.type, packet.payload)
        except MalformedPacket:
            self.counters.malformed += 1
            content = None
        with self._changed:
            if packet.lost:
                why = "lost on the way, or dropped by the board for lack of room"
                self._queue.append(LinkEvent("gap", packet.lost, why))
            if isinstance(content, BoardInfo) and content.request == 0 and self.connected:
                self._queue.append(LinkEvent("restarted", text="the board restarted"))
            elif isinstance(content, Answer):
                self._answers.append(content)
            elif content is not None:
                if bounded:
                    self._make_room()
                self._queue.append(content)
            self._changed.notify_all()

    def _make_room(self) -> None:
        """Drop the oldest frame of a full queue; without frames, the oldest of a thousand items
        that nobody fetched."""
        if len(self._queue) < self._room:
            return
        droppable = FramePart | DriveTouches
        place = next((k for k, one in enumerate(self._queue) if isinstance(one, droppable)), 0)
        del self._queue[place]
        self.counters.dropped += 1
        self._dropped += 1

    def _take_events(self) -> None:
        """Queue the events of the transport itself, and count them."""
        for event in self.transport.take_events():
            if event.kind == "skipped":
                self.counters.lines_skipped += event.missing
            if event.text:
                self._event(event)

    def _event(self, event: LinkEvent) -> None:
        with self._changed:
            self._queue.append(event)
            self._changed.notify_all()

    def _fetch(self) -> Streamed | None:
        """The oldest item, with the condition held."""
        if self._dropped:
            event = LinkEvent("dropped", self._dropped, "frames came faster than they were fetched")
            self._dropped = 0
            return event
        return self._queue.popleft() if self._queue else None

    def _fetch_answer(self, fits: Callable[[Answer], bool]) -> Answer | None:
        """The answer that fits, with the condition held."""
        for place, one in enumerate(self._answers):
            if fits(one):
                del self._answers[place]
                return one
        return None


class PumpedLink(Link):
    """A board with a clock of its own: it runs while it is asked. A reader that is slow only makes
    it wait, so that frames are dropped only while a command waits for its answer."""

    def __init__(self, transport: Transport, room: int = ROOM) -> None:
        super().__init__(transport, room)
        self._pumping = FairLock()  # of one read, so that others get their turn
        self._decoded: deque[Packet] = deque()  # of one read, not in the queue yet

    def begin_tap(self, begin: Callable[[int], None], tap: Tap) -> None:
        with self._pumping:
            super().begin_tap(begin, tap)
            for packet in self._decoded:
                tap(packet)

    @property
    def ended(self) -> bool:
        return super().ended and not self._decoded

    def next(self, timeout_s: float) -> Streamed | None:
        useless = 0
        while True:
            with self._pumping:
                self._refuse_closed()
                with self._changed:
                    item = self._fetch()
                if item is not None:
                    return item
                if useless > USELESS:
                    raise DeviceError(
                        f"{self.transport.name}: ten thousand packets and none of use; is it an"
                        " eitskin board?"
                    )
                count = self._pump(timeout_s, bounded=False)
                if count is None and not self.keeps:
                    return None
                useless += count or 0

    def answer(self, fits: Callable[[Answer], bool], timeout_s: float) -> Answer | None:
        """As ``Link.answer``. Each packet uses up a part of ``timeout_s``, so that a board which
        sends packets but no answer is given up, too."""
        rest_s = timeout_s - PACKET_S
        while True:
            with self._pumping:
                self._refuse_closed()
                with self._changed:
                    found = self._fetch_answer(fits)
                if found is not None:
                    return found
                if rest_s <= 0:
                    return None
                count = self._pump(rest_s, bounded=not self.transport.capabilities.replays)
                if count is None:
                    return None
                rest_s -= PACKET_S * count

    def _pump(self, timeout_s: float, *, bounded: bool) -> int | None:
        """Queue one packet; read first if none is left. Returns 1, or 0 if a read completed no
        packet, or None if no byte came."""
        if not self._decoded:
            data = self._read(timeout_s)
            self._take_events()
            if not data:
                return None
            for packet in self.decoder.feed(data):
                for tap in self._taps:
                    tap(packet)
                self._decoded.append(packet)
        if not self._decoded:
            return 0
        packet = self._decoded.popleft()
        self._last = packet.sequence
        self._route(packet, bounded=bounded)
        return 1

    def _read(self, timeout_s: float) -> bytes:
        """Read a board that misses a silent host in steps, and send a keepalive in each."""
        now_s = self.transport.board_s
        if now_s is None:
            return self.transport.read(timeout_s)
        end_s = now_s + timeout_s
        while True:
            if self._heard_s is not None and now_s >= self._heard_s + KEEPALIVE_S:
                self.send(PacketType.KEEPALIVE, KEEPALIVE)
            data = self.transport.read(min(end_s - now_s, KEEPALIVE_S))
            now_s = self.transport.board_s or 0.0
            if data or now_s >= end_s:
                return data

    def send(self, packet_type: int, payload: bytes) -> None:
        with self._pumping:
            self._refuse_closed()
            self.transport.write(encode(packet_type, self._sequence, payload))
            self._sequence += 1
            self._heard_s = self.transport.board_s

    def begin_scene(self) -> int | None:
        with self._pumping:
            return super().begin_scene()

    def close(self) -> None:
        self._note_closed()
        alone = self._pumping.acquire(CLOSE_S)  # else the other thread's read fails
        try:
            self.transport.close()
        finally:
            if alone:
                self._pumping.release()


@dataclass(frozen=True)
class Reconnect:
    """The attempts to find a board that was unplugged: ``tries`` of them, one every ``every_s``."""

    tries: int = 240
    every_s: float = 0.5


class ThreadedLink(Link):
    """A real board. A thread owns the port: it alone reads it, empties it into the queue, so that a
    slow reader never makes the port wait, and opens a port that has gone again (``Reconnect``).
    """

    def __init__(
        self, transport: Transport, room: int = ROOM, *, reconnect: Reconnect | None = None
    ) -> None:
        super().__init__(transport, room)
        self._reconnect = reconnect or Reconnect()
        self._stopping = threading.Event()
        self._failed: EitskinError | None = None
        self._away = False
        self._sending = threading.Lock()
        self._thread = threading.Thread(
            target=self._run, name=f"eitskin {transport.name}", daemon=True
        )
        self._thread.start()

    def next(self, timeout_s: float) -> Streamed | None:
        with self._changed:
            self._await(lambda: self.keeps, timeout_s)
            return self._fetch()

    def answer(self, fits: Callable[[Answer], bool], timeout_s: float) -> Answer | None:
        with self._changed:
            self._await(lambda: any(map(fits, self._answers)), timeout_s)
            return self._fetch_answer(fits)

    def _await(self, ready: Callable[[], bool], timeout_s: float) -> None:
        """Wait until ``ready``, with the condition held. Raises as ``next``."""
        done = self._changed.wait_for(lambda: ready() or self._over, timeout_s)
        if done and not ready():
            self._raise_failed()

    @property
    def _over(self) -> bool:
        """Return whether nothing will come any more."""
        return self._failed is not None or self._closed_by is not None

    def _raise_failed(self) -> None:
        self._refuse_closed()
        if self._failed is not None:
            raise type(self._failed)(str(self._failed))

    def send(self, packet_type: int, payload: bytes) -> None:
        with self._sending:
            self._heard_s = time.monotonic()
            try:
                self.transport.write(encode(packet_type, self._sequence, payload))
            except DeviceError:
                if self._failed is not None:
                    raise
                # else the thread is opening the port again, and whoever sent this sends it again
                # when no answer comes
            self._sequence += 1

    def _keep_alive(self) -> None:
        """Send a keepalive where nothing else was sent for a while."""
        if self._heard_s is None or time.monotonic() < self._heard_s + KEEPALIVE_S:
            return
        if not self._sending.locked():  # else a packet is on its way
            self.send(PacketType.KEEPALIVE, KEEPALIVE)

    @property
    def away(self) -> bool:
        return self._away

    def await_port(self, timeout_s: float) -> None:
        with self._changed:
            self._changed.wait_for(lambda: not self._away or self._over, timeout_s)
            self._raise_failed()

    def close(self) -> None:
        self._note_closed()
        self._stopping.set()
        within(CLOSE_S, self._let_go)

    def _let_go(self) -> None:
        self.transport.close()
        self._thread.join(timeout=CLOSE_S)

    # ---- the thread ----

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._keep_alive()
                data = self.transport.read(READ_S)
                self._take_events()
                for packet in self.decoder.feed(data):
                    with self._tapping:
                        self._last = packet.sequence
                        for tap in self._taps:
                            tap(packet)
                    self._route(packet, bounded=True)
            except DeviceError as error:
                if self._stopping.is_set() or not self._open_again(error):
                    return
            except EitskinError as error:  # of the tap: a recording that cannot be written
                self._fail(error)
                return

    def _fail(self, error: EitskinError) -> None:
        with self._changed:
            self._failed = error
            self._changed.notify_all()

    def _open_again(self, error: DeviceError) -> bool:
        self._away = True
        self._event(LinkEvent("unplugged", text=str(error)))
        for _ in range(self._reconnect.tries):
            if self._stopping.wait(self._reconnect.every_s):
                return False
            try:
                there = self.transport.reopen()
            except DeviceError as other:
                error = other
                continue  # a port that has just come may not be opened at once
            if there:
                self.decoder.link_lost()
                self.counters.reconnects += 1
                self._away = False
                self._event(LinkEvent("reconnected", text=self.transport.name))
                return True
        waited = self._reconnect.tries * self._reconnect.every_s
        self._fail(
            DeviceError(
                f"{error}; it did not come back within {waited:g} s: plug it in and start again"
            )
        )
        return False
