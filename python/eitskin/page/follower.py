"""The thread that follows a board for the page: one session after another, each from its opening
to its end."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from eitskin.device.client import TARE_FRAMES, Device
from eitskin.device.known_model import KnownModel
from eitskin.device.link import Reconnect
from eitskin.device.recordings.recording import Recorder
from eitskin.device.set_up import set_up, take_reference
from eitskin.device.settings import ScanSettings
from eitskin.device.wire.codec import Packet
from eitskin.device.wire.link_table import PacketType, Stream
from eitskin.device.wire.packets import RawFrame
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.errors import DeviceError, EitskinError, UsageError
from eitskin.live.frame import Frame, Notice, Report
from eitskin.live.session import Session
from eitskin.live.settings import KINDS, SessionSettings
from eitskin.model.eitm import decode_model
from eitskin.page.teacher import Teacher
from eitskin.sinks.outputs import Outputs
from eitskin.tuning.front import named_preset

DRAWN_S = 0.015
FOR_EVER = Reconnect(tries=2**31, every_s=0.5)
T = TypeVar("T")


class PageSession(Session):
    """A session whose quiet frames are looked at: ``reference_v`` (m,) is their mean, None where
    none were seen."""

    reference_v: list[float] | None = None

    def _open(self) -> Device:
        device = super()._open()
        self._quiet: list[Any] = []
        device.link.begin_tap(lambda last: None, self._look)
        return device

    def _look(self, packet: Packet) -> None:
        if packet.type != PacketType.RAW:
            return
        try:
            raw = parse(packet.type, packet.payload)
        except MalformedPacket:
            return
        assert isinstance(raw, RawFrame)
        if raw.quiet:
            self._quiet.append(raw.voltage_v)
            del self._quiet[:-1024]
        elif self._quiet:
            mean = np.mean(np.array(self._quiet, dtype=np.float64), axis=0)
            self.reference_v = np.where(np.isfinite(mean), mean, 0.0).tolist()
            self._quiet = []


class Follower:
    """Opens ``url`` and gives what comes to ``on_frame`` and ``on_news``, in its own thread, until
    ``stop``; ``outputs`` opens the sinks of a session, ``folder`` is where recordings go,
    ``teacher`` guides presses.

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
        outputs: Callable[[Session], Outputs] | None = None,
        teacher: Teacher | None = None,
    ) -> None:
        self.teacher = teacher
        if teacher is not None:
            teacher.on_event = lambda facts: on_news("teach", facts)
        self._url, self.settings, self._speed, self.folder = url, settings, speed, folder
        self._on_frame, self._on_news, self._outputs = on_frame, on_news, outputs
        self.session: PageSession | None = None
        self.last: PageSession | None = None  # that is over, for pages that come later
        self.state, self.text = "starting", ""
        self.error: Exception | None = None
        self.frames = 0
        self._reported_s = 0.0
        self._stopping, self._again = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="eitskin view", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """End, and let go of the board."""
        self._stopping.set()
        self._again.set()
        if self.session is not None:
            self.session.stop()
        self._thread.join(10.0)

    def again(self) -> None:
        """Open the device again, where a session is over."""
        self._again.set()

    # ---- the thread ----

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._again.clear()
            self._set("starting", self._url)
            try:
                self._follow()
                self._set("ended", "the scene or the recording is over")
            except Exception as error:  # the page says so, whatever it is
                self.error = error
                self._set("failed", str(error) or type(error).__name__)
            finally:
                self.session = None
            self._again.wait()

    def _follow(self) -> None:
        session = PageSession(
            self._url,
            self.settings,
            say=self._say,
            progress=self._say,
            reconnect=FOR_EVER,
            speed=self._speed,
        )
        with session, nullcontext() if self._outputs is None else self._outputs(session) as outputs:
            if self.teacher is not None:
                self.teacher.begin(session)
            session.start()
            self.session = self.last = session
            self._set("live", "")
            frames = session.frames()
            try:
                for item in frames:
                    if self._stopping.is_set():
                        return
                    if outputs is not None:
                        outputs.put(item)
                    if isinstance(item, Notice):
                        self._notice(item)
                    elif isinstance(item, Report):
                        self._report(item)
                    else:
                        self.frames += 1
                        self._on_frame(item)
                        if self.teacher is not None:
                            self.teacher.take(item)
            finally:
                frames.close()
                self.settings = replace(session.settings, record=None)
                self._speed = session.pacer.speed

    def _report(self, report: Report) -> None:
        """No more of them than a page draws; none that says that nothing touches any more is left
        out."""
        if report.touches and 0 <= report.time_s - self._reported_s < DRAWN_S:
            return
        self._reported_s = report.time_s
        self._on_news("report", report.message())

    def _notice(self, notice: Notice) -> None:
        self._on_news("notice", notice.message())
        if notice.kind == "link" and "unplugged" in notice.text:
            self._set("unplugged", "the board is gone; waiting until it is plugged in again")
        elif notice.kind == "link" and "reconnected" in notice.text:
            self._set("live", "")

    def _say(self, text: str) -> None:
        self._on_news("notice", {"kind": "session", "text": text, "time_s": None})

    def _set(self, state: str, text: str) -> None:
        self.state, self.text = state, text
        self._on_news("state", {"state": state, "text": text})

    # ---- commands, from any thread ----

    def live(self) -> PageSession:
        """The session under way."""
        session = self.session
        if session is None:
            raise DeviceError("nothing is being followed; press  Start again")
        return session

    def _changed(self, session: PageSession, action: Callable[[Device], T]) -> Future[T]:
        def run(device: Device) -> T:
            try:
                return action(device)
            finally:
                self._on_news("setup", {})

        return session.ask(run)

    def tare(self) -> Future[str]:
        session = self._board("tare")

        def action(device: Device) -> str:
            take_reference(device, TARE_FRAMES, streamed=True)
            return f"reference taken from {TARE_FRAMES} frames"

        return self._changed(session, action)

    def mode(self, kinds: list[str]) -> Future[str]:
        """What is streamed."""
        session = self.live()
        if not kinds or not set(kinds) <= set(KINDS):
            raise UsageError(f"mode: choose from {', '.join(KINDS)}")
        mode = Stream(0)
        for kind in kinds:
            mode |= Stream[kind.upper()]

        def action(device: Device) -> str:
            session.change_mode(mode)
            return f"streaming {', '.join(kinds)}"

        return self._changed(session, action)

    def solver(self, **changes: Any) -> Future[str]:
        session = self._board("the solver")
        named = replace(session.settings.solver, **changes)

        def action(device: Device) -> str:
            session.solver = set_up(device, ScanSettings(), named, session.known)
            session.settings = replace(session.settings, solver=named, target=None)
            if session.truth is not None and named.sign is not None:
                session.truth.look_for(named.sign)
            return "solver: " + ", ".join(f"{k} {v}" for k, v in changes.items())

        return self._changed(session, action)

    def preset(self, name: str) -> Future[str]:
        """Scan and solver by name, and the reference for them."""
        session, target = self._board("a preset"), named_preset(name, "f767")

        def action(device: Device) -> str:
            before = session.settings
            session.settings = replace(before, target=target)
            try:
                scan, solver = session.scan_and_solver()
            except EitskinError:
                session.settings = before
                raise
            session.solver = set_up(device, scan, solver, session.known)
            take_reference(device, TARE_FRAMES, streamed=True)
            return f"preset {name} is in use, and the reference is taken"

        return self._changed(session, action)

    def upload(self, blob: bytes) -> Future[str]:
        """Another model, and the reference for it."""
        session = self._board("a model")
        model = decode_model(blob, "the uploaded file")

        def action(device: Device) -> str:
            device.upload_model(blob)
            session.known = KnownModel(model, blob)
            session.solver = set_up(device, ScanSettings(), session.settings.solver, session.known)
            take_reference(device, TARE_FRAMES, streamed=True)
            return f"model {device.board.model_crc:08x} is in use, and the reference is taken"

        return self._changed(session, action)

    def teach(self, what: str) -> Future[str] | str:
        """ "back", "skip"; "fit": a thread of its own makes the model, then the board gets it."""
        teacher = self.teacher
        if teacher is None:
            raise UsageError("teach: start  eitskin view --teach PLAN.csv")
        if what != "fit":
            return teacher.go(what)
        answer: Future[str] = Future()

        def run() -> None:
            try:
                blob, text = teacher.fit()
                try:
                    text += f"; {self.upload(blob).result()}"
                except EitskinError as error:
                    text += f"; the board has it not: {error}"
                answer.set_result(text)
            except BaseException as error:
                answer.set_exception(error)

        threading.Thread(target=run, name="eitskin teach", daemon=True).start()
        return answer

    def record(self, on: bool) -> Future[str]:
        """Begin or end a recording in the folder."""
        session = self._board("a recording")

        def action(device: Device) -> str:
            if session.recorder is not None:
                name, count = session.recorder.path.name, session.recorder.packets
                session.recorder.close()
                session.recorder = None
                if not on:
                    return f"recorded {count} packets in {name}"
            if on:
                name = f"eitskin-{datetime.now():%Y%m%d-%H%M%S}.eits"
                session.recorder = Recorder(self.folder / name, device, session.solver)
                return f"recording to {name}"
            return "nothing is being recorded"

        return self._changed(session, action)

    def pace(self, what: str, speed: float | None = None) -> str:
        """ "play", "pause", "step" or "speed"."""
        if what == "play" and self.session is None:
            self.again()
            return "starting again"
        session = self.live()
        if not session.timed:
            raise UsageError(f"{session.name} is a real board; its time cannot be held")
        pacer = session.pacer
        if what == "speed":
            pacer.set_speed(speed or 0.0)
        else:
            {"play": pacer.play, "pause": pacer.pause, "step": pacer.step}[what]()
        self._on_news("setup", {})
        return {"speed": f"speed {speed or 'max'}", "play": "playing", "step": "one frame"}.get(
            what, "paused"
        )

    def _board(self, what: str) -> PageSession:
        session = self.live()
        if session.replays:
            raise UsageError(f"{session.name} is a recording: {what} needs a board")
        return session
