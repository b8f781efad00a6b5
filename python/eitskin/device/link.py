"""A transport with its decoder: packets come out, commands go in. With a thread for real boards,
without one for the others."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from eitskin.device.transport import Transport
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import Keepalive, PacketType
from eitskin.device.wire.packets import BoardHashes
from eitskin.device.wire.sequence import LinkCounters
from eitskin.errors import DeviceError, EitskinError

FRAME_PACKETS = frozenset((PacketType.RAW, PacketType.IMAGE, PacketType.TOUCHES, PacketType.EVENTS))
READ_S = 0.1
KEEPALIVE_S = 0.25  # a board lets no current flow where it hears nothing for a second
KEEPALIVE = Keepalive(1).payload(0)


@dataclass(frozen=True)
class LinkEvent:
    """Something happened to the link itself. ``kind``: "gap" (``missing`` packets by their numbers,
    at least), "dropped" (``missing`` left out of the host's queue), "unplugged", "reconnected",
    "restarted" (the board restarted), "skipped" (``missing`` lines of another instrument were no
    frames; without a text it is only counted).
    """

    kind: str
    missing: int = 0
    text: str = ""


@runtime_checkable
class Telling(Protocol):
    """A transport that has events of its own."""

    def take_events(self) -> list[LinkEvent]:
        """Those since the last call."""


@runtime_checkable
class Noted(Protocol):
    """A transport that knows what its board said once."""

    @property
    def hashes(self) -> BoardHashes:
        """Of model and program."""


@runtime_checkable
class Clocked(Protocol):
    """A transport whose board's time passes only while it is read."""

    @property
    def board_s(self) -> float:
        """The board's time."""


Tap = Callable[[Packet], None]


class Link(Protocol):
    """What ``client.Device`` needs of a link."""

    transport: Transport
    counters: LinkCounters
    decoder: Decoder

    def begin_tap(self, begin: Callable[[int], None], tap: Tap) -> None:
        """Call ``begin`` with the last packet's sequence number, then ``tap`` with each packet
        after it, before anyone else gets it. An error of ``tap`` comes out of ``next``."""

    def end_tap(self, tap: Tap) -> None:
        """No more of that; nothing where it was not begun."""

    def next(self, timeout_s: float) -> Packet | LinkEvent | None:
        """The next packet or event; None if there is none within ``timeout_s`` (of the board's time
        where it is synchronous).

        Raises:
            DeviceError: the port is gone for good.
        """

    def send(self, packet_type: int, payload: bytes) -> None:
        """Send one packet.

        Raises:
            DeviceError: the port is gone for good.
        """

    @property
    def ended(self) -> bool:
        """No frame will come again, and nothing is left to fetch."""

    @property
    def away(self) -> bool:
        """The port is gone and is waited for."""

    def close(self) -> None:
        """Stop and let go of the port."""


class PumpedLink:
    """The board runs while it is asked: nothing is queued beyond what one read gave."""

    def __init__(self, transport: Transport) -> None:
        self.transport, self.counters = transport, LinkCounters()
        self.decoder = Decoder(self.counters)
        self._taps: list[Tap] = []
        self._last = 0
        self._ready: deque[Packet] = deque()
        self._events: deque[LinkEvent] = deque()
        self._sequence = 0
        self._heard_s: float | None = None  # when something was sent last, on the board's clock

    def begin_tap(self, begin: Callable[[int], None], tap: Tap) -> None:
        begin(self._last)
        self._taps.append(tap)
        for packet in self._ready:
            tap(packet)

    def end_tap(self, tap: Tap) -> None:
        self._taps = [one for one in self._taps if one != tap]

    def _news(self) -> bool:
        self._events.extend(_told(self.transport, self.counters))
        return bool(self._events)

    def next(self, timeout_s: float) -> Packet | LinkEvent | None:
        if self._events:
            return self._events.popleft()
        while not self._ready:
            data = self._read(timeout_s)
            if self._news():
                return self._events.popleft()
            if not data:
                return None
            for packet in self.decoder.feed(data):
                for tap in self._taps:
                    tap(packet)
                self._ready.append(packet)
        packet = self._ready.popleft()
        self._last = packet.sequence
        return packet

    def _read(self, timeout_s: float) -> bytes:
        """Of a board with a clock of its own in steps, each with a word that we are there."""
        if not isinstance(self.transport, Clocked):
            return self.transport.read(timeout_s)
        end_s = self.transport.board_s + timeout_s
        while True:
            now_s = self.transport.board_s
            if self._heard_s is not None and now_s >= self._heard_s + KEEPALIVE_S:
                self.send(PacketType.KEEPALIVE, KEEPALIVE)
            data = self.transport.read(min(end_s - now_s, KEEPALIVE_S))
            if data or self.transport.board_s >= end_s:
                return data

    def send(self, packet_type: int, payload: bytes) -> None:
        self.transport.write(encode(packet_type, self._sequence, payload))
        self._sequence += 1
        if isinstance(self.transport, Clocked):
            self._heard_s = self.transport.board_s

    @property
    def ended(self) -> bool:
        return not self._ready and self.transport.ended

    @property
    def away(self) -> bool:
        return False

    def close(self) -> None:
        self.transport.close()


def _told(transport: Transport, counters: LinkCounters) -> list[LinkEvent]:
    """What the transport itself has to tell, counted."""
    if not isinstance(transport, Telling):
        return []
    events = transport.take_events()
    counters.lines_skipped += sum(event.missing for event in events if event.kind == "skipped")
    return [event for event in events if event.text]


@dataclass(frozen=True)
class Reconnect:
    """How long a board that was unplugged is waited for: ``tries`` times, ``every_s`` apart."""

    tries: int = 240
    every_s: float = 0.5


class ThreadedLink:
    """A thread empties the port into a queue of ``room`` packets, so that a slow reader never makes
    the port wait: where the queue is full the oldest frame packets are dropped and counted. A port
    that goes is opened again (``Reconnect``).
    """

    def __init__(
        self, transport: Transport, *, room: int = 1024, reconnect: Reconnect | None = None
    ) -> None:
        self.transport, self.counters = transport, LinkCounters()
        self.decoder = Decoder(self.counters)
        self._taps: list[Tap] = []
        self._tapping = threading.Lock()
        self._last = 0
        self._room, self._reconnect = room, reconnect or Reconnect()
        self._queue: deque[Packet | LinkEvent] = deque()
        self._changed = threading.Condition()
        self._stopping = threading.Event()
        self._failed: EitskinError | None = None
        self._away = False
        self._dropped = 0
        self._sequence = 0
        self._sending = threading.Lock()
        self._heard_s: float | None = None  # when something was sent last
        self._thread = threading.Thread(
            target=self._run, name=f"eitskin {transport.name}", daemon=True
        )
        self._thread.start()

    def begin_tap(self, begin: Callable[[int], None], tap: Tap) -> None:
        with self._tapping:
            begin(self._last)
            self._taps.append(tap)

    def end_tap(self, tap: Tap) -> None:
        with self._tapping:
            self._taps = [one for one in self._taps if one != tap]

    def next(self, timeout_s: float) -> Packet | LinkEvent | None:
        end = time.monotonic() + timeout_s
        with self._changed:
            while True:
                if self._dropped:
                    event = LinkEvent(
                        "dropped", self._dropped, "frames came faster than they were fetched"
                    )
                    self._dropped = 0
                    return event
                if self._queue:
                    return self._queue.popleft()
                if self._failed is not None:
                    raise type(self._failed)(str(self._failed))
                rest = end - time.monotonic()
                if rest <= 0:
                    return None
                self._changed.wait(rest)

    def send(self, packet_type: int, payload: bytes) -> None:
        with self._sending:
            self._heard_s = time.monotonic()
            try:
                self.transport.write(encode(packet_type, self._sequence, payload))
            except DeviceError:
                if self._failed is not None:
                    raise
                # else the reader is opening the port again, and whoever sent this sends it again
                # when no answer comes
            self._sequence += 1

    def _keep_alive(self) -> None:
        """A word to the board that we are there, where nothing else has said so."""
        if self._heard_s is None or time.monotonic() < self._heard_s + KEEPALIVE_S:
            return
        if not self._sending.locked():  # else a packet is on its way
            self.send(PacketType.KEEPALIVE, KEEPALIVE)

    @property
    def ended(self) -> bool:
        return self.transport.ended and not self._queue

    @property
    def away(self) -> bool:
        return self._away

    def close(self) -> None:
        self._stopping.set()
        self.transport.close()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._keep_alive()
                data = self.transport.read(READ_S)
                for event in _told(self.transport, self.counters):
                    self._event(event)
                if data:
                    self._put(self.decoder.feed(data))
            except DeviceError as error:
                if self._stopping.is_set() or not self._open_again(error):
                    return
            except EitskinError as error:  # of the tap: a recording that cannot be written
                self._fail(error)
                return

    def _put(self, packets: list[Packet]) -> None:
        for packet in packets:
            with self._tapping:
                self._last = packet.sequence
                for tap in self._taps:
                    tap(packet)
            with self._changed:
                self._make_room()
                self._queue.append(packet)
                self._changed.notify()

    def _make_room(self) -> None:
        if len(self._queue) < self._room:
            return
        for place, item in enumerate(self._queue):
            if isinstance(item, Packet) and item.type in FRAME_PACKETS:
                del self._queue[place]
                self.counters.dropped += 1
                self._dropped += 1
                return
        self._queue.popleft()  # a thousand replies that nobody asked for
        self.counters.dropped += 1
        self._dropped += 1

    def _event(self, event: LinkEvent) -> None:
        with self._changed:
            self._queue.append(event)
            self._changed.notify()

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
