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
STAGES = ("scan", "demodulate", "solve", "touches", "send", "frame")


class PacketType(IntEnum):
    """eits_packet_type: Below 0x80 from the board, from there on to it."""

    INFO = 0x1  # the board, its model and its settings
    REPLY = 0x2  # how a command ended
    RAW = 0x10  # a scanned frame
    IMAGE = 0x11  # a frame's image
    TOUCHES = 0x12  # a frame's touches
    EVENTS = 0x15  # what a frame's touches amounted to
    FOLLOWED = 0x17  # touches after a drive
    STATS = 0x13  # the board's counters
    FAULT = 0x14  # a fault that rose or went
    HASHES = 0x16  # SHA-256 of the model and of the firmware
    RECORDING = 0x70  # never on a wire: the first packet of an .eits file
    GET_INFO = 0x80  # send an INFO
    STREAM = 0x81  # what to send of each frame
    TARE = 0x82  # take the reference
    SCAN = 0x83  # how frames are scanned; forgets the reference
    SOLVER = 0x84  # the solver's options
    MODEL_BEGIN = 0x85  # stop the scan and erase the bank that is not in use
    MODEL_DATA = 0x86  # bytes of the model
    MODEL_COMMIT = 0x87  # use the model that was sent
    GET_STATS = 0x88  # send a STATS
    MASK_ROW = 0x89  # leave a row out, or use it again
    RESET = 0x8A  # restart the board
    SELF_TEST = 0x8B  # run the model's golden frame
    CLEAR_FAULTS = 0x8C  # forget the faults
    KEEPALIVE = 0x8D  # the host is there, or goes and the current stops; not answered
    SETTINGS = 0x8E  # the owner's settings, kept in flash
    GET_HASHES = 0x8F  # send HASHES


class ReplyStatus(IntEnum):
    """eits_reply_status: How a command ended, and what `detail` of the reply adds."""

    OK = 0  # MODEL_BEGIN: [0] the offset to go on from
    UNKNOWN_COMMAND = 1  # no command has this packet type
    LENGTH = 2  # [0] bytes of payload that are expected
    RANGE = 3  # [0] offset in the payload of the field out of range; [1] the limit it broke
    NO_MODEL = 4  # no model is in use: send one first
    NOT_TARED = 5  # there is no reference: send a TARE first
    BUSY = 6  # [0] type of the command under way
    MODEL_SIZE = 7  # [0] most bytes that a bank, a packet or the memory holds
    MODEL_INVALID = 8  # [0] eits_status
    MODEL_SCAN = 9  # [0] electrodes that the protocol needs; [1] electrodes there are
    MODEL_CRC = 10  # what arrived is not what MODEL_BEGIN announced
    OFFSET = 11  # MODEL_DATA out of order: [0] the offset expected; -1: no upload is under way
    FLASH = 12  # [0] the offset where erasing or programming failed
    CORE = 13  # [0] eits_status of the core
    PERIODS = 14  # [0] the nearest number of samples that is whole excitation periods
    TOO_FAST = 15  # [0] least frame period of this scan, us
    SELF_TEST = 16  # [0] difference to the golden image in parts per 1e9 of its peak
    LOCKED = 17  # the owner has locked the board: its blue button must be held
    TRIPPED = 18  # the current was above its limit: CLEAR_FAULTS first
    # touches after each drive want a model with fields, a reference that stays, full scans and
    # every frame
    DRIVES = 19


class Quality(IntFlag):
    """eits_quality: Bits of a row's quality byte."""

    SATURATED = 1  # a sample lay at either end of the converter's range
    # the multiplexers were switched later than the settling time before the first sample
    UNSETTLED = 2
    RECIPROCITY = 4  # it and its reciprocal disagree (full scans and checks)
    COPIED = 8  # not measured: its reciprocal's value
    # one of its electrodes is taken to be open: only without a reference and in a tare; then the
    # core finds them
    OPEN = 16
    MASKED = 32  # left out by MASK_ROW


class FaultCode(IntEnum):
    """eits_fault: What is wrong with the board or the skin, and what index, value and words say."""

    NO_MODEL = 1  # no bank holds a valid model; value: eits_status of the newest bank
    ELECTRODE_OPEN = 2  # index: electrode
    SATURATED = 3  # index: first row; value: rows
    DEADLINE = 4  # a frame took longer than the frame period; value: us over
    RECIPROCITY = 5  # index: worst row; value: parts per thousand of the rms voltage
    SOLVER = 6  # the core rejected the frame; value: eits_status
    SCAN_STALLED = 7  # the converter or its DMA gave nothing in time
    CRASH = 8  # the board restarted after a processor fault; words: pc, lr, cfsr, hfsr, address
    WATCHDOG = 9  # the board restarted because the program hung
    BUS = 10  # the generator or the multiplexers could not be written
    # index: electrode; value: its partner, -1 where more than two are bridged; words[0], [1]: all
    # of them, bit e
    BRIDGED = 11
    ELECTRODE_NOISY = 12  # index: electrode
    MODEL_MISMATCH = 13  # value: parts per thousand of the data; 0: from signs, not a fraction
    STALE_REFERENCE = 14  # only solved frames raise it; a tare ends it
    UNLIKE_MODEL = 15  # likewise
    CURRENT = 16  # the current was above its limit and was switched off; value: uA rms
    CLOCK = 17  # the board restarted because the generator's clock failed
    SUPPLY = 18  # the board restarted because its supply fell below 2.9 V
    LOCKED = 19  # the locked board refused a command; index: its packet type


class Drive(IntEnum):
    """eits_drive: Whether current may flow through the skin, and why not."""

    OFF = 0  # no host has asked for frames
    ON = 1  # a host has, and is heard
    SILENT = 2  # off: no packet came from the host for a second
    TRIPPED = 3  # off: the current was above its limit


class Setting(IntFlag):
    """eits_setting: Bits of the owner's settings."""

    KEEP_DRIVE = 1  # current flows on where no host listens
    LOCKED = 2  # models, settings and lower excitations need the blue button
    SENSE = 4  # a sense resistor is fitted: the current is measured


class RawFlags(IntFlag):
    """eits_raw_flags: Bits of a RAW's flags."""

    REFERENCE = 1  # a frame of a tare
    RECIPROCAL = 2  # only one row of each reciprocal pair was measured
    CHECK = 4  # a full scan among such, for the check of reciprocity
    ALIGNED = 8  # the touches after each drive brought it to the instant of its last drive
    TRUSTED = 16  # and it was solved: its drives are accounted for


class Stream(IntFlag):
    """eits_stream: Bits of what is streamed of each frame."""

    RAW = 1  # its voltages, as a RAW
    IMAGE = 2  # its image, as an IMAGE
    TOUCHES = 4  # its touches, as TOUCHES
    EVENTS = 8  # its events, as EVENTS, also where there are none; a tare forgets fingers
    FOLLOWED = 16  # touches after each drive, as FOLLOWED; of frames only trusted ones are solved


@dataclass(frozen=True)
class InfoPacket(Payload):
    """eits_packet_info: The board, its model and its settings."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_info",
        "request:I firmware:4s:version board:16s:text serial:24s:text f_cpu_hz:I electrodes:I"
        " bank_bytes:I data_bytes:I model_bytes:I model_crc:I protocol_hash:Q n_electrodes:I"
        " n_rows:I n_folded:I rank:I n_pixels:I nx:I ny:I storage:I bank:I excitation_millihz:I"
        " sample_rate_hz:I samples:H settle_us:H slot_us:I check_every:H streaming:H every:H"
        " tared:H frame_period_us:I faults:I volts_per_code_nv:I drive:H settings:H"
        " source_ua_rms:I current_ua_rms:I current_limit_ua_rms:I",
    )
    request: int  # of the GET_INFO that asked; 0 after a restart
    firmware: tuple[int, int, int]  # major, minor, patch, 0
    board: str  # such as nucleo_f767zi, zero-filled
    serial: str  # the processor's serial number, hexadecimal, zero-filled
    f_cpu_hz: int  # processor clock, Hz
    electrodes: int  # of the multiplexers
    bank_bytes: int  # most bytes of a model
    data_bytes: int  # most bytes in one MODEL_DATA
    model_bytes: int  # of the model in use; 0: none
    model_crc: int  # CRC-32 of the whole model file, as zlib's crc32
    protocol_hash: int  # of the protocol that is scanned
    n_electrodes: int  # of the model, as all down to storage
    n_rows: int  # of its protocol
    n_folded: int  # its rows once reciprocal ones are averaged
    rank: int  # numbers of the reduced data
    n_pixels: int  # pixels of an IMAGE
    nx: int  # columns of the grid that the pixels lie in
    ny: int  # rows of that grid
    storage: int  # eits_storage: 0 f32, 1 f16, 2 i16, 3 i8
    bank: int  # that the model is in
    excitation_millihz: int  # as the generator's tuning word gives it
    sample_rate_hz: int  # of the converter
    samples: int  # of a measurement
    settle_us: int  # settling time
    # from one measurement to the next; 0, as all of the scan: the frames are another instrument's
    slot_us: int
    check_every: int  # every n-th frame is scanned fully; 1: all; 0: none
    streaming: int  # bits of eits_stream
    every: int  # every n-th frame is streamed
    tared: int  # 1: there is a reference
    frame_period_us: int  # 0: as fast as the scan goes
    faults: int  # bit k: fault number k is raised
    volts_per_code_nv: int  # between the electrodes, for one step of the converter
    drive: int  # eits_drive
    settings: int  # bits of eits_setting
    source_ua_rms: int  # what the current source gives as built; 0: not known
    current_ua_rms: int  # as measured last; 0: there is no sense resistor, or no current
    current_limit_ua_rms: int  # above which the drive goes off; 0: none


@dataclass(frozen=True)
class ReplyPacket(Payload):
    """eits_packet_reply: How the command with this request number ended."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_reply", "request:I command:H status:H detail:2i:pair"
    )
    request: int  # of the command that is answered
    command: int  # its packet type
    status: int  # eits_reply_status
    detail: tuple[int, int] = (0, 0)  # by status


@dataclass(frozen=True)
class RawHead(Payload):
    """eits_packet_raw: A scanned frame. n_rows numbers in V follow in the protocol's order, the
    very numbers that the board's core got, NaN for a row that could not be used; then as many
    quality bytes.
    """

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_raw", "frame:I time_us:I scan_us:I n_rows:H flags:H"
    )
    frame: int  # counts scanned frames; wraps
    time_us: int  # when its scan began, on the board's clock; wraps
    scan_us: int  # how long the scan took
    n_rows: int  # voltages, and quality bytes, that follow
    flags: int  # bits of eits_raw_flags


@dataclass(frozen=True)
class SolvedPacket(Payload):
    """eits_packet_solved: Head of IMAGE and TOUCHES: what eits_info says, and the times."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_solved",
        "frame:I time_us:I solve_us:I touch_us:I age_us:I count:H status:H:negated stop:H:stop"
        " masked:H iterations:I nonzeros:I macs:I touch_macs:I lambda_:f lambda_max:f"
        " lambda_noise:f gap_rel:f residual:f data_norm:f diagnostics:I saturated:H outliers:H"
        " model_mismatch:f open_electrodes:Q:electrodes bridged_electrodes:Q:electrodes"
        " noisy_electrodes:Q:electrodes",
    )
    frame: int  # number of the scanned frame, as in its RAW
    time_us: int  # when its scan began
    solve_us: int  # time for the solve
    touch_us: int  # time for the touches
    age_us: int  # from the end of its scan until this packet was made
    count: int  # pixels or touches that follow
    status: int  # 0, or minus an eits_status: then the image is zero and there are no touches
    stop: str  # eits_stop
    masked: int  # rows left out
    iterations: int  # that the solver took
    nonzeros: int  # coefficients that are not zero
    macs: int  # multiply-accumulates of the solve
    touch_macs: int  # of the touches
    lambda_: float  # as used for this frame
    lambda_max: float  # the least lambda whose image is zero
    lambda_noise: float  # max(S'y) of noise, by the reference; 0: unknown
    gap_rel: float  # relative duality gap
    residual: float  # its norm
    data_norm: float  # norm of the reduced data
    diagnostics: int = 0  # bits of eits_diagnostic
    # saturated rows without masked ones: by the converter or beyond the core's limit
    saturated: int = 0
    outliers: int = 0  # rows left out as outliers
    model_mismatch: float = 0.0  # fraction of the data outside the model's range
    open_electrodes: tuple[int, ...] = ()  # bit e: electrode e
    bridged_electrodes: tuple[int, ...] = ()  # likewise, of one or more pairs
    noisy_electrodes: tuple[int, ...] = ()  # likewise


@dataclass(frozen=True)
class TouchPacket(Payload):
    """eits_packet_touch: A touch, as eits_touch."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_touch",
        "id:I x_mm:f y_mm:f radius_mm:f strength_s_per_m_mm2:f explained:f force_n:f confidence:f"
        " x_variance_mm2:f xy_covariance_mm2:f y_variance_mm2:f long_x_mm:f long_y_mm:f",
    )
    id: int  # from 1; stays with a touch from frame to frame
    x_mm: float  # of the centre, in the model's coordinates
    y_mm: float  # of the centre
    radius_mm: float  # of the disc that was fitted
    strength_s_per_m_mm2: float  # S mm^2/m
    explained: float  # fraction of the data that it alone explains, 0 to 1; 0: held, not found
    force_n: float  # 0 where the model is not calibrated
    confidence: float  # probability that it is one touch; 0: not known
    x_variance_mm2: float  # covariance of the centre; 0: not known
    xy_covariance_mm2: float
    y_variance_mm2: float
    long_x_mm: float  # half of the long axis as a vector; 0, 0: a disc, or not known
    long_y_mm: float


@dataclass(frozen=True)
class FollowedHead(Payload):
    """eits_packet_followed: Touches as of an instant within a scan. Where nothing touches it is
    sent once: when that begins, or the touches have gone.
    """

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_followed", "frame:I time_us:I begun:I age_us:H update_us:H drive:H count:H"
    )
    frame: int  # number of the frame that is scanned
    time_us: int  # the instant they hold for: the middle of the drive, were no row repeated
    begun: int  # the frame before which nothing was known
    age_us: int  # from the end of the drive until this packet was made; at most 65,535
    update_us: int  # of it for the update; likewise
    drive: int  # of the protocol, in the order of first rows
    count: int  # touches that follow


@dataclass(frozen=True)
class FollowedTouch(Payload):
    """eits_packet_followed_touch: A touch, as eits_fast_touch."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_followed_touch",
        "id:H confirmed:H:flag x_mm:f y_mm:f vx_mm_per_s:f vy_mm_per_s:f strength_s_per_m_mm2:f",
    )
    id: int  # from 1, apart from those of TOUCHES; stays with a touch
    confirmed: bool  # 1: a whole frame has shown it
    x_mm: float  # of the centre, in the model's coordinates
    y_mm: float  # of the centre
    vx_mm_per_s: float  # its velocity
    vy_mm_per_s: float
    strength_s_per_m_mm2: float  # S mm^2/m


@dataclass(frozen=True)
class EventsHead(Payload):
    """eits_packet_events: What happened in a frame; none where the core rejected it."""

    LAYOUT: ClassVar[Layout] = Layout("eits_packet_events", "frame:I time_us:I count:I")
    frame: int  # number of the scanned frame, as in its RAW
    time_us: int  # when its scan began
    count: int  # events that follow


@dataclass(frozen=True)
class EventPacket(Payload):
    """eits_packet_event: One event, as eits_event (gesture_events.h); its time is the frame's, its
    zone the host's.
    """

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_event",
        "kind:H phase:H first_id:I second_id:I x_mm:f y_mm:f direction_deg:f value:f",
    )
    kind: int  # eits_event_kind
    phase: int  # eits_event_phase
    first_id: int  # of the touch, as it was when it landed
    second_id: int  # of two fingers the second; else 0
    x_mm: float  # where
    y_mm: float
    direction_deg: float  # of a swipe, 0 along x, 90 along y
    value: float  # by kind


@dataclass(frozen=True)
class StageStats(Payload):
    """eits_stage_stats: Times of one stage."""

    LAYOUT: ClassVar[Layout] = Layout("eits_stage_stats", "count:I last_us:I p99_us:I worst_us:I")
    count: int  # frames that were timed
    last_us: int  # of the last such frame
    p99_us: int  # 99th percentile: the upper edge of its bin, an eighth of an octave wide
    worst_us: int  # of all since the start, or since GET_STATS set the times to zero


@dataclass(frozen=True)
class StatsPacket(Payload):
    """eits_packet_stats: The board's counters."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_stats",
        "request:I uptime_ms:I frames_scanned:I frames_solved:I packets_sent:I packets_dropped:I"
        " deadlines_missed:I slots_repeated:I outliers:I link_packets:I link_crc_errors:I"
        " link_framing_errors:I link_overruns:I stack_bytes:I stack_used:I workspace_bytes:I"
        " workspace_used:I stages:24I:stages",
    )
    request: int  # of the GET_STATS that asked
    uptime_ms: int  # since the start
    frames_scanned: int  # streamed or not
    frames_solved: int  # where image or touches were streamed
    packets_sent: int  # since the link came up
    packets_dropped: int  # a dropped packet still takes a sequence number
    deadlines_missed: int  # frame periods missed
    slots_repeated: int  # measurements taken again because the switch came too late
    outliers: int  # rows left out as outliers, of all frames since there is a reference
    link_packets: int  # commands received
    link_crc_errors: int  # whole packets whose checksum does not fit
    link_framing_errors: int  # ended inside a COBS block, or shorter than head and checksum
    link_overruns: int  # longer than the receive buffer
    stack_bytes: int  # that are set aside
    stack_used: int  # the most so far
    workspace_bytes: int  # for the model's context and its frames
    workspace_used: int  # of them by the model in use
    stages: dict[str, StageStats]  # by eits_stage


@dataclass(frozen=True)
class FaultPacket(Payload):
    """eits_packet_fault: A fault that rose or went."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_fault", "code:H raised:H:flag frame:I index:i value:i words:5I:words"
    )
    code: int  # eits_fault
    raised: bool  # 1: it is there; 0: it has gone
    frame: int  # in which it rose or went
    index: int  # by code, as value and words
    value: int  # by code
    words: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)  # by code; 0 where it has none


@dataclass(frozen=True)
class HashesPacket(Payload):
    """eits_packet_hashes: SHA-256 of what the board's flash holds."""

    LAYOUT: ClassVar[Layout] = Layout(
        "eits_packet_hashes", "request:I model:32s:hash firmware:32s:hash"
    )
    request: int  # of the GET_HASHES that asked
    model: bytes  # of the model in use; zero: none
    firmware: bytes  # of the program; zero: not known


@dataclass(frozen=True)
class GetInfo(Command):
    """GET_INFO: send an INFO"""

    TYPE: ClassVar[PacketType] = PacketType.GET_INFO
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


@dataclass(frozen=True)
class StreamCommand(Command):
    """STREAM: what to send of each frame"""

    TYPE: ClassVar[PacketType] = PacketType.STREAM
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_stream", "request:I what:H every:H:one frames:I"
    )
    what: int  # bits of eits_stream; 0 stops
    every: int = 1  # every n-th frame, at least 1
    frames: int = 0  # so many streamed frames, then stop; 0: until stopped


@dataclass(frozen=True)
class Tare(Command):
    """TARE: take the reference"""

    TYPE: ClassVar[PacketType] = PacketType.TARE
    LAYOUT: ClassVar[Layout] = Layout("eits_command_tare", "request:I frames:I")
    frames: int  # 1, or 4 to 1024


@dataclass(frozen=True)
class Scan(Command):
    """SCAN: how frames are scanned; forgets the reference"""

    TYPE: ClassVar[PacketType] = PacketType.SCAN
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_scan",
        "request:I excitation_millihz:I sample_rate_hz:I samples:H settle_us:H check_every:H"
        " reserved:H frame_period_us:I",
    )
    excitation_millihz: int  # 1,000 to 250,000,000, below half the sample rate
    sample_rate_hz: int  # 1,000 to 5,000,000
    samples: int  # 4 to 1024
    settle_us: int  # at most 50,000
    # 1: every frame is full; n > 1: one row of each reciprocal pair, every n-th frame full; 0:
    # never full
    check_every: int
    reserved: int  # 0
    frame_period_us: int  # at most 600,000,000; 0: as fast as the scan goes


@dataclass(frozen=True)
class Solver(Command):
    """SOLVER: the solver's options"""

    TYPE: ClassVar[PacketType] = PacketType.SOLVER
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_solver",
        "request:I iterations:I max_touches:I warm_start:I sign:I lambda_rel:f gap_rel:f solver:I"
        " mac_limit:I diagnostics:I track:I",
    )
    iterations: int  # 1 to 1000
    max_touches: int  # at most EITS_MAX_TOUCHES
    warm_start: int  # 0 or 1
    sign: int  # eits_sign: 0 increase, 1 decrease, 2 both
    lambda_rel: float  # 0 to 1
    gap_rel: float  # 0 to 1
    solver: int  # eits_solver: 0 FISTA, 1 working set, 2 coordinate descent, 3 active set
    mac_limit: int  # multiply-accumulates a frame; 0: no limit
    diagnostics: int  # bits of eits_diagnostic that are looked for
    # 1: touches are followed in time (eits_options_track), as after a start; 0: they are not
    track: int


@dataclass(frozen=True)
class ModelBegin(Command):
    """MODEL_BEGIN: stop the scan and erase the bank that is not in use"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_BEGIN
    LAYOUT: ClassVar[Layout] = Layout("eits_command_model_begin", "request:I bytes:I crc:I")
    bytes: int  # of the model, at least 64
    crc: int  # CRC-32 of the whole model


@dataclass(frozen=True)
class ModelData(Command):
    """MODEL_DATA: bytes of the model"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_DATA
    LAYOUT: ClassVar[Layout] = Layout("eits_command_model_data", "request:I offset:I")
    offset: int  # of the first byte
    data: bytes = b""


@dataclass(frozen=True)
class ModelCommit(Command):
    """MODEL_COMMIT: use the model that was sent"""

    TYPE: ClassVar[PacketType] = PacketType.MODEL_COMMIT
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


@dataclass(frozen=True)
class GetStats(Command):
    """GET_STATS: send a STATS"""

    TYPE: ClassVar[PacketType] = PacketType.GET_STATS
    LAYOUT: ClassVar[Layout] = Layout("eits_command_get_stats", "request:I reset:I")
    reset: int = 0  # 1: set the times to zero after sending them


@dataclass(frozen=True)
class MaskRow(Command):
    """MASK_ROW: leave a row out, or use it again"""

    TYPE: ClassVar[PacketType] = PacketType.MASK_ROW
    LAYOUT: ClassVar[Layout] = Layout("eits_command_mask_row", "request:I row:H masked:H:one")
    row: int  # of the protocol
    masked: int = 1  # 1: leave it out; 0: use it again


@dataclass(frozen=True)
class Reset(Command):
    """RESET: restart the board"""

    TYPE: ClassVar[PacketType] = PacketType.RESET
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


@dataclass(frozen=True)
class SelfTest(Command):
    """SELF_TEST: run the model's golden frame"""

    TYPE: ClassVar[PacketType] = PacketType.SELF_TEST
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


@dataclass(frozen=True)
class ClearFaults(Command):
    """CLEAR_FAULTS: forget the faults"""

    TYPE: ClassVar[PacketType] = PacketType.CLEAR_FAULTS
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


@dataclass(frozen=True)
class Keepalive(Command):
    """KEEPALIVE: the host is there, or goes and the current stops; not answered"""

    TYPE: ClassVar[PacketType] = PacketType.KEEPALIVE
    LAYOUT: ClassVar[Layout] = Layout("eits_command_keepalive", "request:I present:I")
    present: int  # 1: it is; 0: it goes, and the current stops now


@dataclass(frozen=True)
class Settings(Command):
    """SETTINGS: the owner's settings, kept in flash"""

    TYPE: ClassVar[PacketType] = PacketType.SETTINGS
    LAYOUT: ClassVar[Layout] = Layout(
        "eits_command_settings", "request:I settings:I current_limit_ua_rms:I"
    )
    settings: int  # bits of eits_setting
    # at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1: as it is
    current_limit_ua_rms: int


@dataclass(frozen=True)
class GetHashes(Command):
    """GET_HASHES: send HASHES"""

    TYPE: ClassVar[PacketType] = PacketType.GET_HASHES
    LAYOUT: ClassVar[Layout] = Layout("eits_command_plain", "request:I")


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
