"""A session with all skins of a robot at once.

    a Session per skin, in a thread of its own -> a short queue each -> RobotSession.messages

The thread of a skin places, numbers and times its messages; the one loop of ``messages`` gives them
to the consumers. The core of a frame runs outside Python's lock, so that threads use all cores.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from eitskin.core.gestures import GestureEvent
from eitskin.device.client import TARE_FRAMES
from eitskin.device.link import Reconnect
from eitskin.device.pacing import Pacer, WallClock
from eitskin.device.recordings.recording import Recorder
from eitskin.device.timing import check_speed
from eitskin.errors import DeviceError, EitskinError, FileError, UsageError
from eitskin.kinematics.pose import Pose
from eitskin.robot.description import Robot, RobotSkin, is_robot, looped, open_robot
from eitskin.robot.recorded import begin_folder, skin_file, write_recorded
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.observer import Observer
from eitskin.session.session import Session
from eitskin.session.settings import Say, SessionSettings
from eitskin.session.summary import Summary
from eitskin.threads import OneThreadAtATime

FOR_EVER = Reconnect(tries=2**31, every_s=0.5)
FIRST_WAIT_S, MAX_WAIT_S = 0.5, 30.0  # before a board that failed is opened again
ROOM = 4  # messages of a skin that wait
LOOK_S = 0.25  # how soon a thread that waits for room notices a request to its board
ENDING_S = 5.0  # that the threads of all skins may take to end
MAX_DRIFT = 100e-6  # by which two quartzes differ
Observe: TypeAlias = Callable[[Session], Observer | None]


class HostClock:
    """A board's times by the clock of the host. A message cannot come before it was made: the
    smallest delay so far is taken for none, and rises by ``MAX_DRIFT``, so that it follows a board
    whose clock is slow."""

    def __init__(self) -> None:
        self._offset_us: float | None = None
        self._last_us = 0.0

    def offset_us(self, made_us: int, arrived_us: float) -> float:
        """How much is to be added to the board's times, by a message that was complete at
        ``made_us`` of its clock and came at ``arrived_us`` of the host's."""
        now = arrived_us - made_us
        if self._offset_us is None:
            self._offset_us = now
        risen = self._offset_us + MAX_DRIFT * max(arrived_us - self._last_us, 0.0)
        self._offset_us, self._last_us = min(now, risen), arrived_us
        return self._offset_us


class RobotSkinSession:
    """A skin of a ``RobotSession``: its session and the thread that reads it.

    Attributes:
        session: the one under way; another one after its board was lost.
        summary: what its messages amounted to.
        waiting: messages for the loop, each with a number by which they came.
        over: no more will come.
    """

    def __init__(self, robot: "RobotSession", skin: RobotSkin, index: int) -> None:
        self.skin, self._robot, self._index = skin, robot, index
        self._begun = 0  # sessions that have started
        self._frames = 0
        self.session = self._new_session()
        self.summary = Summary()
        self.waiting: deque[tuple[int, Message]] = deque()
        self.started = self.over = False
        self.room = threading.Condition(robot.lock)
        self.starts_us: int | None = None  # of the stream's, or the recording's, first frame
        self._clock, self._last_s = HostClock(), 0.0
        self._thread = threading.Thread(target=self._run, name=f"eitskin {skin.name}", daemon=True)

    def _new_session(self) -> Session:
        robot, skin, how = self._robot, self.skin, self._robot.settings
        settings = replace(
            how,
            model=how.model if skin.model is None else skin.model,
            name=skin.name,
            link=skin.link,
            pose=skin.pose,
            frames=max(how.frames - self._frames, 1) if how.frames else 0,
            record=None
            if how.record is None
            else skin_file(how.record, skin.name, self._begun + 1),
        )

        def named(say: Say) -> Say:
            return lambda text: say(f"{skin.name}: {text}")

        return Session(
            skin.device, settings, say=named(robot.say), progress=named(robot.progress),
            reconnect=robot.reconnect, observe=robot.observe,
        )  # fmt: skip

    def open(self) -> None:
        try:
            self.session.__enter__()
        except EitskinError as error:
            raise _named(self.skin.name, error) from None

    def begin(self) -> None:
        self._thread.start()

    def record(self, folder: Path, failed: Callable[[FileError], object]) -> None:
        """Record into ``folder`` from the next frame on; to be called in the session's ``ask``."""
        session, file = self.session, skin_file(folder, self.skin.name)
        session.recorder = Recorder(
            file, session.device, session.solver, name=self.skin.name, failed=failed
        )
        self.starts_us = None

    def end_recording(self) -> None:
        """Likewise in ``ask``."""
        recorder, self.session.recorder = self.session.recorder, None
        if recorder is not None:
            recorder.close()

    def join(self, timeout_s: float) -> None:
        if self._thread.ident is not None:
            self._thread.join(max(timeout_s, 0.0))

    # ---- the thread ----

    def _run(self) -> None:
        robot = self._robot
        try:
            self._start(self.session)
            robot.note(self, started=True)
            robot.begun.wait()
            while not robot.stopping.is_set():
                try:
                    self._read()
                    return
                except DeviceError as error:
                    if self.session.timed:
                        raise
                    self._come_back(error)
        except BaseException as error:
            robot.note(self, error=_named(self.skin.name, error))
        finally:
            robot.note(self, over=True)

    def _start(self, session: Session) -> None:
        self.session = session
        if self._robot.stopping.is_set():  # between two sessions
            session.stop()
        session.start()
        self._begun += 1

    def _read(self) -> None:
        messages = self.session.messages()
        try:
            for message in messages:
                self._frames += isinstance(message, Frame)
                if not self._put(self._shared(message)):
                    return
        finally:
            messages.close()

    def _come_back(self, error: DeviceError) -> None:
        """Open a board that failed again and again, less and less often, until it answers or the
        robot's session ends."""
        robot, wait_s, said = self._robot, FIRST_WAIT_S, ""
        while True:
            if str(error) != said:
                said = str(error)
                self._notice(f"link: lost: {said}; opening it again until it answers")
            self.session.close(said)
            if robot.stopping.wait(wait_s):
                return
            wait_s = min(2 * wait_s, MAX_WAIT_S)
            session = self._new_session()
            try:
                session.__enter__()
                self._start(session)
            except DeviceError as other:
                error = other
                continue
            self._clock = HostClock()
            recorded = session.settings.record
            more = "" if recorded is None else f"; its recording goes on in {recorded.name}"
            self._notice(f"link: back: {session.name}{more}")
            return

    def _notice(self, text: str) -> None:
        self._put(Notice("link", text, self._last_s, time.time(), source=self.skin.name))

    def _put(self, message: Message) -> bool:
        """Give ``message`` to the loop, when there is room, or a request waits for the board; False
        once the robot's session ends."""
        robot = self._robot
        with robot.lock:
            while len(self.waiting) >= ROOM and not self.session.asked:
                if robot.stopping.is_set():
                    return False
                self.room.wait(LOOK_S)
            robot.count += 1
            self.waiting.append((robot.count, message))
            robot.arrived.notify()
        return not robot.stopping.is_set()

    def _shared(self, message: Message) -> Message:
        """``message`` by the robot's clock, with ids that no other skin has."""
        if isinstance(message, Notice):
            return replace(message, time_s=self._last_s)
        time_us = self._time_us(message)
        self._last_s = time_us / 1e6
        number, count = self._index, len(self._robot.robot.skins)

        def unique(one: int) -> int:
            return one and (one - 1) * count + number + 1

        if isinstance(message, DriveReport):
            touches = tuple(replace(one, id=unique(one.id)) for one in message.touches)
            packet = replace(message.packet, touches=touches)
            return replace(message, time_us=time_us, packet=packet)
        if self.starts_us is None:
            self.starts_us = time_us

        def renumbered(events: tuple[GestureEvent, ...]) -> tuple[GestureEvent, ...]:
            return tuple(
                replace(one, first_id=unique(one.first_id), second_id=unique(one.second_id))
                for one in events
            )

        board_events = message.board_events
        return replace(
            message,
            time_us=time_us,
            touches=tuple(replace(one, id=unique(one.id)) for one in message.touches),
            events=renumbered(message.events),
            board_events=None if board_events is None else renumbered(board_events),
        )

    def _time_us(self, message: Frame | DriveReport) -> int:
        """When it was, by the robot's clock: simulated scenes begin together, a recording when it
        began; a real board's times come from when its messages come."""
        if self.session.timed:
            return message.time_us + round(1e6 * self.skin.starts_s)
        arrived_us = (time.monotonic_ns() - self._robot.began_ns) / 1e3
        scan_us = self.session.device.board.frame_us if isinstance(message, Frame) else 0
        offset_us = self._clock.offset_us(message.time_us + scan_us, arrived_us)
        return max(round(message.time_us + offset_us), 0)


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
    ``messages`` gives what comes from all of them. A board that is lost later is opened again and
    again while the others go on.

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
        self.say, self.progress, self.observe = say, progress, observe
        self.reconnect = reconnect or FOR_EVER
        self.pacer = Pacer(check_speed(speed, "speed"), clock)
        self.consumers: list[Callable[[Message], None]] = []
        self.lock = threading.Lock()
        self.arrived = threading.Condition(self.lock)
        self.count = 0  # messages that came
        self.stopping, self.begun = threading.Event(), threading.Event()
        self.began_ns = 0  # of the clock that all skins share
        self._starting, self._threads = threading.RLock(), False
        self._error: BaseException | None = None
        self.folder = self.settings.record
        self._skins = [RobotSkinSession(self, one, k) for k, one in enumerate(robot.skins)]

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
        """All skins are simulated, emulated or recorded."""
        return all(one.timed for one in self.parts.values())

    @property
    def replays(self) -> bool:
        """All are recordings."""
        return all(one.replays for one in self.parts.values())

    @property
    def patient(self) -> bool:
        """No clock is kept: whoever takes its messages may take as long as they like."""
        return self.timed and not self.pacer.speed

    @property
    def summary(self) -> RobotSummary:
        return RobotSummary({one.skin.name: one.summary for one in self._skins})

    def facts(self) -> dict[str, Any]:
        """The summary as it is now, for JSON; ``skins`` has that of each."""
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
            with self.lock:
                while not (
                    self._error is not None
                    or self.stopping.is_set()
                    or all(one.started for one in self._skins)
                ):
                    self.arrived.wait(LOOK_S)
        if self._error is not None:
            self.stop()
            raise self._error

    def stop(self) -> None:
        """End after the message that comes next; from any thread."""
        self.stopping.set()
        self.begun.set()
        for skin in self._skins:
            skin.session.stop()
        self.pacer.wake()
        with self.lock:
            self.arrived.notify_all()
            for skin in self._skins:
                skin.room.notify_all()

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
                self.say(str(error))

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
            self.began_ns = time.monotonic_ns()
            self.begun.set()
            while (taken := self._next()) is not None:
                skin, message = taken
                if skin.session.timed and not isinstance(message, Notice):
                    self.pacer.hold(message.time_us)
                skin.summary.add(message)
                for consumer in self.consumers:
                    consumer(message)
                yield message
                if self.stopping.is_set():
                    return
        finally:
            self.stop()
            self._join()
            self._write_recorded()

    def _next(self) -> tuple[RobotSkinSession, Message] | None:
        """The next message; None when all skins are over. A real board's goes first; what is
        simulated or recorded comes in the order of its times, once the next one of each is
        there."""
        with self.lock:
            while not self.stopping.is_set():
                if self._error is not None:
                    raise self._error
                skin = self._first()
                if skin is not None:
                    message = skin.waiting.popleft()[1]
                    skin.room.notify()
                    return skin, message
                if all(one.over for one in self._skins):
                    return None
                self.arrived.wait(LOOK_S)
        return None

    def _first(self) -> RobotSkinSession | None:
        there = [one for one in self._skins if one.waiting]
        now = [one for one in there if _at_once(one)]
        if now:
            return min(now, key=lambda one: one.waiting[0][0])
        if any(one.session.timed and not one.over and not one.waiting for one in self._skins):
            return None
        return min(there, key=_time_us, default=None)

    def note(
        self,
        skin: RobotSkinSession,
        *,
        started: bool = False,
        over: bool = False,
        error: BaseException | None = None,
    ) -> None:
        """Take note that a skin's thread has started, is over or has failed."""
        with self.lock:
            skin.started = skin.started or started
            skin.over = skin.over or over
            if not self.stopping.is_set():
                self._error = self._error or error
            self.arrived.notify_all()

    def _join(self) -> None:
        end_s = time.monotonic() + ENDING_S
        for skin in self._skins:
            skin.join(end_s - time.monotonic())

    def _write_recorded(self) -> None:
        folder, self.folder = self.folder, None
        if folder is not None and self._error is None and folder.is_dir():
            starts_s = {one.skin.name: (one.starts_us or 0) / 1e6 for one in self._skins}
            write_recorded(self.robot, folder, starts_s)


def _at_once(one: RobotSkinSession) -> bool:
    return not one.session.timed or isinstance(one.waiting[0][1], Notice)


def _time_us(one: RobotSkinSession) -> int:
    message = one.waiting[0][1]
    return 0 if isinstance(message, Notice) else message.time_us


def all_of(answers: dict[str, "Future[Any]"]) -> "Future[Any]":
    """The first skin's answer once those of all skins are there, or the first error, with the
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
                answer.set_exception(_named(name, error))
                return
        answer.set_result(next(iter(answers.values())).result())

    for one in answers.values():
        one.add_done_callback(done)
    return answer


def _named(name: str, error: BaseException) -> BaseException:
    """``error`` with the skin's name, if it is one that a user can cause."""
    return type(error)(f"skin {name!r}: {error}") if isinstance(error, EitskinError) else error


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
