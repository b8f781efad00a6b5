"""The C codec through cffi: packets to bytes and bytes to packets. Bytes that form no packet are
counted."""

import threading
import zlib
from collections import deque
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from eitskin.core.engine import load_core
from eitskin.device.wire.link_table import LINK_MAX_PAYLOAD, PacketType
from eitskin.device.wire.sequence import LATE_IN_A_ROW, LinkCounters, SequenceCheck
from eitskin.errors import DeviceError
from eitskin.threads import one_at_a_time


@dataclass(frozen=True)
class Packet:
    """A packet whose checksum is right. ``lost``: packets that are missing just before it, by their
    numbers."""

    type: int
    sequence: int
    payload: bytes
    lost: int = 0


@cache
def _core() -> Any:
    return load_core("float32")


def encode(packet_type: int, sequence: int, payload: bytes) -> bytes:
    """The packet's bytes on the wire."""
    module = _core()
    buffer = module.ffi.new("uint8_t[]", len(payload) + len(payload) // 254 + 32)
    number, nothing = sequence % 2**32, module.ffi.NULL
    size = module.lib.eits_link_encode(
        buffer, len(buffer), packet_type, number, payload, len(payload), nothing, 0
    )
    if not size:
        raise DeviceError(
            f"a packet cannot carry {len(payload)} bytes; the most is {LINK_MAX_PAYLOAD}"
        )
    return bytes(module.ffi.buffer(buffer, size))


class Decoder:
    """Bytes of one direction of a link to packets, in order and each at most once. ``counters`` is
    counted into.

    What comes before the first delimiter is the rest of a packet that was cut by opening the port,
    and no error.
    """

    def __init__(self, counters: LinkCounters | None = None) -> None:
        module = _core()
        self.lock = threading.RLock()
        self._lib, self._ffi = module.lib, module.ffi
        room = int(self._lib.EITS_LINK_MAX_PACKET)
        self._buffer = self._ffi.new("uint64_t[]", (room + 7) // 8)
        self._state = self._ffi.new("eits_link_decoder *")
        self._begin(room)
        self._packet = self._ffi.new("eits_link_packet *")
        self.counters = LinkCounters() if counters is None else counters
        self._sequence = SequenceCheck(self.counters)
        self._late: deque[Packet] = deque(maxlen=LATE_IN_A_ROW)

    def _begin(self, room: int) -> None:
        buffer = self._ffi.cast("uint8_t *", self._buffer)
        status = self._lib.eits_link_decoder_init(self._state, buffer, room)
        assert status == 0
        self._before = self._counted()
        self._skipping = True

    @property
    def other_version(self) -> int | None:
        """The link version of the last packet that had another than ours; None if none had."""
        return int(self._state.other_version) if self._state.version_errors else None

    @one_at_a_time
    def link_lost(self) -> None:
        """Call this after the line was cut: a packet that is half received is then no error, and
        any packet may come next, which counts as one gap."""
        self._begin(self._state.room)
        self._sequence.link_lost()

    @one_at_a_time
    def forget_sequence(self) -> None:
        """The next packet is taken whatever its number; used where everything has been refused for
        too long."""
        self._sequence.link_lost()

    @one_at_a_time
    def feed(self, data: bytes) -> list[Packet]:
        """The packets that ``data`` completes. Those that are no news (duplicates, late ones) are
        counted and left out."""
        self.counters.bytes += len(data)
        start = 0
        if self._skipping:
            start = data.find(0)
            self.counters.skipped_bytes += len(data) if start < 0 else start
            if start < 0:
                return []
            self._skipping = False
        found: list[Packet] = []
        view = self._ffi.from_buffer("uint8_t[]", data)
        packet, state, feed = self._packet, self._state, self._lib.eits_link_feed
        while start < len(data):
            start += feed(state, view + start, len(data) - start, packet)
            if packet.payload:
                payload = bytes(self._ffi.buffer(packet.payload, packet.size))
                found += self._take(Packet(packet.type, packet.sequence, payload))
        self._count()
        return found

    def _take(self, packet: Packet) -> list[Packet]:
        if packet.type == PacketType.RECORDING:  # the head is outside of the numbering
            self.counters.packets += 1
            return [packet]
        restart = packet.type == PacketType.INFO and packet.payload[:4] == b"\0\0\0\0"
        lost = self._sequence.admit(
            packet.sequence, zlib.crc32(packet.payload, packet.type), restart=restart
        )
        if lost is None:
            if self._sequence.was_late:
                self._late.append(packet)
            return []
        revived = list(self._late)[-self._sequence.revived :] if self._sequence.revived else []
        self._late.clear()
        self.counters.packets += 1 + len(revived)
        return [*revived, replace(packet, lost=lost) if lost else packet]

    def _counted(self) -> tuple[int, ...]:
        s = self._state
        return s.crc_errors, s.framing_errors, s.overruns, s.version_errors

    def _count(self) -> None:
        now = self._counted()
        new = [(a - b) % 2**32 for a, b in zip(now, self._before, strict=True)]
        self._before = now
        self.counters.crc_errors += new[0]
        self.counters.framing_errors += new[1]
        self.counters.overruns += new[2]
        self.counters.version_errors += new[3]
