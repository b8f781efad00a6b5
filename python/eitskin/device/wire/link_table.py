"""Packets of the link: their numbers, and their fields as they lie on the wire. Written by
tables/make_tables.py from tables/link.toml.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar

from eitskin.device.wire.layout import Command, Layout, Payload

LINK_VERSION = 6
LINK_MAX_PAYLOAD = 16384
LIMIT_KEPT = 4294967295
FAULT_RAISE_FRAMES = 3
FAULT_CLEAR_FRAMES = 8
# eits_stage: Stages that are timed.
STAGES = (
    "scan",
    "demodulate",
    "solve",
    "touches",
    "send",
    "frame",
)


class PacketType(IntEnum):
    """eits_packet_type: Below 0x80 from the board, from there on to it."""

    # the board, its model and its settings
    INFO = 0x1
    # how a command ended
    REPLY = 0x2
    # a scanned frame
    RAW = 0x10
    # a frame's image
    IMAGE = 0x11
    # a frame's touches
    TOUCHES = 0x12
    # what a frame's touches amounted to
    EVENTS = 0x15
    # the board's counters
    STATS = 0x13
    # a fault that rose or went
    FAULT = 0x14
    # SHA-256 of the model and of the firmware
    HASHES = 0x16
    # never on a wire: the first packet of an .eits file
    RECORDING = 0x70
    # send an INFO
    GET_INFO = 0x80
    # what to send of each frame
    STREAM = 0x81
    # take the reference
    TARE = 0x82
    # how frames are scanned; forgets the reference
    SCAN = 0x83
    # the solver's options
    SOLVER = 0x84
    # stop the scan and erase the bank that is not in use
    MODEL_BEGIN = 0x85
    # bytes of the model
    MODEL_DATA = 0x86
    # use the model that was sent
    MODEL_COMMIT = 0x87
    # send a STATS
    GET_STATS = 0x88
    # leave a row out, or use it again
    MASK_ROW = 0x89
    # restart the board
    RESET = 0x8A
    # run the model's golden frame
    SELF_TEST = 0x8B
    # forget the faults
    CLEAR_FAULTS = 0x8C
    # the host is there, or goes and the current stops; not answered
    KEEPALIVE = 0x8D
    # the owner's settings, kept in flash
    SETTINGS = 0x8E
    # send HASHES
    GET_HASHES = 0x8F


class ReplyStatus(IntEnum):
    """eits_reply_status: How a command ended, and what `detail` of the reply adds."""

    # MODEL_BEGIN: [0] the offset to go on from
    OK = 0
    # no command has this packet type
    UNKNOWN_COMMAND = 1
    # [0] bytes of payload that are expected
    LENGTH = 2
    # [0] offset in the payload of the field out of range; [1] the limit it broke
    RANGE = 3
    # no model is in use: send one first
    NO_MODEL = 4
    # there is no reference: send a TARE first
    NOT_TARED = 5
    # [0] type of the command under way
    BUSY = 6
    # [0] most bytes that a bank, a packet or the memory holds
    MODEL_SIZE = 7
    # [0] eits_status
    MODEL_INVALID = 8
    # [0] electrodes that the protocol needs; [1] electrodes there are
    MODEL_SCAN = 9
    # what arrived is not what MODEL_BEGIN announced
    MODEL_CRC = 10
    # MODEL_DATA out of order: [0] the offset expected; -1: no upload is under way
    OFFSET = 11
    # [0] the offset where erasing or programming failed
    FLASH = 12
    # [0] eits_status of the core
    CORE = 13
    # [0] the nearest number of samples that is whole excitation periods
    PERIODS = 14
    # [0] least frame period of this scan, us
    TOO_FAST = 15
    # [0] difference to the golden image in parts per 1e9 of its peak
    SELF_TEST = 16
    # the owner has locked the board: its blue button must be held
    LOCKED = 17
    # the current was above its limit: CLEAR_FAULTS first
    TRIPPED = 18


class Quality(IntFlag):
    """eits_quality: Bits of a row's quality byte."""

    # a sample lay at either end of the converter's range
    SATURATED = 1
    # the multiplexers were switched later than the settling time before the first sample
    UNSETTLED = 2
    # it and its reciprocal disagree (full scans and checks)
    RECIPROCITY = 4
    # not measured: its reciprocal's value
    COPIED = 8
    # one of its electrodes is taken to be open: only without a reference and in a tare; then the
    # core finds them
    OPEN = 16
    # left out by MASK_ROW
    MASKED = 32


class FaultCode(IntEnum):
    """eits_fault: What is wrong with the board or the skin, and what index, value and words say."""

    # no bank holds a valid model; value: eits_status of the newest bank
    NO_MODEL = 1
    # index: electrode
    ELECTRODE_OPEN = 2
    # index: first row; value: rows
    SATURATED = 3
    # a frame took longer than the frame period; value: us over
    DEADLINE = 4
    # index: worst row; value: parts per thousand of the rms voltage
    RECIPROCITY = 5
    # the core rejected the frame; value: eits_status
    SOLVER = 6
    # the converter or its DMA gave nothing in time
    SCAN_STALLED = 7
    # the board restarted after a processor fault; words: pc, lr, cfsr, hfsr, address
    CRASH = 8
    # the board restarted because the program hung
    WATCHDOG = 9
    # the generator or the multiplexers could not be written
    BUS = 10
    # index: electrode; value: its partner, -1 where more than two are bridged; words[0], [1]: all
    # of them, bit e
    BRIDGED = 11
    # index: electrode
    ELECTRODE_NOISY = 12
    # value: parts per thousand of the data; 0: from signs, not a fraction
    MODEL_MISMATCH = 13
    # only solved frames raise it; a tare ends it
    STALE_REFERENCE = 14
    # likewise
    UNLIKE_MODEL = 15
    # the current was above its limit and was switched off; value: uA rms
    CURRENT = 16
    # the board restarted because the generator's clock failed
    CLOCK = 17
    # the board restarted because its supply fell below 2.9 V
    SUPPLY = 18
    # the locked board refused a command; index: its packet type
    LOCKED = 19


class Drive(IntEnum):
    """eits_drive: Whether current may flow through the skin, and why not."""

    # no host has asked for frames
    OFF = 0
    # a host has, and is heard
    ON = 1
    # off: no packet came from the host for a second
    SILENT = 2
    # off: the current was above its limit
    TRIPPED = 3


class Setting(IntFlag):
    """eits_setting: Bits of the owner's settings."""

    # current flows on where no host listens
    KEEP_DRIVE = 1
    # models, settings and lower excitations need the blue button
    LOCKED = 2
    # a sense resistor is fitted: the current is measured
    SENSE = 4


class RawFlags(IntFlag):
    """eits_raw_flags: Bits of a RAW's flags."""

    # a frame of a tare
    REFERENCE = 1
    # only one row of each reciprocal pair was measured
    RECIPROCAL = 2
    # a full scan among such, for the check of reciprocity
    CHECK = 4


class Stream(IntFlag):
    """eits_stream: Bits of what is streamed of each frame."""

    # its voltages, as a RAW
    RAW = 1
    # its image, as an IMAGE
    IMAGE = 2
    # its touches, as TOUCHES
    TOUCHES = 4
    # its events, as EVENTS, also where there are none; a tare forgets fingers
    EVENTS = 8


@dataclass(frozen=True)
class InfoPacket(Payload):
    """eits_packet_info: The board, its model and its settings."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_info",
        ("request", "I", ""),
        ("firmware", "4s", "version"),
        ("board", "16s", "text"),
        ("serial", "24s", "text"),
        ("f_cpu_hz", "I", ""),
        ("electrodes", "I", ""),
        ("bank_bytes", "I", ""),
        ("data_bytes", "I", ""),
        ("model_bytes", "I", ""),
        ("model_crc", "I", ""),
        ("protocol_hash", "Q", ""),
        ("n_electrodes", "I", ""),
        ("n_rows", "I", ""),
        ("n_folded", "I", ""),
        ("rank", "I", ""),
        ("n_pixels", "I", ""),
        ("nx", "I", ""),
        ("ny", "I", ""),
        ("storage", "I", ""),
        ("bank", "I", ""),
        ("excitation_millihz", "I", ""),
        ("sample_rate_hz", "I", ""),
        ("samples", "H", ""),
        ("settle_us", "H", ""),
        ("slot_us", "I", ""),
        ("check_every", "H", ""),
        ("streaming", "H", ""),
        ("every", "H", ""),
        ("tared", "H", ""),
        ("frame_period_us", "I", ""),
        ("faults", "I", ""),
        ("volts_per_code_nv", "I", ""),
        ("drive", "H", ""),
        ("settings", "H", ""),
        ("source_ua_rms", "I", ""),
        ("current_ua_rms", "I", ""),
        ("current_limit_ua_rms", "I", ""),
    )
    # of the GET_INFO that asked; 0 after a restart
    request: int
    # major, minor, patch, 0
    firmware: tuple[int, int, int]
    # such as nucleo_f767zi, zero-filled
    board: str
    # the processor's serial number, hexadecimal, zero-filled
    serial: str
    # processor clock, Hz
    f_cpu_hz: int
    # of the multiplexers
    electrodes: int
    # most bytes of a model
    bank_bytes: int
    # most bytes in one MODEL_DATA
    data_bytes: int
    # of the model in use; 0: none
    model_bytes: int
    # CRC-32 of the whole model file, as zlib's crc32
    model_crc: int
    # of the protocol that is scanned
    protocol_hash: int
    # of the model, as all down to storage
    n_electrodes: int
    # of its protocol
    n_rows: int
    # its rows once reciprocal ones are averaged
    n_folded: int
    # numbers of the reduced data
    rank: int
    # pixels of an IMAGE
    n_pixels: int
    # columns of the grid that the pixels lie in
    nx: int
    # rows of that grid
    ny: int
    # eits_storage: 0 f32, 1 f16, 2 i16, 3 i8
    storage: int
    # that the model is in
    bank: int
    # as the generator's tuning word gives it
    excitation_millihz: int
    # of the converter
    sample_rate_hz: int
    # of a measurement
    samples: int
    # settling time
    settle_us: int
    # from one measurement to the next; 0, as all of the scan: the frames are another instrument's
    slot_us: int
    # every n-th frame is scanned fully; 1: all; 0: none
    check_every: int
    # bits of eits_stream
    streaming: int
    # every n-th frame is streamed
    every: int
    # 1: there is a reference
    tared: int
    # 0: as fast as the scan goes
    frame_period_us: int
    # bit k: fault number k is raised
    faults: int
    # between the electrodes, for one step of the converter
    volts_per_code_nv: int
    # eits_drive
    drive: int
    # bits of eits_setting
    settings: int
    # what the current source gives as built; 0: not known
    source_ua_rms: int
    # as measured last; 0: there is no sense resistor, or no current
    current_ua_rms: int
    # above which the drive goes off; 0: none
    current_limit_ua_rms: int


@dataclass(frozen=True)
class ReplyPacket(Payload):
    """eits_packet_reply: How the command with this request number ended."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_reply",
        ("request", "I", ""),
        ("command", "H", ""),
        ("status", "H", ""),
        ("detail", "2i", "pair"),
    )
    # of the command that is answered
    request: int
    # its packet type
    command: int
    # eits_reply_status
    status: int
    # by status
    detail: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class RawHead(Payload):
    """eits_packet_raw: A scanned frame. n_rows numbers in V follow in the protocol's order, the
    very numbers that the board's core got, NaN for a row that could not be used; then as many
    quality bytes.
    """

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_raw",
        ("frame", "I", ""),
        ("time_us", "I", ""),
        ("scan_us", "I", ""),
        ("n_rows", "H", ""),
        ("flags", "H", ""),
    )
    # counts scanned frames; wraps
    frame: int
    # when its scan began, on the board's clock; wraps
    time_us: int
    # how long the scan took
    scan_us: int
    # voltages, and quality bytes, that follow
    n_rows: int
    # bits of eits_raw_flags
    flags: int


@dataclass(frozen=True)
class SolvedPacket(Payload):
    """eits_packet_solved: Head of IMAGE and TOUCHES: what eits_info says, and the times."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_solved",
        ("frame", "I", ""),
        ("time_us", "I", ""),
        ("solve_us", "I", ""),
        ("touch_us", "I", ""),
        ("age_us", "I", ""),
        ("count", "H", ""),
        ("status", "H", "negated"),
        ("stop", "H", "stop"),
        ("masked", "H", ""),
        ("iterations", "I", ""),
        ("nonzeros", "I", ""),
        ("macs", "I", ""),
        ("touch_macs", "I", ""),
        ("lambda_", "f", ""),
        ("lambda_max", "f", ""),
        ("lambda_noise", "f", ""),
        ("gap_rel", "f", ""),
        ("residual", "f", ""),
        ("data_norm", "f", ""),
        ("diagnostics", "I", ""),
        ("saturated", "H", ""),
        ("outliers", "H", ""),
        ("model_mismatch", "f", ""),
        ("open_electrodes", "Q", "electrodes"),
        ("bridged_electrodes", "Q", "electrodes"),
        ("noisy_electrodes", "Q", "electrodes"),
    )
    # number of the scanned frame, as in its RAW
    frame: int
    # when its scan began
    time_us: int
    # time for the solve
    solve_us: int
    # time for the touches
    touch_us: int
    # from the end of its scan until this packet was made
    age_us: int
    # pixels or touches that follow
    count: int
    # 0, or minus an eits_status: then the image is zero and there are no touches
    status: int
    # eits_stop
    stop: str
    # rows left out
    masked: int
    # that the solver took
    iterations: int
    # coefficients that are not zero
    nonzeros: int
    # multiply-accumulates of the solve
    macs: int
    # of the touches
    touch_macs: int
    # as used for this frame
    lambda_: float
    # the least lambda whose image is zero
    lambda_max: float
    # max(S'y) of noise, by the reference; 0: unknown
    lambda_noise: float
    # relative duality gap
    gap_rel: float
    # its norm
    residual: float
    # norm of the reduced data
    data_norm: float
    # bits of eits_diagnostic
    diagnostics: int = 0
    # saturated rows without masked ones: by the converter or beyond the core's limit
    saturated: int = 0
    # rows left out as outliers
    outliers: int = 0
    # fraction of the data outside the model's range
    model_mismatch: float = 0.0
    # bit e: electrode e
    open_electrodes: tuple[int, ...] = ()
    # likewise, of one or more pairs
    bridged_electrodes: tuple[int, ...] = ()
    # likewise
    noisy_electrodes: tuple[int, ...] = ()


@dataclass(frozen=True)
class TouchPacket(Payload):
    """eits_packet_touch: A touch, as eits_touch."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_touch",
        ("id", "I", ""),
        ("x_mm", "f", ""),
        ("y_mm", "f", ""),
        ("radius_mm", "f", ""),
        ("strength_s_per_m_mm2", "f", ""),
        ("explained", "f", ""),
        ("force_n", "f", ""),
        ("confidence", "f", ""),
        ("x_variance_mm2", "f", ""),
        ("xy_covariance_mm2", "f", ""),
        ("y_variance_mm2", "f", ""),
        ("long_x_mm", "f", ""),
        ("long_y_mm", "f", ""),
    )
    # from 1; stays with a touch from frame to frame
    id: int
    # of the centre, in the model's coordinates
    x_mm: float
    # of the centre
    y_mm: float
    # of the disc that was fitted
    radius_mm: float
    # S mm^2/m
    strength_s_per_m_mm2: float
    # fraction of the data that it alone explains, 0 to 1; 0: held, not found
    explained: float
    # 0 where the model is not calibrated
    force_n: float
    # probability that it is one touch; 0: not known
    confidence: float
    # covariance of the centre; 0: not known
    x_variance_mm2: float
    xy_covariance_mm2: float
    y_variance_mm2: float
    # half of the long axis as a vector; 0, 0: a disc, or not known
    long_x_mm: float
    long_y_mm: float


@dataclass(frozen=True)
class EventsHead(Payload):
    """eits_packet_events: What happened in a frame; none where the core rejected it."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_events",
        ("frame", "I", ""),
        ("time_us", "I", ""),
        ("count", "I", ""),
    )
    # number of the scanned frame, as in its RAW
    frame: int
    # when its scan began
    time_us: int
    # events that follow
    count: int


@dataclass(frozen=True)
class EventPacket(Payload):
    """eits_packet_event: One event, as eits_event (gesture_events.h); its time is the frame's, its
    zone the host's.
    """

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_event",
        ("kind", "H", ""),
        ("phase", "H", ""),
        ("first_id", "I", ""),
        ("second_id", "I", ""),
        ("x_mm", "f", ""),
        ("y_mm", "f", ""),
        ("direction_deg", "f", ""),
        ("value", "f", ""),
    )
    # eits_event_kind
    kind: int
    # eits_event_phase
    phase: int
    # of the touch, as it was when it landed
    first_id: int
    # of two fingers the second; else 0
    second_id: int
    # where
    x_mm: float
    y_mm: float
    # of a swipe, 0 along x, 90 along y
    direction_deg: float
    # by kind
    value: float


@dataclass(frozen=True)
class StageStats(Payload):
    """eits_stage_stats: Times of one stage."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_stage_stats",
        ("count", "I", ""),
        ("last_us", "I", ""),
        ("p99_us", "I", ""),
        ("worst_us", "I", ""),
    )
    # frames that were timed
    count: int
    # of the last such frame
    last_us: int
    # 99th percentile: the upper edge of its bin, an eighth of an octave wide
    p99_us: int
    # of all since the start, or since GET_STATS set the times to zero
    worst_us: int


@dataclass(frozen=True)
class StatsPacket(Payload):
    """eits_packet_stats: The board's counters."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_stats",
        ("request", "I", ""),
        ("uptime_ms", "I", ""),
        ("frames_scanned", "I", ""),
        ("frames_solved", "I", ""),
        ("packets_sent", "I", ""),
        ("packets_dropped", "I", ""),
        ("deadlines_missed", "I", ""),
        ("slots_repeated", "I", ""),
        ("outliers", "I", ""),
        ("link_packets", "I", ""),
        ("link_crc_errors", "I", ""),
        ("link_framing_errors", "I", ""),
        ("link_overruns", "I", ""),
        ("stack_bytes", "I", ""),
        ("stack_used", "I", ""),
        ("workspace_bytes", "I", ""),
        ("workspace_used", "I", ""),
        ("stages", "24I", "stages"),
    )
    # of the GET_STATS that asked
    request: int
    # since the start
    uptime_ms: int
    # streamed or not
    frames_scanned: int
    # where image or touches were streamed
    frames_solved: int
    # since the link came up
    packets_sent: int
    # a dropped packet still takes a sequence number
    packets_dropped: int
    # frame periods missed
    deadlines_missed: int
    # measurements taken again because the switch came too late
    slots_repeated: int
    # rows left out as outliers, of all frames since there is a reference
    outliers: int
    # commands received
    link_packets: int
    # whole packets whose checksum does not fit
    link_crc_errors: int
    # ended inside a COBS block, or shorter than head and checksum
    link_framing_errors: int
    # longer than the receive buffer
    link_overruns: int
    # that are set aside
    stack_bytes: int
    # the most so far
    stack_used: int
    # for the model's context and its frames
    workspace_bytes: int
    # of them by the model in use
    workspace_used: int
    # by eits_stage
    stages: dict[str, StageStats]


@dataclass(frozen=True)
class FaultPacket(Payload):
    """eits_packet_fault: A fault that rose or went."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_fault",
        ("code", "H", ""),
        ("raised", "H", "flag"),
        ("frame", "I", ""),
        ("index", "i", ""),
        ("value", "i", ""),
        ("words", "5I", "words"),
    )
    # eits_fault
    code: int
    # 1: it is there; 0: it has gone
    raised: bool
    # in which it rose or went
    frame: int
    # by code, as value and words
    index: int
    # by code
    value: int
    # by code; 0 where it has none
    words: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)


@dataclass(frozen=True)
class HashesPacket(Payload):
    """eits_packet_hashes: SHA-256 of what the board's flash holds."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_hashes",
        ("request", "I", ""),
        ("model", "32s", "hash"),
        ("firmware", "32s", "hash"),
    )
    # of the GET_HASHES that asked
    request: int
    # of the model in use; zero: none
    model: bytes
    # of the program; zero: not known
    firmware: bytes


@dataclass(frozen=True)
class GetInfo(Command):
    """GET_INFO: send an INFO"""

    TYPE: ClassVar[PacketType] = PacketType.GET_INFO
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


@dataclass(frozen=True)
class StreamCommand(Command):
    """STREAM: what to send of each frame"""

    TYPE: ClassVar[PacketType] = PacketType.STREAM
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_stream",
        ("request", "I", ""),
        ("what", "H", ""),
        ("every", "H", "one"),
        ("frames", "I", ""),
    )
    # bits of eits_stream; 0 stops
    what: int
    # every n-th frame, at least 1
    every: int = 1
    # so many streamed frames, then stop; 0: until stopped
    frames: int = 0


@dataclass(frozen=True)
class Tare(Command):
    """TARE: take the reference"""

    TYPE: ClassVar[PacketType] = PacketType.TARE
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_tare",
        ("request", "I", ""),
        ("frames", "I", ""),
    )
    # 1, or 4 to 1024
    frames: int


@dataclass(frozen=True)
class Scan(Command):
    """SCAN: how frames are scanned; forgets the reference"""

    TYPE: ClassVar[PacketType] = PacketType.SCAN
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_scan",
        ("request", "I", ""),
        ("excitation_millihz", "I", ""),
        ("sample_rate_hz", "I", ""),
        ("samples", "H", ""),
        ("settle_us", "H", ""),
        ("check_every", "H", ""),
        ("reserved", "H", ""),
        ("frame_period_us", "I", ""),
    )
    # 1,000 to 250,000,000, below half the sample rate
    excitation_millihz: int
    # 1,000 to 5,000,000
    sample_rate_hz: int
    # 4 to 1024
    samples: int
    # at most 50,000
    settle_us: int
    # 1: every frame is full; n > 1: one row of each reciprocal pair, every n-th frame full; 0:
    # never full
    check_every: int
    # 0
    reserved: int
    # at most 600,000,000; 0: as fast as the scan goes
    frame_period_us: int


@dataclass(frozen=True)
class Solver(Command):
    """SOLVER: the solver's options"""

    TYPE: ClassVar[PacketType] = PacketType.SOLVER
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_solver",
        ("request", "I", ""),
        ("iterations", "I", ""),
        ("max_touches", "I", ""),
        ("warm_start", "I", ""),
        ("sign", "I", ""),
        ("lambda_rel", "f", ""),
        ("gap_rel", "f", ""),
        ("solver", "I", ""),
        ("mac_limit", "I", ""),
        ("diagnostics", "I", ""),
        ("track", "I", ""),
    )
    # 1 to 1000
    iterations: int
    # at most EITS_MAX_TOUCHES
    max_touches: int
    # 0 or 1
    warm_start: int
    # eits_sign: 0 increase, 1 decrease, 2 both
    sign: int
    # 0 to 1
    lambda_rel: float
    # 0 to 1
    gap_rel: float
    # eits_solver: 0 FISTA, 1 working set, 2 coordinate descent, 3 active set
    solver: int
    # multiply-accumulates a frame; 0: no limit
    mac_limit: int
    # bits of eits_diagnostic that are looked for
    diagnostics: int
    # 1: touches are followed in time (eits_options_track), as after a start; 0: they are not
    track: int


@dataclass(frozen=True)
class ModelBegin(Command):
    """MODEL_BEGIN: stop the scan and erase the bank that is not in use"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_BEGIN
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_model_begin",
        ("request", "I", ""),
        ("bytes", "I", ""),
        ("crc", "I", ""),
    )
    # of the model, at least 64
    bytes: int
    # CRC-32 of the whole model
    crc: int


@dataclass(frozen=True)
class ModelData(Command):
    """MODEL_DATA: bytes of the model"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_DATA
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_model_data",
        ("request", "I", ""),
        ("offset", "I", ""),
    )
    # of the first byte
    offset: int
    data: bytes = b""


@dataclass(frozen=True)
class ModelCommit(Command):
    """MODEL_COMMIT: use the model that was sent"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_COMMIT
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


@dataclass(frozen=True)
class GetStats(Command):
    """GET_STATS: send a STATS"""

    TYPE: ClassVar[PacketType] = PacketType.GET_STATS
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_get_stats",
        ("request", "I", ""),
        ("reset", "I", ""),
    )
    # 1: set the times to zero after sending them
    reset: int = 0


@dataclass(frozen=True)
class MaskRow(Command):
    """MASK_ROW: leave a row out, or use it again"""

    TYPE: ClassVar[PacketType] = PacketType.MASK_ROW
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_mask_row",
        ("request", "I", ""),
        ("row", "H", ""),
        ("masked", "H", "one"),
    )
    # of the protocol
    row: int
    # 1: leave it out; 0: use it again
    masked: int = 1


@dataclass(frozen=True)
class Reset(Command):
    """RESET: restart the board"""

    TYPE: ClassVar[PacketType] = PacketType.RESET
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


@dataclass(frozen=True)
class SelfTest(Command):
    """SELF_TEST: run the model's golden frame"""

    TYPE: ClassVar[PacketType] = PacketType.SELF_TEST
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


@dataclass(frozen=True)
class ClearFaults(Command):
    """CLEAR_FAULTS: forget the faults"""

    TYPE: ClassVar[PacketType] = PacketType.CLEAR_FAULTS
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


@dataclass(frozen=True)
class Keepalive(Command):
    """KEEPALIVE: the host is there, or goes and the current stops; not answered"""

    TYPE: ClassVar[PacketType] = PacketType.KEEPALIVE
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_keepalive",
        ("request", "I", ""),
        ("present", "I", ""),
    )
    # 1: it is; 0: it goes, and the current stops now
    present: int


@dataclass(frozen=True)
class Settings(Command):
    """SETTINGS: the owner's settings, kept in flash"""

    TYPE: ClassVar[PacketType] = PacketType.SETTINGS
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_settings",
        ("request", "I", ""),
        ("settings", "I", ""),
        ("current_limit_ua_rms", "I", ""),
    )
    # bits of eits_setting
    settings: int
    # at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1: as it is
    current_limit_ua_rms: int


@dataclass(frozen=True)
class GetHashes(Command):
    """GET_HASHES: send HASHES"""

    TYPE: ClassVar[PacketType] = PacketType.GET_HASHES
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_plain",
        ("request", "I", ""),
    )


COMMANDS: dict[int, type[Command]] = {
    PacketType.GET_INFO: GetInfo,
    PacketType.STREAM: StreamCommand,
    PacketType.TARE: Tare,
    PacketType.SCAN: Scan,
    PacketType.SOLVER: Solver,
    PacketType.MODEL_BEGIN: ModelBegin,
    PacketType.MODEL_DATA: ModelData,
    PacketType.MODEL_COMMIT: ModelCommit,
    PacketType.GET_STATS: GetStats,
    PacketType.MASK_ROW: MaskRow,
    PacketType.RESET: Reset,
    PacketType.SELF_TEST: SelfTest,
    PacketType.CLEAR_FAULTS: ClearFaults,
    PacketType.KEEPALIVE: Keepalive,
    PacketType.SETTINGS: Settings,
    PacketType.GET_HASHES: GetHashes,
}
