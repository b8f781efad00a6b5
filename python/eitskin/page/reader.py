"""The session reader: the thread that owns the page's board. It reads one session after another,
each from its opening to its end."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from eitskin.device.open import open_device
from eitskin.device.timing import split_timing
from eitskin.device.transport import LinkEvent
from eitskin.errors import DeviceError, EitskinError
from eitskin.page.teacher import Teacher
from eitskin.session.frame import DriveReport, Frame, Message, Notice
from eitskin.session.replay import recording_length_s
from eitskin.session.robot_session import FOR_EVER, AnySession, open_session
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.sinks.outputs import Outputs
from eitskin.truth import observe_scene

DRAWN_S = 0.015
STOPPED_S = 0.8  # that the board may take to stop
SINKS_S = 4.0  # that the thread may take to end then; sinks have 3 s
AttachOutputs = Callable[[AnySession], AbstractContextManager[Outputs | None]]


class SessionReader:
    """Opens ``url`` and gives frames to ``on_frame`` and all else to ``on_news``, in its own
    thread, until ``stop``; ``outputs`` attaches sinks to a session, ``folder`` is where recordings
    go, ``teacher`` guides presses.

    ``state``: "starting", "live", "unplugged", "ended" (the scene or the recording is over),
    "failed" (``text`` says why).
    """

    def __init__(
        self,
        url: str,
        settings: SessionSettings,
        *,
        speed: float,
        folder: Path,
        on_frame: Callable[[Frame], None],
        on_news: Callable[[str, dict[str, Any]], None],
        outputs: AttachOutputs | None = None,
        teacher: Teacher | None = None,
    ) -> None:
        self.teacher = teacher
        if teacher is not None:
            teacher.on_event = lambda facts: on_news("teach", facts)
        self._url, self.settings, self._speed, self.folder = url, settings, speed, folder
        self._on_frame, self.report, self._outputs = on_frame, on_news, outputs
        self.session: AnySession | None = None  # under way
        self.last: AnySession | None = None  # that is over, for pages that come later
        self._opened: AnySession | None = None  # perhaps still starting
        self.state, self.text = "starting", ""
        self.error: Exception | None = None
        self.frames = 0
        self._reported_s: dict[str | None, float] = {}  # by source
        self.length_s: float | None = None  # of a recording, once it has been read
        self._begin_s = 0.0  # where the next session of a recording begins
        self._stopping, self._again = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="eitskin view", daemon=True)

    # ---- from any thread ----

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End, and close the board, within a moment whatever the board does."""
        self._stopping.set()
        self._again.set()
        session = self._opened
        if session is not None:
            session.stop()
        self._thread.join(STOPPED_S)
        if session is not None and self._thread.is_alive():
            session.close()  # what it waits for fails; sinks may still send what is queued
            self._thread.join(SINKS_S)

    def again(self, time_s: float = 0.0) -> None:
        """Open the device again after the end of a session; a recording continues at ``time_s``."""
        self._begin_s = time_s
        self._again.set()

    def live(self) -> AnySession:
        """The session under way."""
        session = self.session
        if session is None:
            raise DeviceError("no session is under way; press  Start again")
        return session

    # ---- the thread ----

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._again.clear()
            self._set("starting", self._url)
            try:
                self._read()
                self._set("ended", "the scene or the recording is over")
            except Exception as error:  # whatever it is, the pages show it
                self.error = error
                self._set("failed", str(error) or type(error).__name__)
            finally:
                self.session = self._opened = None
            self._again.wait()

    def _read(self) -> None:
        session = open_session(
            self._url,
            self.settings,
            say=self._say,
            progress=self._say,
            reconnect=FOR_EVER,
            speed=self._speed,
            observe=observe_scene,
        )
        self._opened = session
        with session, nullcontext() if self._outputs is None else self._outputs(session):
            session.consumers.append(self._take)
            if self.teacher is not None and isinstance(session, Session):
                self.teacher.begin(session)
                session.consumers.append(self.teacher.take)
            session.start()
            self.session = self.last = session
            self._set("live", "")
            if self._stopping.is_set():
                return
            if session.replays and isinstance(session, Session):
                self._begin_recording(session)
            try:
                for _ in session.messages():
                    pass  # the consumers have it
            finally:
                self.settings = replace(session.settings, record=None)
                self._speed = session.pacer.speed

    def _begin_recording(self, session: Session) -> None:
        """Begin where a page has asked for, and find out meanwhile how long the recording is."""
        begin_s, self._begin_s = self._begin_s, 0.0
        if begin_s:
            session.ask(lambda device: session.seek(begin_s))
        if self.length_s is None:
            threading.Thread(target=self._measure, name="eitskin length", daemon=True).start()

    def _measure(self) -> None:
        with suppress(EitskinError), open_device(split_timing(self._url)[0]) as recording:
            self.length_s = recording_length_s(recording)
            self.report("setup", {})

    def _take(self, message: Message) -> None:
        """The page as a consumer of a session."""
        if isinstance(message, Frame):
            self.frames += 1
            self._on_frame(message)
        elif isinstance(message, DriveReport):
            self._take_report(message)
        else:
            self._take_notice(message)

    def _take_report(self, report: DriveReport) -> None:
        """Pass on no more reports than a page draws, but each one without touches, so that a page
        knows when the last finger has gone."""
        before_s = self._reported_s.get(report.source, 0.0)
        if report.touches and 0 <= report.time_s - before_s < DRAWN_S:
            return
        self._reported_s[report.source] = report.time_s
        self.report("report", report.message())

    def _take_notice(self, notice: Notice) -> None:
        self.report("notice", notice.message())
        kind = notice.cause.kind if isinstance(notice.cause, LinkEvent) else ""
        if len(self.live().parts) > 1:
            return  # of a robot, whose other skins continue
        if kind == "unplugged":
            self._set("unplugged", "the board is gone; waiting until it is plugged in again")
        elif kind == "reconnected":
            self._set("live", "")

    def _say(self, text: str) -> None:
        self.report("notice", {"kind": "session", "text": text, "time_s": None})

    def _set(self, state: str, text: str) -> None:
        self.state, self.text = state, text
        self.report("state", {"state": state, "text": text})
