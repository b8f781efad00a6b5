"""The JSON message of a frame, a report, a notice, a summary or a reconstructed file;
``message.schema.json`` beside this file describes it (docs/reference/message.md).

A field that is asked for and not known is null. Fields of images, raw voltages and truth are there
only where those are.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any, Protocol

from eitskin.core.diagnostics_table import Touch
from eitskin.device.wire.link_table import DriveTouch

VERSION = 1


class TrueTouch(Protocol):
    """A touch that was there, as far as a message reports it."""

    @property
    def x_mm(self) -> float: ...
    @property
    def y_mm(self) -> float: ...
    @property
    def radius_mm(self) -> float: ...
    @property
    def contrast(self) -> float: ...


def schema() -> dict[str, Any]:
    """The JSON Schema of every message."""
    text = files("eitskin.session").joinpath("message.schema.json").read_text("utf-8")
    parsed: dict[str, Any] = json.loads(text)
    return parsed


def head(kind: str) -> dict[str, Any]:
    """How every message begins."""
    return {"version": VERSION, "type": kind}


def encoded(message: dict[str, Any]) -> str:
    """One line of JSON."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False)


def touch_table(touch: Touch) -> dict[str, Any]:
    """A touch; a force that the model does not give is null."""
    return asdict(touch) | {"force_n": touch.force_n or None}


def frame_table(
    number: int,
    *,
    time_s: float | None = None,
    time_unix_s: float | None = None,
    touches: Sequence[Touch] | None = None,
    diagnostics: Sequence[str] = (),
    found: Sequence[str] = (),
    refused: str | None = None,
    events: Sequence[dict[str, Any]] = (),
    info: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the fields that the message of every frame has, from a board or from a file."""
    return head("frame") | {
        "frame": number,
        "time_s": time_s,
        "time_unix_s": time_unix_s,
        "touches": None if touches is None else [touch_table(t) for t in touches],
        "events": list(events),
        "diagnostics": list(diagnostics),
        "found": list(found),
        "refused": refused,
        "info": None if info is None else {key: known(value) for key, value in info.items()},
    }


def report_table(
    frame: int,
    drive: int,
    time_s: float,
    time_unix_s: float | None,
    touches: Sequence[DriveTouch],
) -> dict[str, Any]:
    """Return the message of the touches after a drive."""
    return head("report") | {
        "frame": frame,
        "drive": drive,
        "time_s": time_s,
        "time_unix_s": time_unix_s,
        "touches": [asdict(touch) for touch in touches],
    }


def known(value: Any) -> Any:
    """``value``; None for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def true_table(touch: TrueTouch) -> dict[str, float]:
    return {
        "x_mm": touch.x_mm,
        "y_mm": touch.y_mm,
        "radius_mm": touch.radius_mm,
        "contrast": touch.contrast,
    }


def summary_message(facts: dict[str, Any], source: str | None = None) -> dict[str, Any]:
    """Return the message with a session's summary."""
    return head("summary") | {"summary": facts, "source": source}
