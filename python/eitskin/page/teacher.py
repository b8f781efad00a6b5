"""Teaching in the page: the guide of ``eitskin teach record`` fed with the frames of the page's
session, the same file of presses, and the fit."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from eitskin.device.known_model import scanned_protocol
from eitskin.errors import UsageError
from eitskin.model.eitm import save_model
from eitskin.session.frame import Frame, Message
from eitskin.session.session import Session
from eitskin.skin.skin import Skin
from eitskin.teaching.guide import GuideEvent, PressGuide, Step, scan_of_presses
from eitskin.teaching.plan import PressPlan
from eitskin.teaching.press_file import PressFile
from eitskin.teaching.teach import teach


class Teacher:
    """Guides through the presses of ``plan`` and writes them into the file ``presses``; ``skin``
    with its description's ``text``, None and "" for that of the board's model. ``on_event`` gets
    the facts for pages whenever something is new."""

    def __init__(
        self, plan: PressPlan, presses: Path, skin: Skin | None = None, text: str = ""
    ) -> None:
        self.plan, self.path, self._skin, self._text = plan, presses, skin, text
        self.on_event: Callable[[dict[str, Any]], None] = lambda facts: None
        self._guide: PressGuide | None = None
        self._file: PressFile | None = None
        self._line = Step.REST.value
        self._lock = threading.Lock()

    def begin(self, session: Session) -> None:
        """Set the scan of a session that has not started, and continue where the file ends."""
        board = session.device.board
        session.settings = replace(session.settings, scan=scan_of_presses(board, session.replays))
        protocol = scanned_protocol(board, session.known, session.name)
        with self._lock:
            if self._file is not None:
                self._file.close()
            self._file = PressFile(self.path, self.plan, protocol, self._text)
            self._guide = PressGuide(self.plan, start=self._file.following)
            if self._skin is None and session.known is not None:
                self._skin = session.known.model.known_skin
        self.on_event(self.facts())

    def take(self, message: Message) -> None:
        """A consumer of the session's messages."""
        if not isinstance(message, Frame) or message.voltage_v is None:
            return
        with self._lock:
            if self._guide is None or self._file is None:
                return
            event = self._guide.feed(message.voltage_v, message.time_s)
            if event is None:
                return
            if event.accepted and self._guide.taken is not None:
                self._file.add(event.number, *self._guide.taken)
            if event.withdrawn:
                self._file.back()
            self._line = event.text
        self.on_event(self.facts())

    def facts(self) -> dict[str, Any]:
        """Return the facts for pages: the present step, its place, and the presses that are
        done."""
        guide, file = self._guide, self._file
        return {
            "step": "rest" if guide is None else guide.step.name.lower(),
            "text": self._line,
            "number": 0 if guide is None else guide.number,
            "done": [] if file is None else list(file.numbers),
            "places_mm": self.plan.place_mm.round(2).tolist(),
        }

    def go(self, what: str) -> str:
        """``back`` to the press before, or ``skip`` this place."""
        with self._lock:
            if self._guide is None or self._file is None:
                raise UsageError("teach: the board is not there yet")
            event: GuideEvent
            if what == "back":
                event = self._guide.back(self._file.back())
            elif self._guide.step is Step.DONE:
                raise UsageError("teach: all places are done")
            else:
                event = self._guide.skip()
            self._line = event.text
        self.on_event(self.facts())
        return event.text

    def fit(self) -> tuple[bytes, str]:
        """Return the taught model's bytes, which are also written to a file beside the presses, and
        a report of its quality."""
        presses = None if self._file is None else self._file.presses
        if presses is None:
            raise UsageError("teach: no press is there yet")
        taught = teach(presses, self._skin)
        path = self.path.with_suffix(".eitm")
        save_model(path, taught.model)
        error = taught.report["error_mm"]["held_out_median"]
        notes = "".join(f"; {note}" for note in taught.report["notes"])
        text = f"{path.name}: {len(presses)} presses, {error:.1f} mm where held out{notes}"
        return path.read_bytes(), text
