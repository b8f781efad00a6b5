"""Payloads from a board as bytes: fields by their layouts in ``link_table``, then what follows
them."""

from collections.abc import Callable, Sequence
from dataclasses import astuple
from math import isfinite
from typing import Any, NamedTuple, TypeVar

import numpy as np

from eitskin.core.diagnostics_table import SHOWN, STOPS
from eitskin.core.gestures import GestureEvent
from eitskin.core.gestures_table import EventKind, EventPhase
from eitskin.core.results import known_touch
from eitskin.device.wire.layout import Payload
from eitskin.device.wire.link_table import (
    STAGES,
    DriveTouch,
    DriveTouchesHead,
    EventPacket,
    EventsHead,
    PacketType,
    ProbedHead,
    RawHead,
    StageStats,
    TouchPacket,
)
from eitskin.device.wire.packets import (
    BoardHashes,
    BoardInfo,
    BoardStats,
    DriveTouches,
    Fault,
    FrameEvents,
    FromBoard,
    ProbedBurst,
    RawFrame,
    Reply,
    Solved,
    SolvedImage,
    SolvedTouches,
)

OLDEST_INFO_BYTES = 168  # of the first firmware of this link version
OLDEST_TOUCH_BYTES = 52
OLDEST_DRIVE_TOUCH_BYTES = 24


class MalformedPacket(ValueError):
    """A packet whose checksum is right but whose payload is not of its type: of a board that does
    not keep to its version."""


class Form(NamedTuple):
    """How a field's values on the wire become what Python has, and back."""

    read: Callable[[Sequence[Any]], Any]
    write: Callable[[Any], Sequence[Any]]


def _read_text(values: Sequence[Any]) -> str:
    return str(values[0].split(b"\0", 1)[0].decode("ascii", "replace"))


def _read_electrodes(values: Sequence[Any]) -> tuple[int, ...]:
    word = values[0]
    return tuple(bit for bit in range(64) if word >> bit & 1) if word else ()


def _read_stop(values: Sequence[Any]) -> str:
    if values[0] >= len(STOPS):
        raise MalformedPacket(f"stop {values[0]} is not known")
    return STOPS[values[0]]


def _read_shown(values: Sequence[Any]) -> str:
    if values[0] >= len(SHOWN):
        raise MalformedPacket(f"shown {values[0]} is not known")
    return SHOWN[values[0]]


def _read_stages(values: Sequence[Any]) -> dict[str, StageStats]:
    return {name: StageStats(*values[4 * k : 4 * k + 4]) for k, name in enumerate(STAGES)}


FORMS = {
    "": Form(lambda values: values[0], lambda value: (value,)),
    "one": Form(lambda values: values[0], lambda value: (value,)),
    "text": Form(_read_text, lambda text: (text.encode("ascii"),)),
    "version": Form(lambda values: tuple(values[0][:3]), lambda three: (bytes([*three, 0]),)),
    "hash": Form(lambda values: bytes(values[0]), lambda value: (value,)),
    "pair": Form(tuple, tuple),
    "words": Form(tuple, tuple),
    "electrodes": Form(_read_electrodes, lambda bits: (sum(1 << bit for bit in bits),)),
    "stop": Form(_read_stop, lambda name: (STOPS.index(name),)),
    "shown": Form(_read_shown, lambda name: (SHOWN.index(name),)),
    "negated": Form(lambda values: -values[0], lambda value: (-value,)),
    "flag": Form(lambda values: bool(values[0]), lambda value: (int(value),)),
    "stages": Form(
        _read_stages, lambda stages: [n for name in STAGES for n in astuple(stages[name])]
    ),
}

AnyPayload = TypeVar("AnyPayload", bound=Payload)


def unpack(kind: type[AnyPayload], payload: bytes, what: str, *, more: bool = False) -> AnyPayload:
    """The fields at the start of ``payload``; without ``more`` nothing may follow."""
    layout = kind.LAYOUT
    if len(payload) < layout.size or (len(payload) > layout.size and not more):
        raise MalformedPacket(f"{what}: {len(payload)} bytes, not {layout.size}")
    return _made(kind, layout.struct.unpack_from(payload), what)


def _made(kind: type[AnyPayload], values: Sequence[Any], what: str) -> AnyPayload:
    """The payload whose values on the wire are ``values``."""
    layout, found = kind.LAYOUT, {}
    if not all(map(isfinite, [values[place] for place in layout.reals])):
        raise MalformedPacket(f"{what}: a value that is not a number")
    for name, form, start, end in layout.places:
        found[name] = FORMS[form].read(values[start:end]) if form else values[start]
    return kind(**found)


def pack(fields: Payload) -> bytes:
    """The bytes of a payload's fields."""
    values: list[Any] = []
    for name, _, form in fields.LAYOUT.fields:
        values += FORMS[form].write(getattr(fields, name))
    return fields.LAYOUT.struct.pack(*values)


def _check_rest(payload: bytes, head: Payload, size: int, what: str) -> None:
    expected = head.LAYOUT.size + size
    if len(payload) != expected:
        raise MalformedPacket(f"{what}: {len(payload)} bytes, not {expected}")


def parse_info(payload: bytes) -> BoardInfo:
    """Parse an INFO, which may grow at its end: fields that an older board does not send are 0, and
    unknown fields of a newer board are skipped."""
    if len(payload) >= OLDEST_INFO_BYTES:
        payload = payload.ljust(BoardInfo.LAYOUT.size, b"\0")
    return unpack(BoardInfo, payload, "INFO", more=True)


def parse_raw(payload: bytes) -> RawFrame:
    head = unpack(RawHead, payload, "RAW", more=True)
    _check_rest(payload, head, 5 * head.n_rows, "RAW")
    start = head.LAYOUT.size
    volts = np.frombuffer(payload, dtype="<f4", count=head.n_rows, offset=start)
    quality = np.frombuffer(payload, dtype=np.uint8, offset=start + 4 * head.n_rows)
    return RawFrame(head.frame, head.time_us, head.scan_us, head.flags, volts, quality)


def parse_probed(payload: bytes) -> ProbedBurst:
    head = unpack(ProbedHead, payload, "PROBED", more=True)
    _check_rest(payload, head, 2 * head.samples, "PROBED")
    codes = np.frombuffer(payload, dtype="<u2", offset=head.LAYOUT.size).astype(np.int64)
    return ProbedBurst(head.request, head.start_us, head.switched_us, bool(head.lost), codes)


def parse_image(payload: bytes) -> SolvedImage:
    solved = unpack(Solved, payload, "IMAGE", more=True)
    _check_rest(payload, solved, 4 * solved.count, "IMAGE")
    image = np.frombuffer(payload, dtype="<f4", offset=solved.LAYOUT.size)
    if not np.isfinite(image).all():
        raise MalformedPacket("IMAGE: a pixel that is not a number")
    return SolvedImage(solved, image)


def parse_touches(payload: bytes) -> SolvedTouches:
    solved, each = unpack(Solved, payload, "TOUCHES", more=True), TouchPacket.LAYOUT
    rest = payload[solved.LAYOUT.size :]
    if solved.count > 0 and len(rest) == OLDEST_TOUCH_BYTES * solved.count:
        # from a board that does not send deviations of radii; its touches are those of whole frames
        confirmed = (1).to_bytes(4, "little")
        rest = _grown(rest, OLDEST_TOUCH_BYTES, each.size - len(confirmed), confirmed)
    else:
        _check_rest(payload, solved, each.size * solved.count, "TOUCHES")
    found = list(each.struct.iter_unpack(rest))
    if not all(map(isfinite, (value for one in found for value in one))):
        raise MalformedPacket("TOUCHES: a value that is not a number")
    return SolvedTouches(solved, tuple(map(known_touch, found)))


def _grown(parts: bytes, had: int, has: int, end: bytes = b"") -> bytes:
    """Return ``parts`` of ``had`` bytes, each filled with zeros to ``has``, and with ``end``."""
    missing = bytes(has - had) + end
    return b"".join(parts[k : k + had] + missing for k in range(0, len(parts), had))


def parse_drive_touches(payload: bytes) -> DriveTouches:
    head, each = unpack(DriveTouchesHead, payload, "DRIVE_TOUCHES", more=True), DriveTouch.LAYOUT
    rest = payload[head.LAYOUT.size :]
    if head.count > 0 and len(rest) == OLDEST_DRIVE_TOUCH_BYTES * head.count:
        rest = _grown(rest, OLDEST_DRIVE_TOUCH_BYTES, each.size)
    else:
        _check_rest(payload, head, each.size * head.count, "DRIVE_TOUCHES")
    values = each.struct.iter_unpack(rest)
    return DriveTouches(head, tuple(_made(DriveTouch, one, "DRIVE_TOUCHES") for one in values))


def parse_events(payload: bytes) -> FrameEvents:
    head, each = unpack(EventsHead, payload, "EVENTS", more=True), EventPacket.LAYOUT
    _check_rest(payload, head, each.size * head.count, "EVENTS")
    found = each.struct.iter_unpack(payload[head.LAYOUT.size :])
    events = tuple(_event(head.time_us, *values) for values in found)
    return FrameEvents(head.frame, head.time_us, events)


def _event(time_us: int, kind: int, phase: int, *rest: float) -> GestureEvent:
    first_id, second_id, *reals = rest
    if kind not in _KINDS or phase not in _PHASES or not np.isfinite(reals).all():
        raise MalformedPacket(f"EVENTS: kind {kind}, phase {phase}, numbers {reals} are no event")
    ids = int(first_id), int(second_id), 0, time_us
    return GestureEvent(EventKind(kind), EventPhase(phase), *ids, *reals)  # type: ignore[arg-type]


_KINDS, _PHASES = frozenset(EventKind), frozenset(EventPhase)
_PARSERS: dict[int, Callable[[bytes], FromBoard]] = {
    PacketType.INFO: parse_info,
    PacketType.REPLY: lambda payload: unpack(Reply, payload, "REPLY"),
    PacketType.RAW: parse_raw,
    PacketType.IMAGE: parse_image,
    PacketType.TOUCHES: parse_touches,
    PacketType.EVENTS: parse_events,
    PacketType.DRIVE_TOUCHES: parse_drive_touches,
    PacketType.STATS: lambda payload: unpack(BoardStats, payload, "STATS"),
    PacketType.PROBED: parse_probed,
    PacketType.HASHES: lambda payload: unpack(BoardHashes, payload, "HASHES"),
    PacketType.FAULT: lambda payload: unpack(Fault, payload, "FAULT"),
}


def parse(packet_type: int, payload: bytes) -> FromBoard | None:
    """The payload of a packet from a board; None for a type that is not known, which is passed
    over.

    Raises:
        MalformedPacket: the payload is not of its type.
    """
    parser = _PARSERS.get(packet_type)
    return None if parser is None else parser(payload)
