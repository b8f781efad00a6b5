"""What travels from a board: each payload as a frozen dataclass. csrc/include/eitskin/link.h is the
contract; a test holds the names here against it. Their bytes are in ``payloads``; commands, the
other way, in ``commands``.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.diagnostics import names, words
from eitskin.core.results import Touch

LINK_VERSION = 3
# EITS_FAULT_RAISE_FRAMES: in a row, until what a moving touch may look like for a frame is a fault
RAISE_FRAMES = 3
CLEAR_FRAMES = 8  # EITS_FAULT_CLEAR_FRAMES: in a row without it, until what was found is over
MAX_PAYLOAD = 16384
STAGES = ("scan", "demodulate", "solve", "touches", "send", "frame")


class PacketType(IntEnum):
    """eits_packet_type: below 0x80 from the board, from there on to it."""

    INFO = 0x01
    REPLY = 0x02
    RAW = 0x10
    IMAGE = 0x11
    TOUCHES = 0x12
    STATS = 0x13
    FAULT = 0x14
    RECORDING = 0x70
    GET_INFO = 0x80
    STREAM = 0x81
    TARE = 0x82
    SCAN = 0x83
    SOLVER = 0x84
    MODEL_BEGIN = 0x85
    MODEL_DATA = 0x86
    MODEL_COMMIT = 0x87
    GET_STATS = 0x88
    MASK_ROW = 0x89
    RESET = 0x8A
    SELF_TEST = 0x8B
    CLEAR_FAULTS = 0x8C


class ReplyStatus(IntEnum):
    """eits_reply_status: how a command ended."""

    OK = 0
    UNKNOWN_COMMAND = 1
    LENGTH = 2
    RANGE = 3
    NO_MODEL = 4
    NOT_TARED = 5
    BUSY = 6
    MODEL_SIZE = 7
    MODEL_INVALID = 8
    MODEL_SCAN = 9
    MODEL_CRC = 10
    OFFSET = 11
    FLASH = 12
    CORE = 13
    PERIODS = 14
    TOO_FAST = 15
    SELF_TEST = 16


class FaultCode(IntEnum):
    """eits_fault."""

    NO_MODEL = 1
    ELECTRODE_OPEN = 2
    SATURATED = 3
    DEADLINE = 4
    RECIPROCITY = 5
    SOLVER = 6
    SCAN_STALLED = 7
    CRASH = 8
    WATCHDOG = 9
    BUS = 10
    BRIDGED = 11
    ELECTRODE_NOISY = 12
    MODEL_MISMATCH = 13
    STALE_REFERENCE = 14


# faults that frames show, and that go after CLEAR_FRAMES; of those of an electrode each has its own
FOUND_FAULTS = frozenset(
    (FaultCode.ELECTRODE_OPEN, FaultCode.SATURATED, FaultCode.BRIDGED, FaultCode.ELECTRODE_NOISY,
    FaultCode.MODEL_MISMATCH,
     FaultCode.STALE_REFERENCE)
)  # fmt: skip
DOUBTFUL_FAULTS = frozenset(
    (FaultCode.ELECTRODE_NOISY, FaultCode.MODEL_MISMATCH, FaultCode.STALE_REFERENCE)
)  # rise after RAISE_FRAMES
ELECTRODE_FAULTS = frozenset(
    (FaultCode.ELECTRODE_OPEN, FaultCode.BRIDGED, FaultCode.ELECTRODE_NOISY)
)


class Quality(IntFlag):
    """eits_quality: bits of a row's quality byte."""

    SATURATED = 1
    UNSETTLED = 2
    RECIPROCITY = 4
    COPIED = 8
    OPEN = 16
    MASKED = 32


class RawFlags(IntFlag):
    """EITS_RAW_*."""

    QUIET = 1
    RECIPROCAL = 2
    CHECK = 4


class Stream(IntFlag):
    """EITS_STREAM_*: what a board is asked to send of each frame."""

    RAW = 1
    IMAGE = 2
    TOUCHES = 4


@dataclass(frozen=True)
class BoardInfo:
    """eits_packet_info: the board, its model and its settings. ``faults``: bit k for fault number
    k."""

    request: int
    firmware: tuple[int, int, int]
    board: str
    serial: str
    f_cpu_hz: int
    electrodes: int
    bank_bytes: int
    data_bytes: int
    model_bytes: int
    model_crc: int
    protocol_hash: int
    n_electrodes: int
    n_rows: int
    n_folded: int
    rank: int
    n_pixels: int
    nx: int
    ny: int
    storage: int
    bank: int
    excitation_millihz: int
    sample_rate_hz: int
    samples: int
    settle_us: int
    slot_us: int
    check_every: int
    streaming: int
    every: int
    tared: int
    frame_period_us: int
    faults: int
    volts_per_code_nv: int

    @property
    def firmware_text(self) -> str:
        return ".".join(map(str, self.firmware))

    @property
    def has_model(self) -> bool:
        return self.model_bytes > 0

    @property
    def measured_rows(self) -> int:
        """Measurements in a frame that is no check: all rows, or only one of each reciprocal
        pair."""
        return self.n_rows if self.check_every == 1 else self.n_folded

    @property
    def frame_us(self) -> int:
        """From one frame to the next, on the board's clock, as far as the settings tell."""
        return max(self.frame_period_us, self.measured_rows * self.slot_us)

    @property
    def fault_codes(self) -> tuple[FaultCode, ...]:
        return tuple(code for code in FaultCode if self.faults >> code & 1)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        values = asdict(self) | {
            "firmware": self.firmware_text,
            "protocol_hash": f"{self.protocol_hash:016x}",
        }
        return values | {
            "model_crc": f"{self.model_crc:08x}",
            "faults": [code.name.lower() for code in self.fault_codes],
        }


@dataclass(frozen=True)
class Reply:
    """eits_packet_reply: how the command with this request number ended; ``explain.reply_text``
    puts it in words."""

    request: int
    command: int
    status: int
    detail: tuple[int, int] = (0, 0)

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
    def quiet(self) -> bool:
        """Of a tare."""
        return bool(self.flags & RawFlags.QUIET)


@dataclass(frozen=True)
class Solved:
    """eits_packet_solved: what the board's core says of a frame and its solve, and the times.
    ``status`` is 0 or an eits_status (negative), ``stop`` one of ``core.results.STOPS``,
    ``diagnostics`` as in ``core.diagnostics``; ``saturated`` also counts what the converter
    tells."""

    frame: int
    time_us: int
    solve_us: int
    touch_us: int
    age_us: int
    count: int
    status: int
    stop: str
    masked: int
    iterations: int
    nonzeros: int
    macs: int
    touch_macs: int
    lambda_: float
    lambda_max: float
    lambda_noise: float
    gap_rel: float
    residual: float
    data_norm: float
    diagnostics: int = 0
    saturated: int = 0
    outliers: int = 0
    model_mismatch: float = 0.0
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()
    noisy_electrodes: tuple[int, ...] = ()

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
class StageStats:
    """Times of one stage in us; ``p99_us`` is the upper edge of its bin, an eighth of an octave
    wide."""

    count: int
    last_us: int
    p99_us: int
    worst_us: int


@dataclass(frozen=True)
class BoardStats:
    """eits_packet_stats: the board's counters; ``stages`` by ``STAGES``."""

    request: int
    uptime_ms: int
    frames_scanned: int
    frames_solved: int
    packets_sent: int
    packets_dropped: int
    deadlines_missed: int
    slots_repeated: int
    outliers: int
    link_packets: int
    link_crc_errors: int
    link_framing_errors: int
    link_overruns: int
    stack_bytes: int
    stack_used: int
    workspace_bytes: int
    workspace_used: int
    stages: dict[str, StageStats]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Fault:
    """eits_packet_fault: a fault that rose or went; ``explain.fault_text`` puts it in words."""

    code: int
    raised: bool
    frame: int
    index: int
    value: int
    words: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)


FromBoard = BoardInfo | Reply | RawFrame | SolvedImage | SolvedTouches | BoardStats | Fault
