"""Compute the capacity of a serial line: the frames of each kind that it carries without drops."""

from math import ceil

from eitskin.device.client import Device
from eitskin.device.wire.link_table import (
    DriveTouch,
    DriveTouchesHead,
    EventPacket,
    EventsHead,
    RawHead,
    SolvedPacket,
    Stream,
    TouchPacket,
)
from eitskin.device.wire.packets import BoardInfo

BITS_A_BYTE = 10  # start, eight, stop
USED = 0.9  # of the line; the rest is for replies, faults and bursts
PACKET_BYTES = 16  # head, checksum, zeros and stuffing
ROW_BYTES = 4 + 1  # the voltage and the quality
PIXEL_BYTES = 4
RAW_BYTES, SOLVED_BYTES = RawHead.LAYOUT.size, SolvedPacket.LAYOUT.size
# of a busy frame: eight touches, four events; after each drive one touch
TOUCHES_BYTES = 8 * TouchPacket.LAYOUT.size
EVENTS_BYTES = EventsHead.LAYOUT.size + 4 * EventPacket.LAYOUT.size
DRIVE_TOUCHES_BYTES = DriveTouchesHead.LAYOUT.size + DriveTouch.LAYOUT.size


def frame_bytes(info: BoardInfo, what: Stream) -> int:
    """Return the approximate number of bytes of one frame on the wire."""
    kinds = {
        Stream.RAW: RAW_BYTES + ROW_BYTES * info.n_rows,
        Stream.IMAGE: SOLVED_BYTES + PIXEL_BYTES * info.n_pixels,
        Stream.TOUCHES: SOLVED_BYTES + TOUCHES_BYTES,
        Stream.EVENTS: EVENTS_BYTES,
        Stream.DRIVE_TOUCHES: info.n_electrodes * (DRIVE_TOUCHES_BYTES + PACKET_BYTES)
        - PACKET_BYTES,
    }
    return sum(size + PACKET_BYTES + size // 254 for kind, size in kinds.items() if kind & what)


def least_every(info: BoardInfo, what: Stream, baud: int) -> int:
    """The least N with which every N-th frame of ``what`` fits a line of ``baud``; 1 if all do."""
    if not info.has_model:
        return 1
    line_us = 1e6 * frame_bytes(info, what) * BITS_A_BYTE / (USED * baud)
    return max(ceil(line_us / max(info.frame_us, 1)), 1)


def carried_every(device: Device, what: Stream) -> int:
    """As ``least_every``, for the line to ``device``; 1 if no line limits it (simulated boards,
    recordings)."""
    baud = device.transport.capabilities.baud
    return 1 if baud is None else least_every(device.board, what, baud)
