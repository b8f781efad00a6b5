"""Check that a board computes the same as this host: its raw frames go through the same core, and
the bits of images and touches are compared with the board's."""

from collections.abc import Iterable
from dataclasses import asdict, astuple, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray
from eitskin.core.diagnostics_table import DIAGNOSTICS, Touch
from eitskin.core.fast import AlignedFrame, FastCore
from eitskin.core.gestures import Gestures, event_numbers
from eitskin.core.results import Info, Options, Reconstruction
from eitskin.device.client import Device
from eitskin.device.known_model import KnownModel, board_options, need_model
from eitskin.device.recordings.recording import FileTransport, recorded_kinds, recorded_options
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import Quality, RawFlags
from eitskin.device.wire.packets import BoardInfo, DriveTouches, RawFrame, Solved
from eitskin.errors import FrameError
from eitskin.session.assemble import read_frames
from eitskin.session.checks.drives_twin import DrivesTwin
from eitskin.session.frame import DriveReport, Frame, Message
from eitskin.solve.reconstructor import Reconstructor


@dataclass
class HostCheck:
    """The number of compared frames, and the result of the comparison.

    ``same``: every bit of the image, and of the touches but their ids, which count on from whatever
    the board did before, of the events that these touches make, and all that was found in the
    frame. ``different``: numbers of frames that are not. ``inconclusive``: frames whose solve,
    touches or reference come from one that was lost on the way. ``alone``: solved on the board
    without its raw frame here. ``drives``: after which the touches are the same.
    """

    same: int = 0
    images: int = 0
    touches: int = 0
    events: int = 0
    different: list[int] = field(default_factory=list)
    inconclusive: int = 0
    alone: int = 0
    drives: int = 0
    drives_different: int = 0
    worst: float = 0.0

    @property
    def compared(self) -> int:
        return self.same + len(self.different)

    def as_dict(self) -> dict[str, Any]:
        wrong = bool(self.different) or self.drives_different > 0
        return asdict(self) | {"same_bits": self.compared > 0 and not wrong}

    def text(self) -> str:
        if not self.compared:
            line = "same bits: inconclusive; no frame could be compared"
        elif self.different:
            first = self.different[0]
            line = (
                f"same bits: NO, {len(self.different)} of {self.compared} frames differ, the first"
                f" is {first}; greatest difference {self.worst:.2e} of the peak"
            )
        else:
            line = f"same bits: yes, {self.images} images and the touches of {self.touches} frames"
            line += f"; {self.events} events" if self.events else ""
            line += f"; the touches after {self.drives} drives" if self.drives else ""
        if self.drives_different:
            line = f"same bits: NO, of touches after {self.drives_different} drives; {line}"
        return line + (
            f"; {self.inconclusive} frames after losses are inconclusive"
            if self.inconclusive
            else ""
        )


class HostTwin:
    """This host's core, kept in step with a board's; with ``board`` also touches after drives."""

    def __init__(self, known: KnownModel, options: Options, board: BoardInfo | None = None) -> None:
        self._core = Reconstructor(known.model, blob=known.blob, options=options)
        assert self._core.c_engine is not None
        self._fast = FastCore(self._core.c_engine)
        self._drives: DrivesTwin | None = None
        if board is not None:
            self._drives = DrivesTwin(self._fast, known.model.protocol, board)
        self._from_before = options.warm_start or options.reference_frames > 0
        self._untouched: list[RawFrame] = []
        self._tared = self._sure = self._lost = self._events_known = False
        self._gestures = Gestures()
        self.check = HostCheck()

    def take_all(self, messages: Iterable[Message]) -> HostCheck:
        """Take everything of a stream or recording, tare included."""
        for message in messages:
            if isinstance(message, Frame):
                self.take(message)
            elif isinstance(message, DriveReport):
                self.hear(message.packet)
            elif isinstance(message.cause, LinkEvent):
                self.lost()
        return self.check

    def lost(self) -> None:
        """Note that something is missing here: perhaps a frame from which the next solve began, or
        an untouched one."""
        self._sure, self._lost, self._events_known = False, True, False
        if self._drives is not None:
            self._drives.forget()

    def hear(self, packet: DriveTouches) -> None:
        """Touches after a drive; their frame comes later."""
        if self._drives is not None:
            self._drives.hear(packet)

    def take(self, frame: Frame) -> Reconstruction | None:
        """The next frame; returns what this host makes of it, None if the board solved nothing."""
        if frame.raw is not None and frame.raw.untouched:
            self._untouched.append(frame.raw)
            return None
        if self._untouched:
            self._tare()
        self._lost = False
        tracked = frame.raw is not None and bool(frame.raw.flags & RawFlags.ALIGNED)
        aligned = self._drive(frame.raw) if tracked else None
        if frame.info is None:
            return None
        if frame.raw is None:
            self.check.alone += 1
            self._sure = False
            return None
        if not self._tared or (tracked and aligned is None):
            self.check.inconclusive += 1
            return None
        if aligned is not None and not aligned.trusted:
            self._compare_followed(frame)
            return None
        return self._compare(frame, frame.raw, None if aligned is None else aligned.volts)

    def _drive(self, raw: RawFrame | None) -> AlignedFrame | None:
        """The drives of a frame that the board aligned; None if some are missing here."""
        twin = self._drives
        if twin is None or raw is None or not self._tared:
            return None
        aligned = twin.take(raw)
        self.check.drives, self.check.drives_different = twin.same, twin.different
        return aligned

    def _tare(self) -> None:
        untouched, self._untouched = self._untouched, []
        if self._lost:
            self._tared = False
            return
        self._core.mask_rows(
            np.all([(raw.quality & Quality.MASKED) != 0 for raw in untouched], axis=0)
        )
        try:
            self._core.tare(np.array([raw.voltage_v for raw in untouched]))
        except FrameError:
            self._tared = False
            return
        self._core.forget()
        self._fast.forget()
        self._gestures.reset()
        self._tared = self._sure = self._events_known = True

    def _compare_followed(self, frame: Frame) -> None:
        """A frame that was not solved has the touches that drives follow."""
        assert self._drives is not None
        touched = not frame.has_touches or same_touches(self._drives.followed(), frame.touches)
        self._count(frame, self._same_events(frame) and touched, 1.0, from_before=True)

    def _compare(
        self, frame: Frame, raw: RawFrame, aligned: AnyArray | None
    ) -> Reconstruction | None:
        volts = raw.voltage_v if aligned is None else aligned
        try:
            result = self._core.reconstruct(volts, touches=aligned is not None or frame.has_touches)
        except FrameError:
            self._count(frame, frame.refused is not None, 1.0, self._from_before)
            return None
        if self._drives is not None and aligned is not None:
            result = self._drives.found(result)
        elif frame.has_touches:
            result = self._fast.followed(result)
        assert frame.info is not None
        options, difference = self._core.options, 1.0
        same = frame.refused is None and same_diagnostics(result.info, raw, frame.info, options)
        if same and frame.solver_image is not None:
            same = same_bits(result.solver_image, frame.solver_image)
            difference = _difference(result.solver_image, frame.solver_image)
        touched = not frame.has_touches or same_touches(result.touches, frame.touches)
        touched = self._same_events(frame) and touched
        from_before = self._from_before or (same and not touched)
        self._count(frame, same and touched, difference, from_before)
        return result

    def _same_events(self, frame: Frame) -> bool:
        """Return whether the board's events are what its touches give here; known only where all
        touches since the tare came here."""
        if frame.board_events is None or not frame.has_touches or frame.refused is not None:
            self._events_known = self._events_known and frame.refused is not None
            return True
        here = self._gestures.update(frame.touches, frame.board_us)
        if not self._events_known:
            return True
        self.check.events += len(here)
        return event_numbers(here).tobytes() == event_numbers(frame.board_events).tobytes()

    def _count(self, frame: Frame, same: bool, difference: float, from_before: bool) -> None:
        """Count a comparison. ``from_before``: a difference may come from earlier frames, because
        one may be missing here."""
        check = self.check
        if same:
            check.same += 1
            check.images += frame.solver_image is not None
            check.touches += frame.has_touches
        elif self._sure or not from_before:
            check.different.append(frame.number)
            check.worst = max(check.worst, difference)
        else:
            check.inconclusive += 1


def check_recording(path: Path, model: Path | None) -> tuple[HostCheck, bool]:
    """The recording ``path`` compared with this host's core; also whether it notes the solver's
    options (else the model's own are taken)."""
    options = recorded_options(path)
    with Device(FileTransport(path)) as device:
        known = need_model(device.board, model, str(path), "the comparison")
        used = board_options(known.model, device.board) if options is None else options
        twin = HostTwin(known, used, device.board)
        return twin.take_all(read_frames(device, recorded_kinds(path))), options is not None


def same_bits(one: AnyArray, other: npt.NDArray[np.float32]) -> bool:
    """Return whether two images are the same float32 numbers, bit for bit."""
    return one.astype("<f4").tobytes() == other.astype("<f4").tobytes()


def same_touches(one: tuple[Touch, ...], other: tuple[Touch, ...]) -> bool:
    """Return whether two lists of touches are the same numbers in the same order, ids apart."""
    return [_numbers(touch) for touch in one] == [_numbers(touch) for touch in other]


def same_diagnostics(info: Info, raw: RawFrame, solved: Solved, options: Options) -> bool:
    """Return whether this host's core has the same diagnostics of a frame as the board. The core
    gets saturated rows as NaN; the quality of the raw frame marks them."""
    only_saturated = raw.quality & (Quality.SATURATED | Quality.MASKED) == Quality.SATURATED
    lost = int(np.count_nonzero(only_saturated))
    saturated = options.diagnostics & 1 << DIAGNOSTICS.index("saturated") if lost else 0
    same = ("outliers", "open_electrodes", "bridged_electrodes", "noisy_electrodes")
    return (
        info.diagnostics | saturated == solved.diagnostics
        and info.saturated + lost == solved.saturated
        and all(getattr(info, name) == getattr(solved, name) for name in same)
    )


def _numbers(touch: Touch) -> bytes:
    return np.array(astuple(touch)[1:], dtype="<f4").tobytes()


def _difference(one: AnyArray, other: npt.NDArray[np.float32]) -> float:
    if one.shape != other.shape:
        return 1.0
    peak = float(np.abs(other).max()) or 1.0
    return float(np.abs(one.astype(np.float64) - other).max()) / peak
