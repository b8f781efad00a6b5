"""Keep every packet of a session in memory, including those of the tare, for later use."""

from collections.abc import Iterator
from contextlib import suppress

from eitskin.device.client import Device
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.codec import Packet
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import (
    DriveTouches,
    Fault,
    FrameEvents,
    RawFrame,
    SolvedImage,
    SolvedTouches,
)
from eitskin.device.wire.payloads import MalformedPacket, parse
from eitskin.session.assemble import assembled
from eitskin.session.frame import Message

_Content = RawFrame | SolvedImage | SolvedTouches | DriveTouches | FrameEvents | Fault


class PacketLog:
    """A log of the packets that ``device`` sends from now on, until ``stop``."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self.packets: list[Packet] = []
        self._tap = self.packets.append
        device.link.begin_tap(lambda sequence: None, self._tap)

    def stop(self) -> None:
        self._device.link.end_tap(self._tap)

    def frames(self, what: Stream) -> Iterator[Message]:
        """Return the frames so far, with the faults and gaps between them; ``what`` are the kinds
        that were streamed."""
        return assembled(self._contents(), what)

    def _contents(self) -> Iterator[_Content | LinkEvent]:
        for packet in self.packets:
            if packet.lost:
                yield LinkEvent("gap", packet.lost)
            with suppress(MalformedPacket):
                content = parse(packet.type, packet.payload)
                if isinstance(content, _Content):
                    yield content
