"""What a session gives: frames, and notices between them."""

from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.diagnostics import names, words
from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import GestureEvent
from eitskin.core.notebook import places_text, touches_html
from eitskin.device.known_model import KnownModel
from eitskin.device.live_frames import LiveDrive, LiveFrame
from eitskin.device.wire.link_table import FollowedTouch
from eitskin.device.wire.packets import Solved
from eitskin.live.message import frame_table, head, report_table, true_table
from eitskin.scene.random_touches import TrueTouch
from eitskin.scoring.stream_check import ComparedFrame


@dataclass(frozen=True)
class Notice:
    """Something beside the frames. ``kind``: "fault" (the board reports one, or that it has gone),
    "link" (a gap, an unplugged board) or "diagnostic" (frames show something wrong, or no longer);
    ``text`` is a line. ``time_s``: of the frame before; ``time_unix_s`` as a frame's."""

    kind: str
    text: str
    time_s: float | None
    time_unix_s: float | None = None

    def message(self) -> dict[str, Any]:
        return head("notice") | asdict(self)


@dataclass(frozen=True, eq=False)
class Report:
    """Touches after a drive: where they are at an instant within a scan, and where to they go.

    Attributes:
        live: its packet as the board sent it.
        time_unix_s: as a frame's.
    """

    live: LiveDrive
    time_unix_s: float | None = None

    @property
    def time_s(self) -> float:
        """The instant, by the clock of frames' ``time_s``."""
        return self.live.time_us / 1e6

    @property
    def touches(self) -> tuple[FollowedTouch, ...]:
        """In the order in which they came: mm, mm/s; their ids are not those of frames."""
        return self.live.followed.touches

    def message(self) -> dict[str, Any]:
        head, times = self.live.followed.head, (self.time_s, self.time_unix_s)
        message = report_table(head.frame, head.drive, *times, self.touches)
        return message | {"board_us": self.live.board_us, "age_us": head.age_us}


@dataclass(frozen=True, eq=False)
class Frame:
    """What came of one frame.

    Attributes:
        live: its packets as the board sent them.
        compared: the same beside the truth, where there is one, and the image in brief.
        known: the board's model, where the host has it.
        time_unix_s: when it was complete on this host, in seconds since 1970 (UTC); None for what
            was recorded.
        arrived_ns: the same by ``time.monotonic_ns``.
        events: what its touches amounted to: fingers down, moved and up, gestures, zones pressed.
        notices: what was noticed since the frame before.
    """

    live: LiveFrame
    compared: ComparedFrame
    known: KnownModel | None = None
    time_unix_s: float | None = None
    arrived_ns: int = 0
    events: tuple[GestureEvent, ...] = ()
    notices: tuple[Notice, ...] = ()

    @property
    def number(self) -> int:
        """The board's count, from 0, and again from 0 after 2^32."""
        return self.live.number

    @property
    def time_s(self) -> float:
        """When its scan began, by the board's clock, from the first frame of the stream."""
        return self.live.time_us / 1e6

    @property
    def touches(self) -> tuple[Touch, ...]:
        """Strongest first; none where touches were not asked for."""
        return () if self.live.touches is None else self.live.touches.touches

    @property
    def image(self) -> npt.NDArray[np.float32] | None:
        """(n,) S/m on the model's pixels; None where it was not asked for."""
        return None if self.live.image is None else self.live.image.image

    @property
    def voltage_v(self) -> npt.NDArray[np.float32] | None:
        """(m,) V, NaN for rows that cannot be used; None where it was not asked for."""
        return None if self.live.raw is None else self.live.raw.voltage_v

    @property
    def info(self) -> Solved | None:
        """What the solver says; None where nothing was solved."""
        return self.live.solved

    @property
    def refused(self) -> str | None:
        """Why the board's core refused the frame; None where it did not."""
        return self.live.refused

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Names of what was found wrong with the frame."""
        return () if self.info is None else names(self.info.diagnostics)

    @property
    def found(self) -> tuple[str, ...]:
        """The same in a few words each."""
        return () if self.info is None else words(self.info)

    @property
    def true(self) -> tuple[TrueTouch, ...] | None:
        """The touches that were there, where a scene tells."""
        return self.compared.true

    def message(self, *, arrays: bool = True) -> dict[str, Any]:
        """For programs (docs/reference/message.md); without ``arrays`` image and raw voltages are
        left out."""
        live, solved = self.live, self.live.solved
        message = frame_table(
            self.number,
            time_s=self.time_s,
            time_unix_s=self.time_unix_s,
            touches=None if live.touches is None else live.touches.touches,
            diagnostics=self.diagnostics,
            found=self.found,
            refused=self.refused,
            events=[event.as_dict() | {"time_s": self.time_s} for event in self.events],
            info=None if solved is None else solved.as_dict(),
        )
        message["board_us"] = live.board_us
        if arrays:
            message |= _image(self.compared) | _raw(live)
        return message | _truth(self.compared, message)

    def __repr__(self) -> str:
        shown = (
            f"refused: {self.refused}"
            if self.refused
            else f"touches: {places_text(self.touches)}"
            if self.live.touches is not None
            else ", ".join(
                name
                for name, part in (("image", self.live.image), ("raw", self.live.raw))
                if part is not None
            )
        )
        return f"<Frame {self.number} at {self.time_s:.3f} s, {shown}>"

    def _repr_html_(self) -> str:
        return touches_html(f"frame {self.number}, {self.time_s:.3f} s", self.touches)

    def _repr_png_(self) -> bytes | None:
        """Where the model is known and matplotlib is installed."""
        if self.known is None or find_spec("matplotlib") is None:
            return None
        from eitskin.view.touch_axes import touches_png

        return touches_png(self.known.model, self.touches, self.image, self.true or ())


def _image(seen: ComparedFrame) -> dict[str, Any]:
    image, view = seen.frame.image, seen.view
    if image is None:
        return {}
    facts: dict[str, Any] = {"image_s_per_m": image.image.tolist()}
    facts |= {"peak_s_per_m": None, "peak_mm": None, "places": None}
    if view is None:
        return facts
    facts |= {"peak_s_per_m": view.peak, "peak_mm": list(view.peak_mm)}
    if view.places_mm is not None:
        facts["places"] = [{"x_mm": x, "y_mm": y} for x, y in view.places_mm.tolist()]
    return facts


def _raw(frame: LiveFrame) -> dict[str, Any]:
    raw = frame.raw
    if raw is None:
        return {}
    return {
        "voltage_v": [v if np.isfinite(v) else None for v in raw.voltage_v.tolist()],
        "quality": raw.quality.tolist(),
        "scan_us": raw.scan_us,
        "quiet": raw.quiet,
    }


def _truth(seen: ComparedFrame, message: dict[str, Any]) -> dict[str, Any]:
    """The true touches; and how far off each found one is, null for a false one."""
    if seen.true is None:
        return {}
    found = message["touches"] if message["touches"] is not None else message.get("places")
    for number, one in enumerate(found or ()):
        one["error_mm"] = (seen.errors_mm or {}).get(number)
    return {"true": [true_table(t) for t in seen.true]}
