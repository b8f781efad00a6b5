"""Packets of the link: their numbers, and their fields as they lie on the wire. Written by
tables/make_tables.py from tables/link.toml.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Annotated

from eitskin.device.wire.layout import Command, Payload

LINK_VERSION = 6
LINK_MAX_PAYLOAD = 16384
KEPT = 4294967295
PROBE_OPEN = 4294967295
FAULT_RAISE_FRAMES = 3
FAULT_CLEAR_FRAMES = 8
NAME_CHARACTERS = 32
# eits_stage: Stages that are timed.
STAGES = ("scan", "demodulate", "solve", "touches", "send", "frame")
Electrodes = Annotated[tuple[int, ...], "Q", "electrodes"]
F32 = Annotated[float, "f", ""]
Flag = Annotated[bool, "H", "flag"]
Hash = Annotated[bytes, "32s", "hash"]
I32 = Annotated[int, "i", ""]
Negated = Annotated[int, "H", "negated"]
One = Annotated[int, "H", "one"]
Pair = Annotated[tuple[int, int], "2i", "pair"]
Shown = Annotated[str, "B", "shown"]
Stages = Annotated[dict[str, "StageStats"], "24I", "stages"]
Stop = Annotated[str, "B", "stop"]
Text16 = Annotated[str, "16s", "text"]
Text24 = Annotated[str, "24s", "text"]
Text32 = Annotated[str, "32s", "text"]
U16 = Annotated[int, "H", ""]
U32 = Annotated[int, "I", ""]
U64 = Annotated[int, "Q", ""]
Version = Annotated[tuple[int, int, int], "4s", "version"]
Words = Annotated[tuple[int, int, int, int, int], "5I", "words"]


class PacketType(IntEnum):
    """eits_packet_type: Below 0x80 from the board, from there on to it."""

    INFO = 0x1  # the board, its model and its settings
    REPLY = 0x2  # how a command ended
    RAW = 0x10  # a scanned frame
    IMAGE = 0x11  # a frame's image
    TOUCHES = 0x12  # a frame's touches
    EVENTS = 0x15  # what a frame's touches amounted to
    DRIVE_TOUCHES = 0x17  # touches after a drive
    STATS = 0x13  # the board's counters
    FAULT = 0x14  # a fault that rose or went
    HASHES = 0x16  # SHA-256 of the model and of the firmware
    PROBED = 0x18  # codes of a fixed row
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
    PROBE = 0x90  # measure a fixed row once and send PROBED


class ReplyStatus(IntEnum):
    """eits_reply_status: The result of a command; `detail` of the reply adds to it."""

    OK = 0  # MODEL_BEGIN: [0] the offset to go on from
    UNKNOWN_COMMAND = 1  # no command has this packet type
    LENGTH = 2  # [0] bytes of payload that are expected
    RANGE = 3  # [0] offset in the payload of the field out of range; [1] the limit it broke
    NO_MODEL = 4  # no model is in use: send one first
    NOT_TARED = 5  # there is no reference: send a TARE first; of a TARE: none to bring back
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
    """eits_fault: Faults of the board or the skin, and the meaning of index, value and words."""

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
    ANALOG_SUPPLY = 20  # the analog supply of +-15 V, or one half of it, is missing


class Drive(IntEnum):
    """eits_drive: Current may flow through the skin, or the reason that it may not."""

    OFF = 0  # no host has asked for frames
    ON = 1  # a host has, and is heard
    SILENT = 2  # off: no packet came from the host for a second
    TRIPPED = 3  # off: the current was above its limit


class Setting(IntFlag):
    """eits_setting: Bits of the owner's settings."""

    KEEP_CURRENT = 1  # current flows on where no host listens
    LOCKED = 2  # models, settings and lower excitations need the blue button
    SENSE = 4  # a sense resistor is fitted: the current is measured
    BUTTON_LOW = 8  # the owner's button pulls its pin low, and does not lift it


class RawFlags(IntFlag):
    """eits_raw_flags: Bits of a RAW's flags."""

    REFERENCE = 1  # a frame of a tare
    RECIPROCAL = 2  # only one row of each reciprocal pair was measured
    CHECK = 4  # a full scan among such, for the check of reciprocity
    ALIGNED = 8  # the touches after each drive brought it to the instant of its last drive
    TRUSTED = 16  # and it was solved: its drives are accounted for
    BEGUN = 32  # the tracker of touches began with it


class Stream(IntFlag):
    """eits_stream: Bits of what is streamed of each frame."""

    RAW = 1  # its voltages, as a RAW
    IMAGE = 2  # its image, as an IMAGE
    TOUCHES = 4  # its touches, as TOUCHES
    EVENTS = 8  # its events, as EVENTS, also where there are none; a tare forgets fingers
    DRIVE_TOUCHES = 16  # touches after each drive, as DRIVE_TOUCHES


@dataclass(frozen=True)
class InfoPacket(Payload, c="eits_packet_info"):
    """The board, its model and its settings. Fields are added at its end."""

    request: U32  # of the GET_INFO that asked; 0 after a restart
    firmware: Version  # major, minor, patch, 0
    board: Text16  # such as nucleo_f767zi, zero-filled
    serial: Text24  # the processor's serial number, hexadecimal, zero-filled
    f_cpu_hz: U32  # processor clock, Hz
    electrodes: U32  # of the multiplexers
    bank_bytes: U32  # most bytes of a model
    data_bytes: U32  # most bytes in one MODEL_DATA
    model_bytes: U32  # of the model in use; 0: none
    model_crc: U32  # CRC-32 of the whole model file, as zlib's crc32
    protocol_hash: U64  # of the protocol that is scanned
    n_electrodes: U32  # of the model, as all down to storage
    n_rows: U32  # of its protocol
    n_folded: U32  # its rows once reciprocal ones are averaged
    rank: U32  # numbers of the reduced data
    n_pixels: U32  # pixels of an IMAGE
    nx: U32  # columns of the grid that the pixels lie in
    ny: U32  # rows of that grid
    storage: U32  # eits_storage: 0 f32, 1 f16, 2 i16, 3 i8
    bank: U32  # that the model is in
    excitation_millihz: U32  # as the generator's tuning word gives it
    sample_rate_hz: U32  # of the converter
    samples: U16  # of a measurement
    settle_us: U16  # settling time
    # from one measurement to the next; 0, as all of the scan: the frames are another instrument's
    slot_us: U32
    check_every: U16  # every n-th frame is scanned fully; 1: all; 0: none
    streaming: U16  # bits of eits_stream
    every: U16  # every n-th frame is streamed
    tared: U16  # 1: there is a reference
    frame_period_us: U32  # 0: as fast as the scan goes
    faults: U32  # bit k: fault number k is raised
    volts_per_code_nv: U32  # between the electrodes, for one step of the converter
    drive: U16  # eits_drive
    settings: U16  # bits of eits_setting
    source_ua_rms: U32  # what the current source gives as built; 0: not known
    current_ua_rms: U32  # as measured last; 0: there is no sense resistor, or no current
    current_limit_ua_rms: U32  # above which the drive goes off; 0: none
    name: Text32  # that the owner gave the board, zero-filled; empty: none
    source_ua: U32  # amplitude of the current source; 0: not known
    # volts at the converter per volt between the electrodes, in millionths; 0: not known
    gain_ppm: U32
    button: U32  # the level of the button's pin now; 2: there is none
    reserved: U32  # 0


@dataclass(frozen=True)
class ReplyPacket(Payload, c="eits_packet_reply"):
    """The result of the command with this request number."""

    request: U32  # of the command that is answered
    command: U16  # its packet type
    status: U16  # eits_reply_status
    detail: Pair = (0, 0)  # by status


@dataclass(frozen=True)
class RawHead(Payload, c="eits_packet_raw"):
    """A scanned frame. n_rows numbers in V follow in the protocol's order, the very numbers that
    the board's core got, NaN for a row that could not be used; then as many quality bytes.
    """

    frame: U32  # counts scanned frames; wraps
    time_us: U32  # when its scan began, on the board's clock; wraps
    scan_us: U32  # how long the scan took
    n_rows: U16  # voltages, and quality bytes, that follow
    flags: U16  # bits of eits_raw_flags


@dataclass(frozen=True)
class SolvedPacket(Payload, c="eits_packet_solved"):
    """Head of IMAGE and TOUCHES: what eits_info says, and the times."""

    frame: U32  # number of the scanned frame, as in its RAW
    time_us: U32  # when its scan began
    solve_us: U32  # time for the solve
    touch_us: U32  # time for the touches
    age_us: U32  # from the end of its scan until this packet was made
    count: U16  # pixels or touches that follow
    status: Negated  # 0, or minus an eits_status: then the image is zero and there are no touches
    stop: Stop  # eits_stop
    shown: Shown  # eits_shown; 0 where no touches were looked for
    masked: U16  # rows left out
    iterations: U32  # that the solver took
    nonzeros: U32  # coefficients that are not zero
    macs: U32  # multiply-accumulates of the solve
    touch_macs: U32  # of the touches
    lambda_: F32  # as used for this frame
    lambda_max: F32  # the least lambda whose image is zero
    lambda_noise: F32  # max(S'y) of noise, by the reference; 0: unknown
    gap_rel: F32  # relative duality gap
    residual: F32  # its norm
    data_norm: F32  # norm of the reduced data
    diagnostics: U32 = 0  # bits of eits_diagnostic
    # saturated rows without masked ones: by the converter or beyond the core's limit
    saturated: U16 = 0
    outliers: U16 = 0  # rows left out as outliers
    model_mismatch: F32 = 0.0  # fraction of the data outside the model's range
    open_electrodes: Electrodes = ()  # bit e: electrode e
    bridged_electrodes: Electrodes = ()  # likewise, of one or more pairs
    noisy_electrodes: Electrodes = ()  # likewise


@dataclass(frozen=True)
class TouchPacket(Payload, c="eits_packet_touch"):
    """A touch, as eits_touch."""

    id: U32  # from 1; stays with a touch from frame to frame
    x_mm: F32  # of the centre, in the model's coordinates
    y_mm: F32  # of the centre
    radius_mm: F32  # of the disc that was fitted
    strength_s_per_m_mm2: F32  # S mm^2/m
    explained: F32  # fraction of the data that it alone explains, 0 to 1; 0: held, not found
    force_n: F32  # 0 where the model is not calibrated
    confidence: F32  # probability that it is one touch; 0: not known
    x_variance_mm2: F32  # covariance of the centre; 0: not known
    xy_covariance_mm2: F32
    y_variance_mm2: F32
    long_x_mm: F32  # half of the long axis as a vector; 0, 0: a disc, or not known
    long_y_mm: F32
    radius_sd_mm: F32  # standard deviation of the radius; 0: the data do not tell the radius
    confirmed: U32  # 1: a whole frame has shown it


@dataclass(frozen=True)
class DriveTouchesHead(Payload, c="eits_packet_drive_touches"):
    """Touches as of an instant within a scan. Where nothing touches it is sent once: when that
    begins, or the touches have gone.
    """

    frame: U32  # number of the frame that is scanned
    time_us: U32  # the instant they hold for: the middle of the drive, were no row repeated
    begun: U32  # the frame before which nothing was known
    age_us: U16  # from the end of the drive until this packet was made; at most 65,535
    update_us: U16  # of it for the update; likewise
    drive: U16  # of the protocol, in the order of first rows
    count: U16  # touches that follow


@dataclass(frozen=True)
class DriveTouch(Payload, c="eits_packet_drive_touch"):
    """A touch, as eits_fast_touch."""

    id: U16  # from 1, as in TOUCHES; stays with a touch
    confirmed: Flag  # 1: a whole frame has shown it
    x_mm: F32  # of the centre, in the model's coordinates
    y_mm: F32  # of the centre
    vx_mm_per_s: F32  # its velocity
    vy_mm_per_s: F32
    strength_s_per_m_mm2: F32  # S mm^2/m
    radius_mm: F32  # of the disc that it is taken for
    x_variance_mm2: F32  # covariance of the centre
    xy_covariance_mm2: F32
    y_variance_mm2: F32


@dataclass(frozen=True)
class EventsHead(Payload, c="eits_packet_events"):
    """Events of a frame; there are none if the core rejected it."""

    frame: U32  # number of the scanned frame, as in its RAW
    time_us: U32  # when its scan began
    count: U32  # events that follow


@dataclass(frozen=True)
class EventPacket(Payload, c="eits_packet_event"):
    """One event, as eits_event (gesture_events.h); its time is the frame's, its zone the host's."""

    kind: U16  # eits_event_kind
    phase: U16  # eits_event_phase
    first_id: U32  # of the touch, as it was when it landed
    second_id: U32  # of two fingers the second; else 0
    x_mm: F32  # where
    y_mm: F32
    direction_deg: F32  # of a swipe, 0 along x, 90 along y
    value: F32  # by kind


@dataclass(frozen=True)
class StageStats(Payload, c="eits_stage_stats"):
    """Times of one stage."""

    count: U32  # frames that were timed
    last_us: U32  # of the last such frame
    p99_us: U32  # 99th percentile: the upper edge of its bin, an eighth of an octave wide
    worst_us: U32  # of all since the start, or since GET_STATS set the times to zero


@dataclass(frozen=True)
class StatsPacket(Payload, c="eits_packet_stats"):
    """The board's counters."""

    request: U32  # of the GET_STATS that asked
    uptime_ms: U32  # since the start
    frames_scanned: U32  # streamed or not
    frames_solved: U32  # where image or touches were streamed
    packets_sent: U32  # since the link came up
    packets_dropped: U32  # a dropped packet still takes a sequence number
    deadlines_missed: U32  # frame periods missed
    slots_repeated: U32  # measurements taken again because the switch came too late
    outliers: U32  # rows left out as outliers, of all frames since there is a reference
    link_packets: U32  # commands received
    link_crc_errors: U32  # whole packets whose checksum does not fit
    link_framing_errors: U32  # ended inside a COBS block, or shorter than head and checksum
    link_overruns: U32  # longer than the receive buffer
    stack_bytes: U32  # that are set aside
    stack_used: U32  # the most so far
    workspace_bytes: U32  # for the model's context and its frames
    workspace_used: U32  # of them by the model in use
    stages: Stages  # by eits_stage


@dataclass(frozen=True)
class FaultPacket(Payload, c="eits_packet_fault"):
    """A fault that rose or went."""

    code: U16  # eits_fault
    raised: Flag  # 1: it is there; 0: it has gone
    frame: U32  # in which it rose or went
    index: I32  # by code, as value and words
    value: I32  # by code
    words: Words = (0, 0, 0, 0, 0)  # by code; 0 where it has none


@dataclass(frozen=True)
class HashesPacket(Payload, c="eits_packet_hashes"):
    """SHA-256 of what the board's flash holds."""

    request: U32  # of the GET_HASHES that asked
    model: Hash  # of the model in use; zero: none
    firmware: Hash  # of the program; zero: not known


@dataclass(frozen=True)
class ProbedHead(Payload, c="eits_packet_probed"):
    """A burst of a fixed row; then its samples, codes of the converter, u16 each."""

    request: U32  # of the PROBE that asked
    start_us: U32  # when the burst began, on the board's clock
    switched_us: U32  # when its electrodes had been joined
    samples: U16  # that follow
    lost: U16  # 1: the converter lost samples


@dataclass(frozen=True)
class GetInfo(Command, c="eits_command_plain", kind=PacketType.GET_INFO):
    """send an INFO"""


@dataclass(frozen=True)
class StreamCommand(Command, c="eits_command_stream", kind=PacketType.STREAM):
    """what to send of each frame"""

    what: U16  # bits of eits_stream; 0 stops
    every: One = 1  # every n-th frame, at least 1
    frames: U32 = 0  # so many streamed frames, then stop; 0: until stopped


@dataclass(frozen=True)
class Tare(Command, c="eits_command_tare", kind=PacketType.TARE):
    """take the reference"""

    # 1, or 4 to 1024; 0: the reference before the last tare comes back, where it is kept
    frames: U32


@dataclass(frozen=True)
class Scan(Command, c="eits_command_scan", kind=PacketType.SCAN):
    """how frames are scanned; forgets the reference"""

    excitation_millihz: U32  # 1,000 to 250,000,000, below half the sample rate
    sample_rate_hz: U32  # 1,000 to 5,000,000
    samples: U16  # 4 to 1024
    settle_us: U16  # at most 50,000
    # 1: every frame is full; n > 1: one row of each reciprocal pair, every n-th frame full; 0:
    # never full
    check_every: U16
    reserved: U16  # 0
    frame_period_us: U32  # at most 600,000,000; 0: as fast as the scan goes


@dataclass(frozen=True)
class Solver(Command, c="eits_command_solver", kind=PacketType.SOLVER):
    """the solver's options"""

    iterations: U32  # 1 to 1000
    max_touches: U32  # at most EITS_MAX_TOUCHES
    warm_start: U32  # 0 or 1
    sign: U32  # eits_sign: 0 increase, 1 decrease, 2 both
    lambda_rel: F32  # 0 to 1
    gap_rel: F32  # 0 to 1
    solver: U32  # eits_solver: 0 FISTA, 1 working set, 3 active set; 2 is reserved and rejected
    mac_limit: U32  # multiply-accumulates a frame; 0: no limit
    diagnostics: U32  # bits of eits_diagnostic that are looked for


@dataclass(frozen=True)
class ModelBegin(Command, c="eits_command_model_begin", kind=PacketType.MODEL_BEGIN):
    """stop the scan and erase the bank that is not in use"""

    bytes: U32  # of the model, at least 64
    crc: U32  # CRC-32 of the whole model


@dataclass(frozen=True)
class ModelData(Command, c="eits_command_model_data", kind=PacketType.MODEL_DATA):
    """bytes of the model"""

    offset: U32  # of the first byte
    data: bytes = b""


@dataclass(frozen=True)
class ModelCommit(Command, c="eits_command_plain", kind=PacketType.MODEL_COMMIT):
    """use the model that was sent"""


@dataclass(frozen=True)
class GetStats(Command, c="eits_command_get_stats", kind=PacketType.GET_STATS):
    """send a STATS"""

    reset: U32 = 0  # 1: set the times to zero after sending them


@dataclass(frozen=True)
class MaskRow(Command, c="eits_command_mask_row", kind=PacketType.MASK_ROW):
    """leave a row out, or use it again"""

    row: U16  # of the protocol
    masked: One = 1  # 1: leave it out; 0: use it again


@dataclass(frozen=True)
class Reset(Command, c="eits_command_plain", kind=PacketType.RESET):
    """restart the board"""


@dataclass(frozen=True)
class SelfTest(Command, c="eits_command_plain", kind=PacketType.SELF_TEST):
    """run the model's golden frame"""


@dataclass(frozen=True)
class ClearFaults(Command, c="eits_command_plain", kind=PacketType.CLEAR_FAULTS):
    """forget the faults"""


@dataclass(frozen=True)
class Keepalive(Command, c="eits_command_keepalive", kind=PacketType.KEEPALIVE):
    """the host is there, or goes and the current stops; not answered"""

    present: U32  # 1: it is; 0: it goes, and the current stops now


@dataclass(frozen=True)
class Settings(Command, c="eits_command_settings", kind=PacketType.SETTINGS):
    """the owner's settings, kept in flash"""

    settings: U32  # bits of eits_setting
    # at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1: as it is
    current_limit_ua_rms: U32
    name: Text32  # letters, digits, - and _, the first a letter or digit; zero-filled; empty: none
    # amplitude of the current source as fitted, 10 to 7,000; 0: as designed; 2^32 - 1: as it is
    source_ua: U32
    # from electrodes to converter as fitted, 10,000 to 400,000,000; 0: as designed; 2^32 - 1: as it
    # is
    gain_ppm: U32


@dataclass(frozen=True)
class GetHashes(Command, c="eits_command_plain", kind=PacketType.GET_HASHES):
    """send HASHES"""


@dataclass(frozen=True)
class Probe(Command, c="eits_command_probe", kind=PacketType.PROBE):
    """measure a fixed row once and send PROBED"""

    # electrodes of I+, I-, V+, V- of 8 bits each, the first one lowest; 2^32 - 1: all open
    before: U32
    joined: U32  # the same of the burst that is sent
    settle_us: U16  # from the switch to the burst's first sample, at least; at most 50,000
    samples: U16  # 4 to 1024; those of SCAN's rate
    generator: One  # 1: it runs; 0: it is in reset
    reserved: U16  # 0
