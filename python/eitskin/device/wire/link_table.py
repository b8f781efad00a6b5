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
    """eits_packet_type: Types below 0x80 are sent by the board, the others by the host."""

    INFO = 0x1  # the board, its model and its settings
    REPLY = 0x2  # how a command ended
    RAW = 0x10  # a scanned frame
    IMAGE = 0x11  # a frame's image
    TOUCHES = 0x12  # a frame's touches
    EVENTS = 0x15  # a frame's events: taps, swipes and other gestures
    DRIVE_TOUCHES = 0x17  # touches after a drive
    STATS = 0x13  # the board's counters
    FAULT = 0x14  # a fault that was raised or cleared
    HASHES = 0x16  # SHA-256 of the model and of the firmware
    PROBED = 0x18  # the converter's codes for one row
    RECORDING = 0x70  # never on a wire: the first packet of an .eits file
    GET_INFO = 0x80  # send an INFO
    STREAM = 0x81  # choose what the board sends for each frame
    TARE = 0x82  # take the reference
    SCAN = 0x83  # set how frames are scanned, and forget the reference
    SOLVER = 0x84  # set the solver's options
    MODEL_BEGIN = 0x85  # stop the scan and erase the bank that is not in use
    MODEL_DATA = 0x86  # store bytes of the model
    MODEL_COMMIT = 0x87  # use the model that was sent
    GET_STATS = 0x88  # send a STATS
    MASK_ROW = 0x89  # leave a row out, or use it again
    RESET = 0x8A  # restart the board
    SELF_TEST = 0x8B  # run the model's golden frame
    CLEAR_FAULTS = 0x8C  # forget the faults
    KEEPALIVE = 0x8D  # the host is present; or it leaves, and the current stops. Not answered
    SETTINGS = 0x8E  # store the owner's settings in flash
    GET_HASHES = 0x8F  # send HASHES
    PROBE = 0x90  # measure one row once, and send a PROBED


class ReplyStatus(IntEnum):
    """eits_reply_status: The result of a command. The reply's `detail` adds to it; [0] and [1] are
    its two numbers.
    """

    OK = 0  # the command was carried out; of MODEL_BEGIN: [0] the offset to continue from
    UNKNOWN_COMMAND = 1  # no command has this packet type
    LENGTH = 2  # the payload has the wrong length: [0] the expected bytes
    # a field is out of range: [0] its offset in the payload; [1] the limit that it exceeded
    RANGE = 3
    NO_MODEL = 4  # no model is in use: send one first
    # there is no reference: send a TARE first; of a TARE: there is no earlier reference to restore
    NOT_TARED = 5
    BUSY = 6  # another command is still running: [0] its packet type
    # the model is too large: [0] the bytes that a bank, a packet or the memory can hold
    MODEL_SIZE = 7
    MODEL_INVALID = 8  # the core rejected the model: [0] eits_status
    # the board has too few electrodes: [0] those that the protocol needs; [1] those of the board
    MODEL_SCAN = 9
    MODEL_CRC = 10  # the bytes that arrived do not have the checksum that MODEL_BEGIN announced
    OFFSET = 11  # MODEL_DATA came out of order: [0] the expected offset; -1: no upload has begun
    FLASH = 12  # erasing or programming failed: [0] the offset
    CORE = 13  # the core reported an error: [0] eits_status
    # the samples do not span whole excitation periods: [0] the nearest number that does
    PERIODS = 14
    TOO_FAST = 15  # the frame period is too short: [0] the shortest one for this scan, us
    # the self-test failed: [0] difference from the golden image in parts per 1e9 of its peak
    SELF_TEST = 16
    LOCKED = 17  # the owner has locked the board: hold its blue button
    TRIPPED = 18  # the current was above its limit: send CLEAR_FAULTS first
    # touches after each drive need a model with fields, a reference that is not tracked, full
    # scans, and every frame streamed
    DRIVES = 19


class Quality(IntFlag):
    """eits_quality: Bits of a row's quality byte."""

    SATURATED = 1  # a sample lay at either end of the converter's range
    # the multiplexers were switched later than the settling time before the first sample
    UNSETTLED = 2
    RECIPROCITY = 4  # the row and its reciprocal disagree (in full scans and checks)
    COPIED = 8  # the row was not measured, and has its reciprocal's value
    # one of its electrodes seems to be open. Set only without a reference and during a tare; later
    # the core finds open electrodes
    OPEN = 16
    MASKED = 32  # the row is left out by MASK_ROW


class FaultCode(IntEnum):
    """eits_fault: Faults of the board or the skin, and the meaning of index, value and words."""

    NO_MODEL = 1  # no bank holds a valid model; value: eits_status of the newest bank
    ELECTRODE_OPEN = 2  # an electrode is open; index: electrode
    SATURATED = 3  # rows are saturated; index: the first; value: their number
    DEADLINE = 4  # a frame took longer than the frame period; value: by how many us
    # reciprocal rows disagree; index: the worst row; value: its difference in parts per thousand of
    # the rms voltage
    RECIPROCITY = 5
    SOLVER = 6  # the core rejected the frame; value: eits_status
    SCAN_STALLED = 7  # the converter or its DMA delivered nothing in time
    CRASH = 8  # the board restarted after a processor fault; words: pc, lr, cfsr, hfsr, address
    WATCHDOG = 9  # the board restarted because the program hung
    BUS = 10  # writing to the generator or the multiplexers failed
    # electrodes are bridged; index: one of them; value: its partner, or -1 if more than two are
    # bridged; words[0], [1]: bit e for each such electrode e
    BRIDGED = 11
    ELECTRODE_NOISY = 12  # an electrode is noisy; index: electrode
    # no change of the skin explains the frame; value: the unexplained parts per thousand of the
    # data, or 0 if the signs of rows show it
    MODEL_MISMATCH = 13
    # frames change in a way that touches cannot; only solved frames raise it, and a tare clears it
    STALE_REFERENCE = 14
    # the reference is unlike the model's; only solved frames raise it, and a tare clears it
    UNLIKE_MODEL = 15
    CURRENT = 16  # the current was above its limit and was switched off; value: uA rms
    CLOCK = 17  # the board restarted because the generator's clock failed
    SUPPLY = 18  # the board restarted because its supply fell below 2.9 V
    LOCKED = 19  # the locked board refused a command; index: its packet type
    ANALOG_SUPPLY = 20  # the analog supply of +-15 V, or one half of it, is missing


class Drive(IntEnum):
    """eits_drive: Whether current may flow through the skin, and if not, why."""

    OFF = 0  # off: no host has asked for frames
    ON = 1  # on: a host has asked for frames, and still sends packets
    SILENT = 2  # off: no packet came from the host for a second
    TRIPPED = 3  # off: the current was above its limit


class Setting(IntFlag):
    """eits_setting: Bits of the owner's settings."""

    KEEP_CURRENT = 1  # the current keeps flowing when no host listens
    # changing models or settings, or lowering the excitation frequency, needs the blue button
    LOCKED = 2
    SENSE = 4  # a sense resistor is fitted, and the current is measured
    BUTTON_LOW = 8  # a pressed button pulls its pin low; without this bit it pulls it high


class RawFlags(IntFlag):
    """eits_raw_flags: Bits of a RAW's flags."""

    REFERENCE = 1  # the frame belongs to a tare
    RECIPROCAL = 2  # only one row of each reciprocal pair was measured
    CHECK = 4  # a full scan between half ones, which checks reciprocity
    ALIGNED = 8  # the tracker brought all rows to the instant of the last drive
    # the frame was solved: touches explain its drives, or frames have not been explained for a
    # while
    TRUSTED = 16
    BEGUN = 32  # the tracker began with this frame


class Stream(IntFlag):
    """eits_stream: Bits that choose what is streamed for each frame."""

    RAW = 1  # its voltages, as a RAW
    IMAGE = 2  # its image, as an IMAGE
    TOUCHES = 4  # its touches, as TOUCHES
    EVENTS = 8  # its events, as EVENTS, also if there are none; a tare forgets the fingers
    DRIVE_TOUCHES = 16  # touches after each drive, as DRIVE_TOUCHES


@dataclass(frozen=True)
class InfoPacket(Payload, c="eits_packet_info"):
    """The board, its model and its settings. New fields are added at the end."""

    request: U32  # that of the GET_INFO which asked; 0 after a restart
    firmware: Version  # major, minor, patch, 0
    board: Text16  # the kind of board, such as nucleo_f767zi; zero-filled
    serial: Text24  # the processor's serial number, hexadecimal, zero-filled
    f_cpu_hz: U32  # processor clock, Hz
    electrodes: U32  # electrodes that the multiplexers can reach
    bank_bytes: U32  # the size of a bank: the most bytes of a model
    data_bytes: U32  # the most bytes in one MODEL_DATA
    model_bytes: U32  # size of the model in use; 0: no model
    model_crc: U32  # CRC-32 of the whole model file, as zlib's crc32
    protocol_hash: U64  # hash of the protocol that is scanned
    n_electrodes: U32  # electrodes of the model; the fields down to storage describe the model, too
    n_rows: U32  # rows of its protocol
    n_folded: U32  # rows that are left when reciprocal ones are averaged
    rank: U32  # numbers of the reduced data
    n_pixels: U32  # pixels of an IMAGE
    nx: U32  # columns of the grid that the pixels lie in
    ny: U32  # rows of that grid
    storage: U32  # eits_storage: 0 f32, 1 f16, 2 i16, 3 i8
    bank: U32  # the bank that holds the model
    excitation_millihz: U32  # excitation frequency, as the generator's tuning word gives it
    sample_rate_hz: U32  # sample rate of the converter
    samples: U16  # samples per measurement
    settle_us: U16  # settling time before the first sample
    # time from one measurement to the next; 0, as all numbers of the scan, if the frames come from
    # another instrument
    slot_us: U32
    check_every: U16  # every n-th frame is scanned fully; 1: all frames; 0: none
    streaming: U16  # bits of eits_stream: what is streamed
    every: U16  # every n-th frame is streamed
    tared: U16  # 1: there is a reference
    frame_period_us: U32  # time from one frame to the next; 0: as fast as the scan allows
    faults: U32  # bit k: fault number k is raised
    volts_per_code_nv: U32  # voltage between the electrodes that is one step of the converter
    drive: U16  # eits_drive: whether current may flow
    settings: U16  # bits of eits_setting
    source_ua_rms: U32  # current that the source gives as built; 0: not known
    current_ua_rms: U32  # current as last measured; 0: there is no sense resistor, or no current
    current_limit_ua_rms: U32  # current above which the drive is switched off; 0: no limit
    name: Text32  # name that the owner gave the board, zero-filled; empty: none
    source_ua: U32  # amplitude of the current source; 0: not known
    # volts at the converter per volt between the electrodes, in millionths; 0: not known
    gain_ppm: U32
    button: U32  # present level of the button's pin; 2: there is no button
    reserved: U32  # must be 0


@dataclass(frozen=True)
class ReplyPacket(Payload, c="eits_packet_reply"):
    """The result of the command with this request number."""

    request: U32  # request number of the command that is answered
    command: U16  # its packet type
    status: U16  # eits_reply_status
    detail: Pair = (0, 0)  # meaning depends on the status


@dataclass(frozen=True)
class RawHead(Payload, c="eits_packet_raw"):
    """A scanned frame. It is followed by n_rows voltages, V, in the protocol's order, exactly as
    the board's core got them, NaN for a row that could not be used; then by n_rows quality bytes.
    """

    frame: U32  # counts scanned frames; wraps
    time_us: U32  # when its scan began, on the board's clock; wraps
    scan_us: U32  # how long the scan took
    n_rows: U16  # number of voltages, and of quality bytes, that follow
    flags: U16  # bits of eits_raw_flags


@dataclass(frozen=True)
class SolvedPacket(Payload, c="eits_packet_solved"):
    """The head of IMAGE and TOUCHES: the numbers of eits_info, and times."""

    frame: U32  # number of the scanned frame, as in its RAW
    time_us: U32  # when its scan began
    solve_us: U32  # how long the solve took
    touch_us: U32  # how long the touches took
    age_us: U32  # time from the end of its scan until this packet was made
    count: U16  # pixels or touches that follow
    # 0, or minus the eits_status of a rejected frame, whose image is zero and which has no touches
    status: Negated
    stop: Stop  # eits_stop: why the solver stopped
    shown: Shown  # eits_shown: which image shows the frame; 0 if no touches were looked for
    masked: U16  # rows left out
    iterations: U32  # iterations of the solver
    nonzeros: U32  # coefficients that are not zero
    macs: U32  # multiply-accumulates of the solve
    touch_macs: U32  # multiply-accumulates of the touches
    lambda_: F32  # lambda as used for this frame
    lambda_max: F32  # the least lambda whose image is zero
    lambda_noise: F32  # max(S'y) of noise, as the reference showed it; 0: unknown
    gap_rel: F32  # relative duality gap
    residual: F32  # norm of the residual
    data_norm: F32  # norm of the reduced data
    diagnostics: U32 = 0  # bits of eits_diagnostic
    # saturated rows, masked ones not counted: at the converter's limit or beyond the core's
    saturated: U16 = 0
    outliers: U16 = 0  # rows left out as outliers
    model_mismatch: F32 = 0.0  # fraction of the data that lies outside the model's range
    open_electrodes: Electrodes = ()  # bit e: electrode e is open
    bridged_electrodes: Electrodes = ()  # bit e: electrode e is bridged with another one
    noisy_electrodes: Electrodes = ()  # bit e: electrode e is noisy


@dataclass(frozen=True)
class TouchPacket(Payload, c="eits_packet_touch"):
    """A touch, like eits_touch."""

    id: U32  # number from 1 that stays with a touch from frame to frame
    x_mm: F32  # x of the centre, in the model's coordinates
    y_mm: F32  # y of the centre
    radius_mm: F32  # radius of the fitted disc
    strength_s_per_m_mm2: F32  # change of conductivity times area, S mm^2/m
    # fraction of the data that only this touch explains, 0 to 1; 0: it was not found in this frame,
    # and is held
    explained: F32
    force_n: F32  # force, N; 0 if the model is not calibrated
    confidence: F32  # probability that this is exactly one touch; 0: not known
    x_variance_mm2: F32  # covariance of the centre, with the next two; 0: not known
    xy_covariance_mm2: F32
    y_variance_mm2: F32
    long_x_mm: F32  # half of an ellipse's long axis, as a vector; 0, 0: a disc, or not known
    long_y_mm: F32
    radius_sd_mm: F32  # standard deviation of the radius; 0: the data do not determine the radius
    confirmed: U32  # 1: a whole frame has shown it


@dataclass(frozen=True)
class DriveTouchesHead(Payload, c="eits_packet_drive_touches"):
    """Touches at an instant within a scan. While nothing touches the skin, the packet is sent only
    once: after the tracker has begun, or after the last touch has gone.
    """

    frame: U32  # number of the frame that is scanned
    # the instant for which they hold: the middle of the drive, as if no row had been repeated
    time_us: U32
    begun: U32  # the frame with which the tracker began
    age_us: U16  # time from the end of the drive until this packet was made; at most 65,535
    update_us: U16  # the part of it that the tracker took; at most 65,535
    drive: U16  # number of the drive; drives are in the order of their first rows
    count: U16  # touches that follow


@dataclass(frozen=True)
class DriveTouch(Payload, c="eits_packet_drive_touch"):
    """A touch, like eits_fast_touch."""

    id: U16  # number from 1 that stays with a touch, the same as in TOUCHES
    confirmed: Flag  # 1: a whole frame has shown it
    x_mm: F32  # x of the centre, in the model's coordinates
    y_mm: F32  # y of the centre
    vx_mm_per_s: F32  # velocity
    vy_mm_per_s: F32
    strength_s_per_m_mm2: F32  # change of conductivity times area, S mm^2/m
    radius_mm: F32  # radius of the disc with which the touch is modelled
    x_variance_mm2: F32  # covariance of the centre, with the next two
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
    """One event, like eits_event (gesture_events.h), at its frame's time. The host adds zones."""

    kind: U16  # eits_event_kind
    phase: U16  # eits_event_phase
    first_id: U32  # id that the touch had when it landed
    second_id: U32  # id of the second of two fingers; 0 for gestures of one finger
    x_mm: F32  # place of the event
    y_mm: F32
    direction_deg: F32  # direction of a swipe: 0 along x, 90 along y
    value: F32  # meaning depends on the kind


@dataclass(frozen=True)
class StageStats(Payload, c="eits_stage_stats"):
    """Times of one stage."""

    count: U32  # frames that were timed
    last_us: U32  # time of the last such frame
    p99_us: U32  # 99th percentile: the upper edge of its bin, an eighth of an octave wide
    worst_us: U32  # longest time since the start, or since GET_STATS set the times to zero


@dataclass(frozen=True)
class StatsPacket(Payload, c="eits_packet_stats"):
    """The board's counters."""

    request: U32  # that of the GET_STATS which asked
    uptime_ms: U32  # time since the start
    frames_scanned: U32  # frames that were scanned, streamed or not
    frames_solved: U32  # frames that were solved because image or touches are streamed
    packets_sent: U32  # packets sent since the link came up
    packets_dropped: U32  # packets that were dropped; each still takes a sequence number
    deadlines_missed: U32  # frame periods missed
    slots_repeated: U32  # measurements repeated because the multiplexers switched too late
    outliers: U32  # rows left out as outliers in all frames since the reference was taken
    link_packets: U32  # commands received
    link_crc_errors: U32  # whole packets whose checksum does not fit
    # packets that ended inside a COBS block, or shorter than head and checksum
    link_framing_errors: U32
    link_overruns: U32  # packets longer than the receive buffer
    stack_bytes: U32  # bytes reserved for the stack
    stack_used: U32  # the most bytes of it used so far
    workspace_bytes: U32  # bytes reserved for the model's context and its frames
    workspace_used: U32  # bytes of it that the model in use takes
    stages: Stages  # times, indexed by eits_stage


@dataclass(frozen=True)
class FaultPacket(Payload, c="eits_packet_fault"):
    """A fault that was raised or cleared."""

    code: U16  # eits_fault
    raised: Flag  # 1: the fault was raised; 0: it was cleared
    frame: U32  # the frame in which that happened
    index: I32  # index, value and words: their meaning depends on the code (eits_fault)
    value: I32
    words: Words = (0, 0, 0, 0, 0)  # 0 if the code has none


@dataclass(frozen=True)
class HashesPacket(Payload, c="eits_packet_hashes"):
    """SHA-256 hashes of what the board's flash holds."""

    request: U32  # that of the GET_HASHES which asked
    model: Hash  # hash of the model in use; all zero: no model
    firmware: Hash  # hash of the program; all zero: not known


@dataclass(frozen=True)
class ProbedHead(Payload, c="eits_packet_probed"):
    """A burst of one row. Its samples follow: codes of the converter, u16 each."""

    request: U32  # that of the PROBE which asked
    start_us: U32  # when the burst began, on the board's clock
    switched_us: U32  # when its electrodes had been switched
    samples: U16  # number of samples that follow
    lost: U16  # 1: the converter lost samples


@dataclass(frozen=True)
class GetInfo(Command, c="eits_command_plain", kind=PacketType.GET_INFO):
    """send an INFO"""


@dataclass(frozen=True)
class StreamCommand(Command, c="eits_command_stream", kind=PacketType.STREAM):
    """choose what the board sends for each frame"""

    what: U16  # bits of eits_stream; 0 stops the stream
    every: One = 1  # stream every n-th frame; at least 1
    frames: U32 = 0  # stop after this many streamed frames; 0: stream until stopped


@dataclass(frozen=True)
class Tare(Command, c="eits_command_tare", kind=PacketType.TARE):
    """take the reference"""

    # frames to take: 1, or 4 to 1024; 0: restore the reference from before the last tare, if it was
    # kept
    frames: U32


@dataclass(frozen=True)
class Scan(Command, c="eits_command_scan", kind=PacketType.SCAN):
    """set how frames are scanned, and forget the reference"""

    # excitation frequency: 1,000 to 250,000,000, below half the sample rate
    excitation_millihz: U32
    sample_rate_hz: U32  # sample rate of the converter: 1,000 to 5,000,000
    samples: U16  # samples per measurement: 4 to 1024
    settle_us: U16  # settling time before the first sample: at most 50,000
    # 1: every frame is scanned fully; n > 1: only every n-th one, the others with one row of each
    # reciprocal pair; 0: none is scanned fully
    check_every: U16
    reserved: U16  # must be 0
    # time from one frame to the next: at most 600,000,000; 0: as fast as the scan allows
    frame_period_us: U32


@dataclass(frozen=True)
class Solver(Command, c="eits_command_solver", kind=PacketType.SOLVER):
    """set the solver's options"""

    iterations: U32  # 1 to 1000
    max_touches: U32  # at most EITS_MAX_TOUCHES
    warm_start: U32  # 0 or 1
    sign: U32  # eits_sign: 0 increase, 1 decrease, 2 both
    lambda_rel: F32  # 0 to 1
    gap_rel: F32  # 0 to 1
    solver: U32  # eits_solver: 0 FISTA, 1 working set, 3 active set; 2 is reserved and rejected
    mac_limit: U32  # multiply-accumulates per frame; 0: no limit
    diagnostics: U32  # bits of eits_diagnostic that are looked for


@dataclass(frozen=True)
class ModelBegin(Command, c="eits_command_model_begin", kind=PacketType.MODEL_BEGIN):
    """stop the scan and erase the bank that is not in use"""

    bytes: U32  # size of the model, at least 64
    crc: U32  # CRC-32 of the whole model


@dataclass(frozen=True)
class ModelData(Command, c="eits_command_model_data", kind=PacketType.MODEL_DATA):
    """store bytes of the model"""

    offset: U32  # offset of the first byte within the model
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

    row: U16  # row of the protocol
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
    """the host is present; or it leaves, and the current stops. Not answered"""

    present: U32  # 1: the host is present; 0: it leaves, and the current stops now


@dataclass(frozen=True)
class Settings(Command, c="eits_command_settings", kind=PacketType.SETTINGS):
    """store the owner's settings in flash"""

    settings: U32  # bits of eits_setting
    # limit of the current: at most 10,000; 0: 1.25 times what the source gives; 2^32 - 1: unchanged
    current_limit_ua_rms: U32
    # the board's name. It has letters, digits, - and _, and begins with a letter or digit;
    # zero-filled; empty: none
    name: Text32
    # amplitude of the current source as fitted, 10 to 7,000; 0: as designed; 2^32 - 1: unchanged
    source_ua: U32
    # gain from electrodes to converter as fitted, 10,000 to 400,000,000; 0: as designed; 2^32 - 1:
    # unchanged
    gain_ppm: U32


@dataclass(frozen=True)
class GetHashes(Command, c="eits_command_plain", kind=PacketType.GET_HASHES):
    """send HASHES"""


@dataclass(frozen=True)
class Probe(Command, c="eits_command_probe", kind=PacketType.PROBE):
    """measure one row once, and send a PROBED"""

    # electrodes of the first row: I+, I-, V+, V-, 8 bits each, I+ lowest; 2^32 - 1: all are open
    before: U32
    joined: U32  # electrodes of the second row, in the same form
    settle_us: U16  # least time from switching to the first sample; at most 50,000
    samples: U16  # samples per burst, at the sample rate of SCAN: 4 to 1024
    generator: One  # 1: the generator runs; 0: it is held in reset
    reserved: U16  # must be 0
