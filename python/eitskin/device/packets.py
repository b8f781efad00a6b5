"""What travels from a board: each payload as a frozen dataclass. csrc/include/eitskin/link.h is the contract; a test holds
names, sizes and places here against it. Commands, the other way, are in ``commands``.
"""

from __future__ import annotations

import struct
from dataclasses import asdict, dataclass
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.results import STOPS, Touch

LINK_VERSION = 1
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


class MalformedPacket(ValueError):
    """A packet whose checksum is right but whose payload is not of its type: of a board that does not keep to its version."""


@dataclass(frozen=True)
class BoardInfo:
    """eits_packet_info: the board, its model and its settings. ``faults``: bit k for fault number k."""

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
        """Measurements in a frame that is no check: all rows, or only one of each reciprocal pair."""
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
        values = asdict(self) | {"firmware": self.firmware_text, "protocol_hash": f"{self.protocol_hash:016x}"}
        return values | {"model_crc": f"{self.model_crc:08x}", "faults": [code.name.lower() for code in self.fault_codes]}


@dataclass(frozen=True)
class Reply:
    """eits_packet_reply: how the command with this request number ended; ``explain.reply_text`` puts it in words."""

    request: int
    command: int
    status: int
    detail: tuple[int, int] = (0, 0)

    @property
    def ok(self) -> bool:
        return self.status == ReplyStatus.OK


@dataclass(frozen=True, eq=False)
class RawFrame:
    """One scanned frame: ``voltage_v`` (m,) float32 exactly as the board's core got it, NaN for rows that cannot be used;
    ``quality`` (m,) bits of ``Quality``. ``frame`` and ``time_us`` (when its scan began) wrap at 2^32."""

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
    """eits_packet_solved: what the board's core says of a frame's solve, and the times. ``status`` is 0 or an eits_status
    (negative), ``stop`` one of ``core.results.STOPS``."""

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

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the same names, without the underscore of ``lambda_``."""
        return {key.rstrip("_"): value for key, value in asdict(self).items()}


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
    """Times of one stage in us; ``p99_us`` is the upper edge of its bin, an eighth of an octave wide."""

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


INFO_STRUCT = struct.Struct("<I4s16s24sIIIIIIQIIIIIIIIIIIHHIHHHHIII")
REPLY_STRUCT = struct.Struct("<IHHii")
RAW_STRUCT = struct.Struct("<IIIHH")
SOLVED_STRUCT = struct.Struct("<IIIIIHHHHIIIIffffff")
TOUCH_STRUCT = struct.Struct("<Ifffff")
STAGE_STRUCT = struct.Struct("<IIII")
STATS_STRUCT = struct.Struct("<16I" + 4 * len(STAGES) * "I")
FAULT_STRUCT = struct.Struct("<HHIii5I")

FromBoard = BoardInfo | Reply | RawFrame | SolvedImage | SolvedTouches | BoardStats | Fault


def _exactly(payload: bytes, size: int, what: str) -> None:
    if len(payload) != size:
        raise MalformedPacket(f"{what}: {len(payload)} bytes, not {size}")


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")


def parse_info(payload: bytes) -> BoardInfo:
    _exactly(payload, INFO_STRUCT.size, "INFO")
    request, firmware, board, serial, *rest = INFO_STRUCT.unpack(payload)
    return BoardInfo(request, tuple(firmware[:3]), _text(board), _text(serial), *rest)


def build_info(info: BoardInfo) -> bytes:
    values = list(asdict(info).values())
    values[1:4] = [bytes([*info.firmware, 0]), info.board.encode("ascii"), info.serial.encode("ascii")]
    return INFO_STRUCT.pack(*values)


def parse_reply(payload: bytes) -> Reply:
    _exactly(payload, REPLY_STRUCT.size, "REPLY")
    request, command, status, first, second = REPLY_STRUCT.unpack(payload)
    return Reply(request, command, status, (first, second))


def build_reply(reply: Reply) -> bytes:
    return REPLY_STRUCT.pack(reply.request, reply.command, reply.status, *reply.detail)


def parse_raw(payload: bytes) -> RawFrame:
    if len(payload) < RAW_STRUCT.size:
        raise MalformedPacket(f"RAW: {len(payload)} bytes are too few")
    frame, time_us, scan_us, rows, flags = RAW_STRUCT.unpack_from(payload)
    _exactly(payload, RAW_STRUCT.size + 5 * rows, "RAW")
    volts = np.frombuffer(payload, dtype="<f4", count=rows, offset=RAW_STRUCT.size)
    quality = np.frombuffer(payload, dtype=np.uint8, offset=RAW_STRUCT.size + 4 * rows)
    return RawFrame(frame, time_us, scan_us, flags, volts, quality)


def build_raw(raw: RawFrame) -> bytes:
    head = RAW_STRUCT.pack(raw.frame, raw.time_us, raw.scan_us, len(raw.voltage_v), raw.flags)
    return head + raw.voltage_v.astype("<f4").tobytes() + raw.quality.astype(np.uint8).tobytes()


def _parse_solved(payload: bytes, what: str, each: int) -> Solved:
    if len(payload) < SOLVED_STRUCT.size:
        raise MalformedPacket(f"{what}: {len(payload)} bytes are too few")
    f, t, solve, touch, age, count, status, stop, *rest = SOLVED_STRUCT.unpack_from(payload)
    _exactly(payload, SOLVED_STRUCT.size + each * count, what)
    if stop >= len(STOPS):
        raise MalformedPacket(f"{what}: stop {stop} is not known")
    return Solved(f, t, solve, touch, age, count, -status, STOPS[stop], *rest)


def _build_solved(solved: Solved) -> bytes:
    values = asdict(solved) | {"status": -solved.status, "stop": STOPS.index(solved.stop)}
    return SOLVED_STRUCT.pack(*values.values())


def parse_image(payload: bytes) -> SolvedImage:
    solved = _parse_solved(payload, "IMAGE", 4)
    return SolvedImage(solved, np.frombuffer(payload, dtype="<f4", offset=SOLVED_STRUCT.size))


def build_image(image: SolvedImage) -> bytes:
    return _build_solved(image.solved) + image.image.astype("<f4").tobytes()


def parse_touches(payload: bytes) -> SolvedTouches:
    solved = _parse_solved(payload, "TOUCHES", TOUCH_STRUCT.size)
    found = TOUCH_STRUCT.iter_unpack(payload[SOLVED_STRUCT.size :])
    return SolvedTouches(solved, tuple(Touch(*values) for values in found))


def build_touches(touches: SolvedTouches) -> bytes:
    each = (TOUCH_STRUCT.pack(*asdict(touch).values()) for touch in touches.touches)
    return _build_solved(touches.solved) + b"".join(each)


def parse_stats(payload: bytes) -> BoardStats:
    _exactly(payload, STATS_STRUCT.size, "STATS")
    values = STATS_STRUCT.unpack(payload)
    stages = {name: StageStats(*values[16 + 4 * k : 20 + 4 * k]) for k, name in enumerate(STAGES)}
    return BoardStats(*values[:16], stages)  # type: ignore[call-arg]


def build_stats(stats: BoardStats) -> bytes:
    *head, _ = (getattr(stats, name) for name in BoardStats.__dataclass_fields__)
    times = (asdict(stats.stages[name]).values() for name in STAGES)
    return STATS_STRUCT.pack(*head, *(value for stage in times for value in stage))


def parse_fault(payload: bytes) -> Fault:
    _exactly(payload, FAULT_STRUCT.size, "FAULT")
    code, raised, frame, index, value, *words = FAULT_STRUCT.unpack(payload)
    return Fault(code, bool(raised), frame, index, value, (words[0], words[1], words[2], words[3], words[4]))


def build_fault(fault: Fault) -> bytes:
    return FAULT_STRUCT.pack(fault.code, fault.raised, fault.frame, fault.index, fault.value, *fault.words)


_PARSERS = {
    PacketType.INFO: parse_info,
    PacketType.REPLY: parse_reply,
    PacketType.RAW: parse_raw,
    PacketType.IMAGE: parse_image,
    PacketType.TOUCHES: parse_touches,
    PacketType.STATS: parse_stats,
    PacketType.FAULT: parse_fault,
}


def parse(packet_type: int, payload: bytes) -> FromBoard | None:
    """The payload of a packet from a board; None for a type that is not known, which is passed over.

    Raises:
        MalformedPacket: the payload is not of its type.
    """
    parser = _PARSERS.get(packet_type)  # type: ignore[call-overload]
    return None if parser is None else parser(payload)
