"""The commands of a page. A command that needs the board goes through the page's session
(``Session.ask``), so that each one gets an answer; any thread may call them."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from datetime import datetime
from itertools import chain, count
from pathlib import Path
from typing import Any, TypeVar

from eitskin.device.client import TARE_FRAMES, Device
from eitskin.device.known_model import KnownModel
from eitskin.device.recordings.recording import Recorder
from eitskin.device.timing import read_speed
from eitskin.device.wire.link_table import Stream
from eitskin.errors import EitskinError, FileError, SkinTouchedError, UsageError
from eitskin.model.eitm import decode_model
from eitskin.page.reader import SessionReader
from eitskin.session.robot_session import AnySession, RobotSession, all_of
from eitskin.session.session import Session
from eitskin.session.set_up import take_reference
from eitskin.session.settings import KINDS
from eitskin.tuning.front import named_preset

AGAIN_S = 10.0
MAX_FINGERS = 5  # that a page presses at once
MAX_PLACE_MM = 1e6
MAX_SEEK_S = 1e7
T = TypeVar("T")
Answer = Future[str] | str


def _free(path: Path) -> Path:
    """``path``, or, if that file exists, as in the second in which another recording began, one
    with a number."""
    numbered = (path.with_stem(f"{path.stem}-{k}") for k in count(2))
    return next(one for one in chain([path], numbered) if not one.exists())


def _places(value: object) -> list[tuple[float, float]]:
    """The places of fingers in a page's message."""
    places: list[Any] = value if isinstance(value, list) else [None]
    if len(places) > MAX_FINGERS or not all(_is_place(one) for one in places):
        raise UsageError(
            f"press: {str(value)[:60]!r} cannot be; give at most {MAX_FINGERS} places, each x and y"
            " in mm"
        )
    return [(float(x), float(y)) for x, y in places]


def _is_place(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(type(x) in (int, float) and abs(x) < MAX_PLACE_MM for x in value)
    )


class PageCommands:
    """Commands for the session of ``reader``. Each answers with a line, or raises an EitskinError;
    a Future gives either later."""

    def __init__(self, reader: SessionReader) -> None:
        self._reader = reader
        self._recorded: Path | None = None
        self._tare_again_s = 0.0  # until then a tare is taken although something touches the skin

    def do(self, what: object, value: object) -> Answer:
        """Carry out the command in a page's message."""
        if what in ("play", "pause", "step"):
            return self.pace(str(what))
        if what == "speed":
            return self.pace("speed", read_speed(str(value), "speed"))
        if what == "press" and isinstance(value, dict):
            return self.press({name: _places(one) for name, one in value.items()})
        if what == "seek" and isinstance(value, int | float) and 0 <= value <= MAX_SEEK_S:
            return self.seek(float(value))
        if what == "tare":
            return self.tare()
        if what == "undo-tare":
            return self.undo_tare()
        if what == "record":
            return self.record(value is True)
        if what == "mode" and isinstance(value, list):
            return self.mode([str(kind) for kind in value])
        if what == "sign" and value in ("increase", "decrease", "both"):
            return self.solver(sign=value)
        if what == "preset":
            return self.preset(str(value))
        if what == "teach" and value in ("back", "skip", "fit"):
            return self.teach(str(value))
        if what == "iterations" and isinstance(value, int) and 1 <= value <= 1_000_000:
            return self.solver(iterations=value)
        raise UsageError(f"{what}: {value!r} cannot be")

    def press(self, places_mm: dict[str, list[tuple[float, float]]]) -> str:
        """Put fingers on the simulated skins of these names, and lift them from the others."""
        parts = self._reader.live().parts
        for name in places_mm:
            if name not in parts:
                raise UsageError(f"press: there is no skin {name[:60]!r} here")
        for name, part in parts.items():
            if part.capabilities.finger_mm is not None or places_mm.get(name):
                part.device.transport.press(places_mm.get(name, []))
        return ""

    def seek(self, time_s: float) -> Answer:
        """Go on with a recording at ``time_s``, also where it is over."""
        session = self._reader.session
        if session is None:
            self._reader.again(time_s)
            return f"from {time_s:.1f} s"

        if not isinstance(session, Session):
            raise UsageError(f"{session.name} is a robot: view the recording of one skin alone")

        def action(device: Device) -> str:
            session.seek(time_s)
            return f"from {time_s:.1f} s"

        return session.ask(action)

    def recording(self) -> Path:
        """Return the recording that is shown, or the last one that was made here."""
        session = self._reader.session or self._reader.last
        shown = session is not None and session.replays
        path = Path(session.name) if session is not None and shown else self._recorded
        if path is None:
            raise UsageError("nothing has been recorded here yet; press  Record  first")
        return path

    def tare(self) -> Future[str]:
        """Take the reference. Where something touches the skin, the next tare within ``AGAIN_S``
        takes it all the same."""
        anyway, self._tare_again_s = time.monotonic() < self._tare_again_s, 0.0

        def action(session: Session, device: Device) -> str:
            try:
                take_reference(device, TARE_FRAMES, streamed=True, anyway=anyway)
            except SkinTouchedError as error:
                self._tare_again_s = time.monotonic() + AGAIN_S
                raise SkinTouchedError(
                    f"{error}; or press Tare again within {AGAIN_S:g} s to take it all the same"
                ) from None
            return f"reference taken from {TARE_FRAMES} frames"

        return self._each(self._board("tare"), action)

    def undo_tare(self) -> Future[str]:
        """Bring back the reference before the last tare."""
        whole = self._board("tare")
        if any(one.recorder is not None for one in whole.parts.values()):
            raise UsageError("undo: a recording holds its reference; stop the recording first")

        def action(session: Session, device: Device) -> str:
            device.undo_tare()
            if session.reference is not None:
                session.reference.undo()
            return "the reference before the last tare is back"

        return self._each(whole, action)

    def mode(self, kinds: list[str]) -> Future[str]:
        """Choose the kinds of packets that are streamed."""
        if not kinds or not set(kinds) <= set(KINDS):
            raise UsageError(f"mode: choose from {', '.join(KINDS)}")
        mode = Stream(0)
        for kind in kinds:
            mode |= Stream[kind.upper()]

        def action(session: Session, device: Device) -> str:
            session.change_mode(mode)
            return f"streaming {', '.join(kinds)}"

        return self._each(self._reader.live(), action)

    def solver(self, **changes: Any) -> Future[str]:

        def action(session: Session, device: Device) -> str:
            session.change_solver(replace(session.settings.solver, **changes))
            return "solver: " + ", ".join(f"{k} {v}" for k, v in changes.items())

        return self._each(self._board("the solver"), action)

    def preset(self, name: str) -> Future[str]:
        """Scan and solver by name, and the reference for them."""
        preset = named_preset(name, "f767")

        def action(session: Session, device: Device) -> str:
            session.apply(replace(session.settings, preset=preset))
            take_reference(device, TARE_FRAMES, streamed=True)
            return f"preset {name} is in use, and the reference is taken"

        return self._each(self._board("a preset"), action)

    def upload(self, blob: bytes) -> Future[str]:
        """Another model, and the reference for it."""
        session = self._one("a model")
        model = decode_model(blob, "the uploaded file")

        def action(device: Device) -> str:
            device.upload_model(blob)
            session.use_model(KnownModel(model, blob))
            take_reference(device, TARE_FRAMES, streamed=True)
            return f"model {device.board.model_crc:08x} is in use, and the reference is taken"

        return self._changed(session, action)

    def teach(self, what: str) -> Answer:
        """ "back", "skip"; "fit": a thread of its own makes the model, then the board gets it."""
        teacher = self._reader.teacher
        if teacher is None:
            raise UsageError("teach: start  eitskin view --teach PLAN.csv")
        if what != "fit":
            return teacher.go(what)
        answer: Future[str] = Future()
        answer.set_running_or_notify_cancel()  # a page that goes does not stop it

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
        session, folder = self._board("a recording"), self._reader.folder
        name = f"eitskin-{datetime.now():%Y%m%d-%H%M%S}"
        if not isinstance(session, Session):
            return self._record_robot(session, on, folder / name)

        def action(device: Device) -> str:
            done = self._end_recording(session)
            if not on:
                return done or "nothing is being recorded"
            path = _free(folder / f"{name}.eits")

            def failed(error: FileError) -> None:  # the disk is full: the view continues
                self._failed(error)
                self._changed(session, lambda device: self._end_recording(session))

            session.recorder = Recorder(
                path, device, session.solver, name=session.given_name, failed=failed
            )
            return f"recording to {path.name}"

        return self._changed(session, action)

    def _record_robot(self, robot: RobotSession, on: bool, folder: Path) -> Future[str]:
        """The same of all skins, each in a file of a new folder."""
        begun = robot.folder
        if on and begun is not None:
            raise UsageError(f"{robot.name} is being recorded to {begun.name} already")
        if not on and begun is None:
            raise UsageError("nothing is being recorded")
        place = _free(folder) if begun is None else begun
        done = robot.begin_recording(place, self._failed) if on else robot.end_recording()
        answer: Future[str] = Future()
        answer.set_running_or_notify_cancel()  # a page that goes does not stop it

        def answered(result: "Future[Any]") -> None:
            self._reader.report("setup", {})
            if error := result.exception():
                answer.set_exception(error)
            else:
                answer.set_result(f"{'recording to' if on else 'ended'} {place.name}")

        done.add_done_callback(answered)
        return answer

    def _failed(self, error: FileError) -> None:
        self._reader.report("notice", {"kind": "session", "text": str(error), "time_s": None})

    def _end_recording(self, session: Session) -> str:
        """End the recording, if there is one, and report what was recorded."""
        recorder, session.recorder = session.recorder, None
        if recorder is None:
            return ""
        recorder.close()
        self._recorded = recorder.path
        return f"recorded {recorder.packets} packets in {recorder.path.name}"

    def pace(self, what: str, speed: float | None = None) -> str:
        """ "play", "pause", "step" or "speed"."""
        if what == "play" and self._reader.session is None:
            self._reader.again()
            return "starting again"
        session = self._reader.live()
        if not session.timed:
            raise UsageError(f"{session.name} is a real board; its time cannot be held")
        pacer = session.pacer
        if what == "speed":
            pacer.set_speed(speed or 0.0)
        else:
            {"play": pacer.play, "pause": pacer.pause, "step": pacer.step}[what]()
        self._reader.report("setup", {})
        return {"speed": f"speed {speed or 'max'}", "play": "playing", "step": "one frame"}.get(
            what, "paused"
        )

    def _board(self, what: str) -> AnySession:
        session = self._reader.live()
        if session.replays:
            raise UsageError(f"{session.name} is a recording: {what} needs a board")
        return session

    def _one(self, what: str) -> Session:
        """The session of one skin."""
        session = self._board(what)
        if not isinstance(session, Session):
            raise UsageError(
                f"{session.name} is a robot: {what} belongs to one skin; view that skin alone"
            )
        return session

    def _each(self, session: AnySession, action: Callable[[Session, Device], str]) -> Future[str]:
        """Let ``action`` be carried out for every skin."""

        def of(part: Session) -> Future[str]:
            return self._changed(part, lambda device: action(part, device))

        if isinstance(session, Session):
            return of(session)
        answers = {name: of(part) for name, part in session.parts.items()}
        session.pacer.wake()
        return all_of(answers)

    def _changed(self, session: Session, action: Callable[[Device], T]) -> Future[T]:
        """Let ``action`` be carried out, and the pages hear of what has changed."""

        def run(device: Device) -> T:
            try:
                return action(device)
            finally:
                self._reader.report("setup", {})

        return session.ask(run)
