"""The capacity of a serial line: how many frames of which kinds it carries without drops."""

from math import ceil

from eitskin.device.client import Device
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import BoardInfo

BITS_A_BYTE = 10  # start, eight, stop
USED = 0.9  # of the line; the rest is for replies, faults and what comes in bursts
PACKET_BYTES = 16  # head, checksum, zeros and stuffing
RAW_BYTES, ROW_BYTES = 16, 5
SOLVED_BYTES, PIXEL_BYTES, TOUCHES_BYTES = 104, 4, 8 * 44
EVENTS_BYTES = 12 + 4 * 28
DRIVE_TOUCHES_BYTES = 20 + 24  # of one touch, after each drive


def frame_bytes(info: BoardInfo, what: Stream) -> int:
    """Bytes on the wire of one frame, about."""
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
    """The least N with which every N-th frame of ``what`` fits a line of ``baud``; 1 where all
    do."""
    if not info.has_model:
        return 1
    line_us = 1e6 * frame_bytes(info, what) * BITS_A_BYTE / (USED * baud)
    return max(ceil(line_us / max(info.frame_us, 1)), 1)


def carried_every(device: Device, what: Stream) -> int:
    """As ``least_every``, of the line to ``device``; 1 where no line limits it (simulated boards,
    recordings)."""
    baud = device.transport.capabilities.baud
    return 1 if baud is None else least_every(device.board, what, baud)
