"""The packets from a board. Each has the fields of its row in ``link_table``, and the properties
that Python adds. ``payloads`` reads their bytes; ``commands`` holds the packets to a board.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import IntArray
from eitskin.core.diagnostics import names, words
from eitskin.core.diagnostics_table import Touch
from eitskin.core.gestures import GestureEvent
from eitskin.device.wire.link_table import (
    Drive,
    DriveTouch,
    DriveTouchesHead,
    FaultCode,
    FaultPacket,
    HashesPacket,
    InfoPacket,
    RawFlags,
    ReplyPacket,
    ReplyStatus,
    Setting,
    SolvedPacket,
    StatsPacket,
)

ELECTRODE_FAULTS = frozenset(
    (FaultCode.ELECTRODE_OPEN, FaultCode.BRIDGED, FaultCode.ELECTRODE_NOISY)
)
DOUBTFUL_FAULTS = frozenset(  # rise after RAISE_FRAMES
    FaultCode[name]
    for name in ("ELECTRODE_NOISY", "MODEL_MISMATCH", "STALE_REFERENCE", "UNLIKE_MODEL")
)
# faults that frames show and CLEAR_FRAMES frames clear; each electrode has its own faults
FOUND_FAULTS = ELECTRODE_FAULTS | DOUBTFUL_FAULTS | {FaultCode.SATURATED}


@dataclass(frozen=True)
class BoardInfo(InfoPacket):
    """The board, its model and its settings. ``faults``: bit k for fault number k."""

    @property
    def firmware_text(self) -> str:
        return ".".join(map(str, self.firmware))

    @property
    def has_model(self) -> bool:
        return self.model_bytes > 0

    @property
    def noise_floor_v(self) -> float:
        """The board's own ``noise_floor_v``, to the bit: what its converter's steps alone make of
        noise. Without other noise every period is rounded alike: only different phases average."""
        if self.frames_given or 0 in (self.samples, self.sample_rate_hz):
            return 0.0
        periods = round(self.excitation_millihz * self.samples / (1000 * self.sample_rate_hz))
        phases = np.float32(self.samples // math.gcd(self.samples, periods))
        step_nv = np.float32(self.volts_per_code_nv)
        return float(np.sqrt(step_nv * step_nv / (np.float32(6) * phases)) * np.float32(1e-9))

    @property
    def gain(self) -> float:
        """Volts at the converter per volt between the electrodes; 0: not known."""
        return self.gain_ppm / 1e6

    @property
    def frames_given(self) -> bool:
        """Its frames are another instrument's, of whose scan nothing is known."""
        return self.slot_us == 0

    @property
    def measured_rows(self) -> int:
        """Return the number of measurements in a frame that is not a check: all rows, or one of
        each reciprocal pair."""
        return self.n_rows if self.check_every == 1 else self.n_folded

    @property
    def frame_us(self) -> int:
        """Return the time from one frame to the next on the board's clock, as far as the settings
        determine it."""
        return max(self.frame_period_us, self.measured_rows * self.slot_us)

    @property
    def fault_codes(self) -> tuple[FaultCode, ...]:
        return tuple(code for code in FaultCode if self.faults >> code & 1)

    @property
    def setting_names(self) -> list[str]:
        """The owner's settings that are on: "keep-current"."""
        return [str(one.name).lower().replace("_", "-") for one in Setting if one & self.settings]

    @property
    def drive_name(self) -> str:
        """Return whether current may flow: "on", "off", "silent" or "tripped"."""
        return Drive(self.drive).name.lower() if self.drive in list(Drive) else str(self.drive)

    def as_dict(self) -> dict[str, Any]:
        values = asdict(self) | {
            "firmware": self.firmware_text,
            "protocol_hash": f"{self.protocol_hash:016x}",
        }
        return values | {
            "model_crc": f"{self.model_crc:08x}",
            "drive": self.drive_name,
            "settings": self.setting_names,
            "faults": [code.name.lower() for code in self.fault_codes],
        }


@dataclass(frozen=True)
class BoardHashes(HashesPacket):
    """SHA-256 of the model in use and of the program, zero if there is none."""

    def as_dict(self) -> dict[str, str | None]:
        """For JSON: hexadecimal, None if there is none."""
        both = {"model": self.model, "firmware": self.firmware}
        return {name: one.hex() if any(one) else None for name, one in both.items()}


@dataclass(frozen=True)
class Reply(ReplyPacket):
    """How the command with this request number ended; ``explain.reply_text`` puts it in words."""

    @property
    def ok(self) -> bool:
        return self.status == ReplyStatus.OK


@dataclass(frozen=True, eq=False)
class RawFrame:
    """One scanned frame: ``voltage_v`` (m,) float32 exactly as the board's core got it, NaN for
    rows that cannot be used; ``quality`` (m,) bits of ``Quality``. ``frame`` and ``time_us`` (when
    its scan began) wrap at 2^32.
    """

    frame: int
    time_us: int
    scan_us: int
    flags: int
    voltage_v: npt.NDArray[np.float32]
    quality: npt.NDArray[np.uint8]

    @property
    def untouched(self) -> bool:
        """Return whether this frame belongs to a tare."""
        return bool(self.flags & RawFlags.REFERENCE)


@dataclass(frozen=True)
class Solved(SolvedPacket):
    """The report of the board's core on a frame and its solve, and the times. ``status`` is 0 or an
    eits_status (negative), ``stop`` one of ``STOPS``."""

    @property
    def unsolved(self) -> bool:
        """The frame was not solved: its touches are those that drives follow."""
        return self.status == 0 and self.stop == "iterations" and self.iterations == 0

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the same names, without the underscore of ``lambda_``; diagnostics by name."""
        values = {key.rstrip("_"): value for key, value in asdict(self).items()}
        return values | {"diagnostics": list(names(self.diagnostics)), "found": list(words(self))}


@dataclass(frozen=True, eq=False)
class SolvedImage:
    """A frame's image (n,) float32 S/m on the model's pixels, as the board computed it."""

    solved: Solved
    image: npt.NDArray[np.float32]

    @property
    def frame(self) -> int:
        return self.solved.frame


@dataclass(frozen=True)
class SolvedTouches:
    """A frame's touches, strongest first, as the board found them."""

    solved: Solved
    touches: tuple[Touch, ...]

    @property
    def frame(self) -> int:
        return self.solved.frame


@dataclass(frozen=True)
class DriveTouches:
    """Touches after a drive, in the order in which they came."""

    head: DriveTouchesHead
    touches: tuple[DriveTouch, ...]

    @property
    def frame(self) -> int:
        return self.head.frame


@dataclass(frozen=True)
class FrameEvents:
    """The events that the board's core reports for a frame whose scan began at ``time_us``."""

    frame: int
    time_us: int
    events: tuple[GestureEvent, ...]


@dataclass(frozen=True)
class BoardStats(StatsPacket):
    """The board's counters; ``stages`` by ``STAGES``."""

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True, eq=False)
class ProbedBurst:
    """A burst of a fixed row: its ``codes`` (n,), from ``start_us`` on; its electrodes had been
    joined at ``switched_us``."""

    request: int
    start_us: int
    switched_us: int
    lost: bool
    codes: IntArray


@dataclass(frozen=True)
class Fault(FaultPacket):
    """A fault that rose or went; ``explain.fault_text`` puts it in words."""


FromBoard = (
    BoardInfo
    | BoardHashes
    | ProbedBurst
    | Reply
    | RawFrame
    | SolvedImage
    | SolvedTouches
    | DriveTouches
    | FrameEvents
    | BoardStats
    | Fault
)
