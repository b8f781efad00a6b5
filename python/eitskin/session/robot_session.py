"""A session with all skins of a robot at once.

    a Session per skin, in a thread of its own (robot_skin) -> RobotQueue -> RobotSession.messages

The thread of a skin places, numbers and times its messages; the one loop of ``messages`` gives them
to the consumers. The core of a frame runs outside Python's lock, so that threads use all cores.
"""

import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeAlias

from eitskin.device.client import TARE_FRAMES
from eitskin.device.link import Reconnect
from eitskin.device.pacing import Pacer, WallClock
from eitskin.device.timing import check_speed
from eitskin.errors import FileError, UsageError
from eitskin.kinematics.pose import Pose
from eitskin.robot.description import Robot, RobotSkin, is_robot, looped, open_robot
from eitskin.robot.recorded import begin_folder, write_recorded
from eitskin.session.frame import Message, Notice
from eitskin.session.observer import Observer
from eitskin.session.robot_queue import RobotQueue
from eitskin.session.robot_skin import RobotSkinSession, named
from eitskin.session.session import Session
from eitskin.session.settings import Say, SessionSettings
from eitskin.session.summary import Summary
from eitskin.threads import OneThreadAtATime

FOR_EVER = Reconnect(tries=2**31, every_s=0.5)
ROOM = 4  # messages of a skin that wait
DRIVES_ROOM = 40  # the same with reports after drives, of which a frame has 16 and more
ENDING_S = 5.0  # that the threads of all skins may take to end
Observe: TypeAlias = Callable[[Session], Observer | None]


class RobotSummary:
    """The summaries of a robot's skins."""

    def __init__(self, skins: dict[str, Summary]) -> None:
        self.skins = skins

    def _total(self, name: str) -> int:
        return sum(getattr(one, name) for one in self.skins.values())

    @property
    def frames(self) -> int:
        return self._total("frames")

    def as_dict(self) -> dict[str, Any]:
        """The totals; what cannot be added up is None."""
        link: dict[str, int] = {}
        for one in self.skins.values():
            for name, count in one.link.items():
                link[name] = link.get(name, 0) + count
        totals = {name: self._total(name) for name in ("frames", "drives", "refused", "faults")}
        rates = [one.rate_hz for one in self.skins.values() if one.rate_hz is not None]
        unknown = {"solve_us_p50": None, "solve_us_p99": None, "link": link, "board": None}
        return totals | {"frames_a_second": sum(rates) if rates else None} | unknown

    def lines(self) -> list[str]:
        return [f"{name}: {line}" for name, one in self.skins.items() for line in one.lines()]


class RobotSession:
    """All skins of ``robot``, set up and streaming, used as a ``Session``: ``with`` opens every
    board, and one that cannot be opened is an error; ``start`` sets them up side by side;
    ``messages`` yields the messages of all of them. A board that is lost later is opened again
    repeatedly while the others continue.

    Simulated and recorded skins have one clock, and come in its order, at ``speed``. Arguments and
    ``stop``, ``tare`` and ``close`` are as of ``Session``.

    Attributes:
        parts: the session of each skin that is under way, by the skin's name.
        consumers: each gets every message before ``messages`` gives it.
        folder: that is being recorded into; None: none.
    """

    def __init__(
        self,
        robot: Robot,
        settings: SessionSettings | None = None,
        *,
        say: Say = lambda text: None,
        progress: Say = lambda text: None,
        reconnect: Reconnect | None = None,
        speed: float = 0.0,
        clock: WallClock | None = None,
        observe: Observe = lambda session: None,
        url: str = "",
    ) -> None:
        self.robot, self.url = robot, url or robot.name
        self.settings = settings or SessionSettings()
        if self.settings.name is not None:
            raise UsageError(
                f"name {self.settings.name!r}: the robot's file names its skins; leave the name out"
            )
        self._say, self._progress, self._observe = say, progress, observe
        self._reconnect = reconnect or FOR_EVER
        self.pacer = Pacer(check_speed(speed, "speed"), clock)
        self.consumers: list[Callable[[Message], None]] = []
        self._starting, self._threads = threading.RLock(), False
        self.folder = self.settings.record
        room = ROOM if self.settings.report == "frame" else DRIVES_ROOM
        self._queue = RobotQueue(len(robot.skins), room)
        self._skins = [
            RobotSkinSession(one, self._queue, k, self.settings, self._opened)
            for k, one in enumerate(robot.skins)
        ]

    def _opened(self, skin: RobotSkin, settings: SessionSettings) -> Session:
        def prefixed(say: Say) -> Say:
            return lambda text: say(f"{skin.name}: {text}")

        return Session(
            skin.device, settings, say=prefixed(self._say), progress=prefixed(self._progress),
            reconnect=self._reconnect, observe=self._observe,
        )  # fmt: skip

    def __enter__(self) -> "RobotSession":
        try:
            for skin in self._skins:
                skin.open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self, reason: str = "") -> None:
        """Close all boards and recordings. It may be called twice."""
        self.stop()
        self._join()
        for skin in self._skins:
            skin.session.close(reason)

    @property
    def name(self) -> str:
        return self.robot.name

    @property
    def source(self) -> None:
        """The name in messages that are of no skin, such as the summary: none."""
        return None

    @property
    def parts(self) -> dict[str, Session]:
        return {one.skin.name: one.session for one in self._skins}

    @property
    def bases(self) -> dict[str, Pose]:
        """The poses of the skins' links in the robot's frame, with all joints at zero."""
        return {one.name: one.base for one in self.robot.skins}

    @property
    def timed(self) -> bool:
        """Return whether all skins are simulated, emulated or recorded."""
        return all(one.timed for one in self.parts.values())

    @property
    def replays(self) -> bool:
        """Return whether all are recordings."""
        return all(one.replays for one in self.parts.values())

    @property
    def patient(self) -> bool:
        """Return whether no clock is kept, so that the consumer of its messages may take any
        time."""
        return self.timed and not self.pacer.speed

    @property
    def summary(self) -> RobotSummary:
        return RobotSummary({one.skin.name: one.summary for one in self._skins})

    def facts(self) -> dict[str, Any]:
        """Return the present summary, for JSON; ``skins`` has the summary of each skin."""
        skins = {
            name: summary.as_dict() | {"truth": self.parts[name].facts()["truth"]}
            for name, summary in self.summary.skins.items()
        }
        return self.summary.as_dict() | {"truth": None, "skins": skins}

    def finish(self) -> RobotSummary:
        """The summary, with what links and boards counted."""
        for one in self._skins:
            counted = one.session.finish()
            one.summary.link, one.summary.board = counted.link, counted.board
        return self.summary

    def count_links(self) -> None:
        """As of ``Session``."""
        for one in self._skins:
            one.summary.link = one.session.device.counters.as_dict()

    def start(self) -> None:
        """Set up every skin, side by side; once.

        Raises:
            EitskinError: one of them cannot be; its text names the skin.
        """
        with self._starting:
            if self._threads:
                return
            self._threads = True
            if self.settings.record is not None:
                begin_folder(self.robot, self.settings.record)
            for skin in self._skins:
                skin.begin()
            self._queue.wait_started()
        if self._queue.error is not None:
            self.stop()
            raise self._queue.error

    def stop(self) -> None:
        """End after the next message; any thread may call this."""
        self._queue.end()
        for skin in self._skins:
            skin.session.stop()
        self.pacer.wake()

    def tare(self, frames: int = TARE_FRAMES, *, anyway: bool = False) -> "Future[None]":
        """Take the reference of every skin again; the first error is the answer's."""
        parts = self.parts.items()
        return all_of({name: one.tare(frames, anyway=anyway) for name, one in parts})

    def begin_recording(self, folder: Path, failed: Callable[[FileError], object]) -> "Future[Any]":
        """Record every skin into the new ``folder`` from its next frame on; ``failed`` gets the
        error if a file cannot be written any more. A board that is lost is not recorded after
        that.

        Raises:
            FileError: the folder cannot be made.
        """
        begin_folder(self.robot, folder)
        self.folder = folder
        return self._ask_each(lambda skin: skin.record(folder, failed))

    def end_recording(self) -> "Future[Any]":
        """End what ``begin_recording`` began, and say in ``robot.toml`` when each skin began."""
        done = self._ask_each(lambda skin: skin.end_recording())

        def write(_: "Future[Any]") -> None:
            try:
                self._write_recorded()
            except FileError as error:
                self._say(str(error))

        done.add_done_callback(write)
        return done

    def _ask_each(self, action: Callable[[RobotSkinSession], None]) -> "Future[Any]":
        def asked(skin: RobotSkinSession) -> "Future[None]":
            return skin.session.ask(lambda device: action(skin))

        answers = {one.skin.name: asked(one) for one in self._skins}
        self.pacer.wake()
        return all_of(answers)

    def messages(self) -> Generator[Message, None, None]:
        """Yield all skins' messages, until all scenes, recordings or numbers of frames are over."""
        advice = "RobotSession.stop() ends it from any thread"
        return OneThreadAtATime(self._messages(), "the robot's messages", advice)

    def _messages(self) -> Generator[Message, None, None]:
        try:
            self.start()
            self._queue.begin()
            while (taken := self._queue.next()) is not None:
                number, message = taken
                if self._queue.lanes[number].timed and not isinstance(message, Notice):
                    self.pacer.hold(message.time_us)
                self._skins[number].summary.add(message)
                for consumer in self.consumers:
                    consumer(message)
                yield message
                if self._queue.ending.is_set():
                    return
        finally:
            self.stop()
            self._join()
            self._write_recorded()

    def _join(self) -> None:
        end_s = time.monotonic() + ENDING_S
        for skin in self._skins:
            skin.join(end_s - time.monotonic())

    def _write_recorded(self) -> None:
        folder, self.folder = self.folder, None
        if folder is not None and self._queue.error is None and folder.is_dir():
            starts_s = {one.skin.name: (one.starts_us or 0) / 1e6 for one in self._skins}
            write_recorded(self.robot, folder, starts_s)


def all_of(answers: dict[str, "Future[Any]"]) -> "Future[Any]":
    """Return the first skin's answer once all skins have answered, or the first error, with the
    skin's name. It cannot be cancelled."""
    answer: Future[Any] = Future()
    answer.set_running_or_notify_cancel()
    lock, left = threading.Lock(), [len(answers)]

    def done(_: "Future[Any]") -> None:
        with lock:
            left[0] -= 1
            if left[0]:
                return
        for name, one in answers.items():
            error = one.exception()
            if error is not None:
                answer.set_exception(named(name, error))
                return
        answer.set_result(next(iter(answers.values())).result())

    for one in answers.values():
        one.add_done_callback(done)
    return answer


AnySession = Session | RobotSession


def open_session(
    url: str, settings: SessionSettings, *, speed: float = 0.0, **how: Any
) -> AnySession:
    """The session of a device, or of a robot (``robot:FILE``, or a robot file alone); ``how`` as of
    either.

    Raises:
        EitskinError: the robot file cannot be read.
    """
    if not is_robot(url):
        return Session(url, settings, speed=speed, **how)
    robot, timing = open_robot(url)
    speed = speed if timing.speed is None else timing.speed
    robot = looped(robot) if timing.loop else robot
    return RobotSession(robot, settings, speed=speed, url=url, **how)
