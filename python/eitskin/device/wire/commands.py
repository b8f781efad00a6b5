"""What travels to a board: each command's payload as a frozen dataclass, whose first word on the
wire is the request number."""

from __future__ import annotations

import struct
from dataclasses import dataclass, fields
from typing import ClassVar, TypeVar

from eitskin.device.wire.packets import PacketType


@dataclass(frozen=True)
class Command:
    """A command without parameters beside its request number, such as GET_INFO."""

    TYPE: ClassVar[PacketType]
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")

    def payload(self, request: int) -> bytes:
        """The bytes of its payload.

        Raises:
            struct.error: a field does not fit its width.
        """
        return self.LAYOUT.pack(request, *(getattr(self, one.name) for one in fields(self)))


@dataclass(frozen=True)
class GetInfo(Command):
    TYPE = PacketType.GET_INFO


@dataclass(frozen=True)
class ModelCommit(Command):
    TYPE = PacketType.MODEL_COMMIT


@dataclass(frozen=True)
class Reset(Command):
    TYPE = PacketType.RESET


@dataclass(frozen=True)
class SelfTest(Command):
    TYPE = PacketType.SELF_TEST


@dataclass(frozen=True)
class ClearFaults(Command):
    TYPE = PacketType.CLEAR_FAULTS


@dataclass(frozen=True)
class StreamCommand(Command):
    """``what``: bits of ``packets.Stream``, 0 stops; ``every`` n-th frame; ``frames`` streamed
    frames, 0: until told."""

    TYPE = PacketType.STREAM
    LAYOUT = struct.Struct("<IHHI")
    what: int
    every: int = 1
    frames: int = 0


@dataclass(frozen=True)
class Tare(Command):
    """``frames``: 1, or 4 to 1024."""

    TYPE = PacketType.TARE
    LAYOUT = struct.Struct("<II")
    frames: int


@dataclass(frozen=True)
class Scan(Command):
    """How frames are scanned; forgets the tare. ``check_every``: 1, every frame is full; n > 1,
    reciprocal-unique with every n-th full; 0, never full. ``frame_period_us`` 0: as fast as the
    scan goes."""

    TYPE = PacketType.SCAN
    LAYOUT = struct.Struct("<IIIHHHHI")
    excitation_millihz: int
    sample_rate_hz: int
    samples: int
    settle_us: int
    check_every: int
    reserved: int
    frame_period_us: int


@dataclass(frozen=True)
class Solver(Command):
    """Options of the solver; ``sign`` and ``solver`` are their places in ``core.results.SIGNS`` and
    ``SOLVERS``, ``diagnostics`` what is looked for, bit k of ``DIAGNOSTICS``; ``track`` 1: touches
    are followed in time."""

    TYPE = PacketType.SOLVER
    LAYOUT = struct.Struct("<IIIIIffIIII")
    iterations: int
    max_touches: int
    warm_start: int
    sign: int
    lambda_rel: float
    gap_rel: float
    solver: int
    mac_limit: int
    diagnostics: int
    track: int


@dataclass(frozen=True)
class ModelBegin(Command):
    """Announces a model of ``bytes`` bytes with CRC-32 ``crc``; stops the scan and erases the bank
    that is not in use."""

    TYPE = PacketType.MODEL_BEGIN
    LAYOUT = struct.Struct("<III")
    bytes: int
    crc: int


@dataclass(frozen=True)
class ModelData(Command):
    """``data`` of the model from ``offset`` on."""

    TYPE = PacketType.MODEL_DATA
    LAYOUT = struct.Struct("<II")
    offset: int
    data: bytes

    def payload(self, request: int) -> bytes:
        return self.LAYOUT.pack(request, self.offset) + self.data


@dataclass(frozen=True)
class GetStats(Command):
    """``reset`` 1: begin the statistics anew after sending them."""

    TYPE = PacketType.GET_STATS
    LAYOUT = struct.Struct("<II")
    reset: int = 0


@dataclass(frozen=True)
class MaskRow(Command):
    """Leave protocol row ``row`` out (``masked`` 1) or use it again (0)."""

    TYPE = PacketType.MASK_ROW
    LAYOUT = struct.Struct("<IHH")
    row: int
    masked: int = 1


COMMANDS: dict[int, type[Command]] = {
    kind.TYPE: kind
    for kind in (
        GetInfo, StreamCommand, Tare, Scan, Solver, ModelBegin, ModelData, ModelCommit, GetStats,
        MaskRow, Reset, SelfTest,
        ClearFaults,
    )
}  # fmt: skip

AnyCommand = TypeVar("AnyCommand", bound=Command)


def parse_command(kind: type[AnyCommand], payload: bytes) -> tuple[int, AnyCommand] | None:
    """Request number and command, as a board reads them; None where the payload's length is not the
    command's."""
    size = kind.LAYOUT.size
    if kind is ModelData:
        if len(payload) < size:
            return None
        request, *values = kind.LAYOUT.unpack_from(payload)
        return request, kind(*values, payload[size:])  # type: ignore[call-arg]
    if len(payload) != size:
        return None
    request, *values = kind.LAYOUT.unpack(payload)
    return request, kind(*values)
