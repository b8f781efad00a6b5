"""Run all sinks of a session, each behind a bounded queue with its own thread: a slow or lost sink
drops and counts messages, and delays nothing else."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin.session.frame import Message
from eitskin.session.message import summary_message
from eitskin.session.robot_session import AnySession
from eitskin.sinks.sink import (
    Dropped,
    OfSkin,
    OutgoingMessage,
    Sink,
    TouchSource,
    without_password,
)

ENTRY_POINT_GROUP = "eitskin.sinks"
ROOM = 64  # frames: more than a second at 48 frames per second
DRIVES = 16  # reports that may wait per frame of ROOM
PATIENCE_S = 2.0
ENDING_S = 3.0  # total for all sinks
# These schemes take all skins of a robot in one sink; others are opened for each skin.
OF_ROBOTS = {"udp", "ws", "csv", "mcap", "ros2", "foxglove"}


def sinks() -> dict[str, EntryPoint]:
    """Return the installed sinks by the scheme of their URLs."""
    return {one.name: one for one in entry_points(group=ENTRY_POINT_GROUP)}


def open_sink(url: str, source: TouchSource) -> Sink:
    """Open the sink that ``url`` names.

    Raises:
        UsageError: its scheme is unknown, or its address cannot be read.
        EitskinError: it cannot be opened.
    """
    scheme, colon, _ = url.partition(":")
    known = sinks()
    if not colon or scheme not in known:
        if scheme in ("http", "https"):
            raise UsageError(
                f"--to {url}: nothing is posted to a web server; programs and pages connect to"
                "  ws://127.0.0.1:9000"
            )
        remedy = nearest(scheme, sorted(known))
        raise UsageError(
            f"--to {url}: {remedy}{' As' if remedy.endswith('?') else ', as'} in"
            " udp://127.0.0.1:9000, tuio://127.0.0.1 or csv:touches.csv"
        )
    opener: Callable[[str, TouchSource], Sink] = known[scheme].load()
    if source.skins and scheme not in OF_ROBOTS:
        return SinkPerSkin(url, source, opener)
    return opener(url, source)


class SinkPerSkin:
    """A sink for each skin of a robot, behind one queue."""

    def __init__(
        self, url: str, source: TouchSource, opener: Callable[[str, TouchSource], Sink]
    ) -> None:
        opened: list[Sink] = []

        def one(skin: TouchSource) -> Sink:
            opened.append(opener(url, skin))
            return opened[-1]

        try:
            self._sinks = OfSkin(source, one)
        except BaseException:
            for sink in opened:
                sink.close()
            raise

    def write(self, outgoing: OutgoingMessage) -> None:
        sink = self._sinks.of(outgoing.message)
        for each in self._sinks.kept.values() if sink is None else (sink,):
            each.write(outgoing)

    def close(self) -> None:
        for sink in self._sinks.kept.values():
            sink.close()


class Outputs:
    """The open sinks of ``urls``.

    With ``patient``, a full queue is waited for, at most 2 s; this suits a board that sends only
    when it is asked and is not paced by a clock. Otherwise items are dropped at once. ``say`` is
    called with a line when a sink fails. ``room`` is the length of each queue in frames.
    """

    def __init__(
        self,
        urls: Sequence[str],
        source: TouchSource,
        *,
        patient: bool = False,
        say: Callable[[str], None] = lambda text: None,
        room: int = ROOM,
    ) -> None:
        self._queues: list[Queue] = []
        self._source = source.source
        self._patience_s = PATIENCE_S if patient else 0.0
        try:
            for url in urls:
                self._queues.append(
                    Queue(url, open_sink(url, source), say, room * len(source.each))
                )
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Outputs":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def put(self, item: Message) -> None:
        outgoing = OutgoingMessage(item)
        for one in self._queues:
            one.put(outgoing, self._patience_s)

    def end(self, facts: dict[str, Any]) -> list[dict[str, Any]]:
        """Give ``facts``, the summary, to every sink, close them all, and return their counts."""
        if self._queues:
            outgoing = OutgoingMessage(summary_message(facts, self._source))
            for one in self._queues:
                one.put(outgoing, self._patience_s)
        self.close()
        return self.counts

    def close(self) -> None:
        """Let each sink send what is still queued, for at most 3 s; may be called twice."""
        for one in self._queues:
            one.begin_end()
        end_s = time.monotonic() + ENDING_S
        for one in self._queues:
            one.end(end_s - time.monotonic())

    @property
    def counts(self) -> list[dict[str, Any]]:
        """For each sink, how many items were sent, dropped and failed, and the last error."""
        return [one.counts for one in self._queues]

    @property
    def lines(self) -> list[str]:
        """The counts as lines of text."""
        return [
            f"{_to(one['url'])} {one['sent']} sent"
            + (f", {one['dropped']} dropped" if one["dropped"] else "")
            + (f", {one['failed']} failed ({one['error']})" if one["failed"] else "")
            for one in self.counts
        ]


@contextmanager
def attached_outputs(
    session: AnySession,
    urls: Sequence[str],
    *,
    overwrite: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[Outputs]:
    """Open the sinks of ``urls``, and attach them to the open ``session``, so that they get every
    message. Raises the errors of ``Outputs``."""
    skins = tuple(_touch_source(session, name, overwrite) for name in session.parts)
    source = skins[0]
    if session.source is None:
        source = TouchSource(session.name, overwrite=overwrite, tare=session.tare, skins=skins)
    with Outputs(urls, source, patient=session.patient, say=say) as outputs:
        session.consumers.append(outputs.put)
        yield outputs


def _touch_source(session: AnySession, part: str, overwrite: bool) -> TouchSource:
    one = session.parts[part]
    return TouchSource(
        url=one.device.transport.url,
        board=one.device.board.board,
        model=None if one.known is None else one.known.model,
        overwrite=overwrite,
        name=one.given_name,
        source=one.source,
        tare=lambda: session.parts[part].tare(),  # of the session under way then
        link=None if one.placement is None else one.placement.link,
    )


def _to(url: str) -> str:
    """How a line about a sink begins; the address of some, such as "ros2:", ends with a colon."""
    return f"to {url.removesuffix(':')}:"


class Queue:
    """The queue and thread of a sink."""

    def __init__(self, url: str, sink: Sink, say: Callable[[str], None], room: int) -> None:
        self._url, self._sink = without_password(url), sink
        self._say, self._room = say, room
        self._waiting: deque[OutgoingMessage] = deque()
        self._reports = 0  # how many of the waiting items are reports
        self._changed = threading.Condition()
        self._ending = self._slow = False
        self._sent = self._dropped = self._failed = 0
        self._error: str | None = None
        self._thread = threading.Thread(target=self._run, name=f"eitskin {self._url}", daemon=True)
        self._thread.start()

    def put(self, outgoing: OutgoingMessage, patience_s: float) -> None:
        """Queue an item, or drop and count it if there is no room within ``patience_s``. A sink
        that made no room in that time is not waited for again until it takes an item."""
        is_report = outgoing.report is not None

        def room() -> bool:
            if is_report:
                return self._reports < DRIVES * self._room
            return len(self._waiting) - self._reports < self._room

        with self._changed:
            if patience_s and not self._slow and not room():
                self._slow = not self._changed.wait_for(room, patience_s)
            if self._ending or not room():
                self._dropped += 1
                return
            self._waiting.append(outgoing)
            self._reports += is_report
            self._changed.notify_all()

    def begin_end(self) -> None:
        """Reject further items."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()

    def end(self, timeout_s: float) -> None:
        """Wait until the queue is empty, then drop and count what is left after ``timeout_s``."""
        self._thread.join(max(timeout_s, 0.0))
        with self._changed:
            self._dropped += len(self._waiting)
            self._waiting.clear()
            self._reports = 0

    @property
    def counts(self) -> dict[str, Any]:
        return {
            "url": self._url,
            "sent": self._sent,
            "dropped": self._dropped,
            "failed": self._failed,
            "error": self._error,
        }

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ending)
                if not self._waiting:
                    break
                outgoing = self._waiting.popleft()
                self._reports -= outgoing.report is not None
                self._slow = False
                self._changed.notify_all()
            try:
                self._sink.write(outgoing)
                self._sent += 1
            except Dropped:
                self._dropped += 1
            except BaseException as error:  # a sink that raises SystemExit is no reason to end
                self._fail(error)
        try:
            self._sink.close()
        except BaseException as error:
            self._fail(error)

    def _fail(self, error: BaseException) -> None:
        """Count an error, and report it unless it is the same as the last one."""
        self._failed += 1
        text = " ".join(str(error).split()) or type(error).__name__
        if text != self._error:
            self._error = text
            self._say(f"{_to(self._url)} {text}")
