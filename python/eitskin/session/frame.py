"""The messages that a session gives to every consumer: a ``Frame``, a ``DriveReport`` between
frames, and a ``Notice`` of something else, such as a fault or an event of the link."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics import names, words
from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import GestureEvent
from eitskin.core.notebook import places_text, touches_html
from eitskin.device.known_model import KnownModel
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.explain import status_text
from eitskin.device.wire.link_table import DriveTouch
from eitskin.device.wire.packets import DriveTouches, Fault, RawFrame, Solved
from eitskin.errors import MissingExtraError
from eitskin.robot.placement import PlacedTouch, Placement
from eitskin.session.message import TrueTouch, frame_table, head, report_table, true_table
from eitskin.solve.image_touches import touches_in_image
from eitskin.surface.surface_map import LocatedTouch


@dataclass(frozen=True)
class Notice:
    """Something beside the frames. ``kind``: "fault" (the board reports one, or that it has gone),
    "link" (a gap, an unplugged board) or "diagnostic" (frames show something wrong, or no longer);
    ``text`` is a line. ``time_s``: of the frame before; ``time_unix_s`` as a frame's. ``cause``:
    the packet or event that it reports; None: the frame before."""

    kind: str
    text: str
    time_s: float | None
    time_unix_s: float | None = None
    cause: Fault | LinkEvent | None = field(default=None, repr=False)
    source: str | None = None

    def confirmed(self) -> "Notice":
        return self

    def message(self) -> dict[str, Any]:
        facts = asdict(self)
        del facts["cause"]
        return head("notice") | facts


@dataclass(frozen=True, eq=False)
class DriveReport:
    """Touches after a drive: where they are at an instant within a scan, and where to they go.

    Attributes:
        time_us: the instant, by the clock of frames' ``time_us``.
        board_us: the same by the board's own clock.
        packet: as the board sent it.
        time_unix_s, placement: as a frame's.
    """

    time_us: int
    board_us: int
    packet: DriveTouches
    time_unix_s: float | None = None
    source: str | None = None
    placement: Placement | None = None

    def confirmed(self) -> "DriveReport":
        """The same with the touches alone that a whole frame has confirmed."""
        touches = tuple(touch for touch in self.touches if touch.confirmed)
        return replace(self, packet=replace(self.packet, touches=touches))

    @property
    def time_s(self) -> float:
        """The instant, by the clock of frames' ``time_s``."""
        return self.time_us / 1e6

    @property
    def frame(self) -> int:
        """The number of the frame whose scan it is in."""
        return self.packet.head.frame

    @property
    def drive(self) -> int:
        """The drive after which it comes."""
        return self.packet.head.drive

    @property
    def touches(self) -> tuple[DriveTouch, ...]:
        """The touches in the order in which they landed, in mm and mm/s; their ids are those of
        frames."""
        return self.packet.touches

    @cached_property
    def placed(self) -> tuple[PlacedTouch, ...] | None:
        """The touches in the frame of the skin's link; None if that is not known."""
        return _placed(self.placement, self.touches)

    def message(self) -> dict[str, Any]:
        times = (self.time_s, self.time_unix_s)
        message = report_table(self.frame, self.drive, *times, self.touches)
        message |= {"board_us": self.board_us, "age_us": self.packet.head.age_us}
        return _with_places(message | {"source": self.source}, self.placement, self.placed)


@dataclass(frozen=True, eq=False)
class ImagePeak:
    """The pixel of an image that differs most from 0: its value in S/m, and where it is."""

    value: float
    place_mm: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame with everything that is known about it.

    Attributes:
        source: the name of the board, skin or source; None: of a file.
        number: the board's count, from 0, and again from 0 after 2^32.
        time_us: when its scan began, from the first frame of the stream; it does not wrap.
        board_us: the same by the board's own clock, which wraps.
        raw: the voltages as the board sent them, each with its quality; None where they were not
            asked for.
        solver_image: (n,) S/m on the model's pixels, as the board's solver left it; None if it
            was not asked for.
        touches: strongest first; none where touches were not asked for (``has_touches``).
        info: what the solver reports; None where nothing was solved.
        board_events: what the board itself made of its touches; None where it was not asked for.
        events: what its touches amounted to: fingers down, moved and up, gestures, zones pressed.
        known: the board's model, where the host has it.
        time_unix_s: when it was complete on this host, in seconds since 1970 (UTC); None for what
            was recorded.
        arrived_ns: the same by ``time.monotonic_ns``.
        true: the touches that were there, where an observer of a scene knows them.
        errors_mm: how far off the found touches (without them, the image's places) are, by their
            number; false ones are missing. None if the truth is not known.
        notices: what was noticed since the frame before.
        placement: where the skin is on its robot's link; None: not known.
    """

    number: int
    time_us: int
    board_us: int
    raw: RawFrame | None = None
    solver_image: npt.NDArray[np.float32] | None = None
    touches: tuple[Touch, ...] = ()
    has_touches: bool = False
    info: Solved | None = None
    board_events: tuple[GestureEvent, ...] | None = None
    events: tuple[GestureEvent, ...] = ()
    known: KnownModel | None = None
    time_unix_s: float | None = None
    arrived_ns: int = 0
    true: tuple[TrueTouch, ...] | None = None
    errors_mm: dict[int, float] | None = None
    notices: tuple[Notice, ...] = ()
    source: str | None = None
    placement: Placement | None = None

    def confirmed(self) -> "Frame":
        """The same with the touches alone that a whole frame has confirmed."""
        return replace(self, touches=tuple(touch for touch in self.touches if touch.confirmed))

    @property
    def time_s(self) -> float:
        """When its scan began, by the board's clock, from the first frame of the stream."""
        return self.time_us / 1e6

    @property
    def voltage_v(self) -> npt.NDArray[np.float32] | None:
        """(m,) V, NaN for rows that cannot be used; None if it was not asked for."""
        return None if self.raw is None else self.raw.voltage_v

    @property
    def untouched(self) -> bool:
        """Return whether it is a frame of a tare."""
        return self.raw is not None and self.raw.untouched

    @property
    def refused(self) -> str | None:
        """Why the board's core refused the frame; None if it did not."""
        info = self.info
        return status_text(info.status) if info is not None and info.status else None

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Names of the frame's diagnostics."""
        return () if self.info is None else names(self.info.diagnostics)

    @property
    def found(self) -> tuple[str, ...]:
        """The same in a few words each."""
        return () if self.info is None else words(self.info)

    @cached_property
    def touch_image(self) -> npt.NDArray[np.float32] | None:
        """The touches as discs and ellipses of one height, (n,) S/m: the bits that the board's core
        would draw. None if the board reports that they do not explain the frame, if it sent no
        touches, or if its model is not known."""
        known, info = self.known, self.info
        if known is None or info is None or info.shown != "touches" or not self.touches:
            return None
        return known.drawing.image(self.touches)

    @property
    def image(self) -> npt.NDArray[np.float32] | None:
        """The image that shows the frame, (n,) S/m: ``touch_image``, and if there is none
        ``solver_image``; None if the frame has neither."""
        return self.solver_image if self.touch_image is None else self.touch_image

    @property
    def image_is(self) -> str | None:
        """Return "touches" or "solver": the source of ``image``; None without an image."""
        if self.touch_image is not None:
            return "touches"
        return None if self.solver_image is None else "solver"

    @cached_property
    def peak(self) -> ImagePeak | None:
        """The strongest place of the solver's image; None if the image was not asked for or not
        solved, or if its model is not known."""
        if self.solver_image is None or self.known is None or self.refused:
            return None
        top = int(np.argmax(np.abs(self.solver_image)))
        x_mm, y_mm = self.known.model.grid.centres_mm()[top]
        return ImagePeak(float(self.solver_image[top]), (float(x_mm), float(y_mm)))

    @cached_property
    def places_mm(self) -> FloatArray | None:
        """Centroids (k, 2) of the parts that stand out in the solver's image, strongest first
        (``image_touches``, at the model's threshold for touches); None as for ``peak``, or if scipy
        is not installed."""
        if self.peak is None or self.known is None:
            return None
        if self.peak.value == 0:
            return np.zeros((0, 2))
        model = self.known.model
        threshold, sign = model.defaults.touch_threshold, 1 if self.peak.value > 0 else -1
        values, centres = np.asarray(self.solver_image, np.float64), model.grid.centres_mm()
        try:
            return touches_in_image(values, model.grid.index, centres, threshold, sign)
        except MissingExtraError:
            return None

    @cached_property
    def placed(self) -> tuple[PlacedTouch, ...] | None:
        """The touches in the frame of the skin's link; None if that is not known."""
        return _placed(self.placement, self.touches)

    @property
    def found_mm(self) -> FloatArray | None:
        """Places (k, 2) of the touches, without them those in the image; None if the frame has
        neither."""
        if not self.has_touches:
            return self.places_mm
        return np.array([(t.x_mm, t.y_mm) for t in self.touches], dtype=np.float64).reshape(-1, 2)

    def message(self, *, arrays: bool = True) -> dict[str, Any]:
        """For programs (docs/reference/message.md); without ``arrays`` image and raw voltages are
        left out."""
        message = frame_table(
            self.number,
            time_s=self.time_s,
            time_unix_s=self.time_unix_s,
            touches=self.touches if self.has_touches else None,
            diagnostics=self.diagnostics,
            found=self.found,
            refused=self.refused,
            events=[event.as_dict() | {"time_s": self.time_s} for event in self.events],
            info=None if self.info is None or self.info.unsolved else self.info.as_dict(),
        )
        message["board_us"], message["source"] = self.board_us, self.source
        message = _with_places(message, self.placement, self.placed)
        if arrays:
            message |= self._image_facts() | self._raw_facts()
        return message | self._truth_facts(message)

    def _image_facts(self) -> dict[str, Any]:
        if self.solver_image is None or self.image is None:
            return {}
        facts: dict[str, Any] = {"image_s_per_m": self.image.tolist(), "image_is": self.image_is}
        facts |= {"peak_s_per_m": None, "peak_mm": None, "places": None}
        if self.peak is not None:
            facts |= {"peak_s_per_m": self.peak.value, "peak_mm": list(self.peak.place_mm)}
        if self.places_mm is not None:
            facts["places"] = [{"x_mm": x, "y_mm": y} for x, y in self.places_mm.tolist()]
        return facts

    def _raw_facts(self) -> dict[str, Any]:
        raw = self.raw
        if raw is None:
            return {}
        return {
            "voltage_v": [v if np.isfinite(v) else None for v in raw.voltage_v.tolist()],
            "quality": raw.quality.tolist(),
            "scan_us": raw.scan_us,
            "quiet": raw.untouched,
        }

    def _truth_facts(self, message: dict[str, Any]) -> dict[str, Any]:
        """The true touches; and how far off each found one is, null for a false one."""
        if self.true is None:
            return {}
        found = message["touches"] if message["touches"] is not None else message.get("places")
        for number, one in enumerate(found or ()):
            one["error_mm"] = (self.errors_mm or {}).get(number)
        return {"true": [true_table(t) for t in self.true]}

    def __repr__(self) -> str:
        parts = (("image", self.solver_image), ("raw", self.raw))
        shown = (
            f"refused: {self.refused}"
            if self.refused
            else f"touches: {places_text(self.touches)}"
            if self.has_touches
            else ", ".join(name for name, part in parts if part is not None)
        )
        return f"<Frame {self.number} at {self.time_s:.3f} s, {shown}>"

    def _repr_html_(self) -> str:
        return touches_html(f"frame {self.number}, {self.time_s:.3f} s", self.touches)

    def _repr_png_(self) -> bytes | None:
        """Return a picture, if the model is known and matplotlib is installed."""
        if self.known is None or find_spec("matplotlib") is None:
            return None
        axes = import_module("eitskin.view.touch_axes")  # of a later module, as a result's picture
        png: bytes = axes.touches_png(self.known.model, self.touches, self.image, self.true or ())
        return png


def _placed(
    placement: Placement | None, touches: Sequence[LocatedTouch]
) -> tuple[PlacedTouch, ...] | None:
    return None if placement is None else tuple(map(placement.place, touches))


def _with_places(
    message: dict[str, Any], placement: Placement | None, placed: Sequence[PlacedTouch] | None
) -> dict[str, Any]:
    """``message`` with the link, and its touches with where they are in the link's frame."""
    for touch, place in zip(message["touches"] or (), placed or (), strict=False):
        touch |= place.as_dict()
    return message | {"link": None if placement is None else placement.link}


Message = Frame | DriveReport | Notice
