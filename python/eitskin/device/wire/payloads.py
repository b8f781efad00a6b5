"""Payloads from a board as bytes: their layouts, reading and making them. A test holds the layouts
against the C structs."""

from __future__ import annotations

import struct
from dataclasses import asdict

import numpy as np

from eitskin.core.results import STOPS, Touch
from eitskin.device.wire.packets import (
    STAGES,
    BoardInfo,
    BoardStats,
    Fault,
    FromBoard,
    PacketType,
    RawFrame,
    Reply,
    Solved,
    SolvedImage,
    SolvedTouches,
    StageStats,
)

INFO_STRUCT = struct.Struct("<I4s16s24sIIIIIIQIIIIIIIIIIIHHIHHHHIII")
REPLY_STRUCT = struct.Struct("<IHHii")
RAW_STRUCT = struct.Struct("<IIIHH")
SOLVED_STRUCT = struct.Struct("<IIIIIHHHHIIIIffffffIHHfQQQ")
TOUCH_STRUCT = struct.Struct("<Iffffff")
STAGE_STRUCT = struct.Struct("<IIII")
STATS_STRUCT = struct.Struct("<17I" + 4 * len(STAGES) * "I")
FAULT_STRUCT = struct.Struct("<HHIii5I")


class MalformedPacket(ValueError):
    """A packet whose checksum is right but whose payload is not of its type: of a board that does
    not keep to its version."""


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
    values[1:4] = [
        bytes([*info.firmware, 0]),
        info.board.encode("ascii"),
        info.serial.encode("ascii"),
    ]
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


def _bits(word: int) -> tuple[int, ...]:
    """The places of the bits that are set."""
    return tuple(bit for bit in range(64) if word >> bit & 1) if word else ()


def _parse_solved(payload: bytes, what: str, each: int) -> Solved:
    if len(payload) < SOLVED_STRUCT.size:
        raise MalformedPacket(f"{what}: {len(payload)} bytes are too few")
    f, t, solve, touch, age, count, status, stop, *rest, opened, bridged, noisy = (
        SOLVED_STRUCT.unpack_from(payload)
    )
    _exactly(payload, SOLVED_STRUCT.size + each * count, what)
    if stop >= len(STOPS):
        raise MalformedPacket(f"{what}: stop {stop} is not known")
    rest += [_bits(opened), _bits(bridged), _bits(noisy)]
    return Solved(f, t, solve, touch, age, count, -status, STOPS[stop], *rest)


def _build_solved(solved: Solved) -> bytes:
    values = asdict(solved) | {"status": -solved.status, "stop": STOPS.index(solved.stop)}
    values |= {
        name: sum(1 << e for e in values[name])
        for name in ("open_electrodes", "bridged_electrodes", "noisy_electrodes")
    }
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
    stages = {name: StageStats(*values[17 + 4 * k : 21 + 4 * k]) for k, name in enumerate(STAGES)}
    return BoardStats(*values[:17], stages)  # type: ignore[call-arg]


def build_stats(stats: BoardStats) -> bytes:
    *head, _ = (getattr(stats, name) for name in BoardStats.__dataclass_fields__)
    times = (asdict(stats.stages[name]).values() for name in STAGES)
    return STATS_STRUCT.pack(*head, *(value for stage in times for value in stage))


def parse_fault(payload: bytes) -> Fault:
    _exactly(payload, FAULT_STRUCT.size, "FAULT")
    code, raised, frame, index, value, *words = FAULT_STRUCT.unpack(payload)
    return Fault(
        code, bool(raised), frame, index, value, (words[0], words[1], words[2], words[3], words[4])
    )


def build_fault(fault: Fault) -> bytes:
    return FAULT_STRUCT.pack(
        fault.code, fault.raised, fault.frame, fault.index, fault.value, *fault.words
    )


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
    """The payload of a packet from a board; None for a type that is not known, which is passed
    over.

    Raises:
        MalformedPacket: the payload is not of its type.
    """
    parser = _PARSERS.get(packet_type)  # type: ignore[call-overload]
    return None if parser is None else parser(payload)
