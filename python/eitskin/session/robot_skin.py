"""A skin of a robot: its session in a thread of its own, which places, numbers and times its
messages, and opens its board again when it is lost."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from eitskin.core.gestures import GestureEvent
from eitskin.device.recordings.recording import Recorder
from eitskin.errors import DeviceError, EitskinError, FileError
from eitskin.robot.description import RobotSkin
from eitskin.robot.recorded import skin_file
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.robot_queue import RobotQueue
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.session.summary import Summary

FIRST_WAIT_S, MAX_WAIT_S = 0.5, 30.0  # before a board that failed is opened again
MAX_DRIFT = 100e-6  # by which two quartzes differ


class HostClock:
    """Converts a board's times to the clock of the host. A message cannot come before it was made:
    the smallest delay so far counts as zero. It rises by ``MAX_DRIFT``, so that it follows a board
    with a slow clock."""

    def __init__(self) -> None:
        self._offset_us: float | None = None
        self._last_us = 0.0

    def offset_us(self, made_us: int, arrived_us: float) -> float:
        """Return the number to add to the board's times, by a message that was complete at
        ``made_us`` on its clock and arrived at ``arrived_us`` on the host's."""
        now = arrived_us - made_us
        if self._offset_us is None:
            self._offset_us = now
        risen = self._offset_us + MAX_DRIFT * max(arrived_us - self._last_us, 0.0)
        self._offset_us, self._last_us = min(now, risen), arrived_us
        return self._offset_us


class RobotSkinSession:
    """A skin of a robot: its session, and the thread that puts its messages into lane ``number`` of
    ``queue``. ``opened`` makes its session from its settings, which are ``settings`` plus those of
    this skin alone.

    Attributes:
        session: the one under way; another one after its board was lost.
        summary: what its messages amounted to.
        starts_us: when the stream's, or the recording's, first frame came; None: none has.
    """

    def __init__(
        self,
        skin: RobotSkin,
        queue: RobotQueue,
        number: int,
        settings: SessionSettings,
        opened: Callable[[RobotSkin, SessionSettings], Session],
    ) -> None:
        self.skin, self._queue, self._number = skin, queue, number
        self._lane = queue.lanes[number]
        self._settings, self._opened = settings, opened
        self._begun = 0  # sessions that have started
        self._frames = 0
        self.session = self._new_session()
        self.summary = Summary()
        self.starts_us: int | None = None
        self._clock, self._last_s = HostClock(), 0.0
        self._thread = threading.Thread(target=self._run, name=f"eitskin {skin.name}", daemon=True)

    def _new_session(self) -> Session:
        skin, how = self.skin, self._settings
        own = replace(
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
        return self._opened(skin, own)

    def open(self) -> None:
        try:
            self.session.__enter__()
        except EitskinError as error:
            raise named(self.skin.name, error) from None

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
        queue, lane = self._queue, self._lane
        try:
            self._start(self.session)
            queue.note(lane, started=True)
            queue.begun.wait()
            while not queue.ending.is_set():
                try:
                    self._read()
                    return
                except DeviceError as error:
                    if self.session.timed:
                        raise
                    self._come_back(error)
        except BaseException as error:
            queue.note(lane, error=named(self.skin.name, error))
        finally:
            queue.note(lane, over=True)

    def _start(self, session: Session) -> None:
        self.session, self._lane.timed = session, session.timed
        if self._queue.ending.is_set():  # between two sessions
            session.stop()
        session.start()
        self._begun += 1

    def _read(self) -> None:
        messages = self.session.messages()
        try:
            for message in messages:
                self._frames += isinstance(message, Frame)
                if not self._put(self._as_of_robot(message)):
                    return
        finally:
            messages.close()

    def _come_back(self, error: DeviceError) -> None:
        """Open a board that failed again and again, less and less often, until it answers or the
        robot's session ends."""
        wait_s, said = FIRST_WAIT_S, ""
        while True:
            if str(error) != said:
                said = str(error)
                self._notice(f"link: lost: {said}; opening it again until it answers")
            self.session.close(said)
            if self._queue.ending.wait(wait_s):
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
        return self._lane.put(message, lambda: self.session.asked)

    def _as_of_robot(self, message: Message) -> Message:
        """``message`` by the robot's clock, with ids that no other skin has."""
        if isinstance(message, Notice):
            return replace(message, time_s=self._last_s)
        time_us = self._time_us(message)
        self._last_s = time_us / 1e6
        number, count = self._number, len(self._queue.lanes)

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
        arrived_us = (time.monotonic_ns() - self._queue.began_ns) / 1e3
        scan_us = self.session.device.board.frame_us if isinstance(message, Frame) else 0
        offset_us = self._clock.offset_us(message.time_us + scan_us, arrived_us)
        return max(round(message.time_us + offset_us), 0)


def named(name: str, error: BaseException) -> BaseException:
    """Return ``error`` with the skin's name, if it is one that a user can cause."""
    return type(error)(f"skin {name!r}: {error}") if isinstance(error, EitskinError) else error
