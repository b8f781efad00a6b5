"""The mean of the last reference, from the untouched frames that a tare sends."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.device.link import Link
from eitskin.device.wire.codec import Packet
from eitskin.device.wire.link_table import PacketType
from eitskin.device.wire.packets import RawFrame
from eitskin.device.wire.payloads import MalformedPacket, parse

MAX_FRAMES = 1024  # of one tare


class ReferenceMean:
    """Taps ``link``: ``mean_v`` (m,) is known once a frame follows the untouched ones; rows that
    could not be measured are 0 V. It is None if no untouched frames were seen. ``before`` is the
    reference of the device before it was opened again."""

    def __init__(self, link: Link, before: "ReferenceMean | None" = None) -> None:
        self.mean_v: FloatArray | None = None if before is None else before.mean_v
        self._last_v: FloatArray | None = None
        self._untouched: list[FloatArray] = []
        link.begin_tap(lambda last: None, self._take)

    def _take(self, packet: Packet) -> None:
        if packet.type != PacketType.RAW:
            return
        try:
            raw = parse(packet.type, packet.payload)
        except MalformedPacket:
            return
        assert isinstance(raw, RawFrame)
        if raw.untouched:
            self._untouched.append(np.asarray(raw.voltage_v, dtype=np.float64))
            del self._untouched[:-MAX_FRAMES]
        elif self._untouched:
            self._last_v = self.mean_v
            mean = np.mean(np.array(self._untouched), axis=0)
            self.mean_v = np.where(np.isfinite(mean), mean, 0.0)
            self._untouched = []

    def undo(self) -> None:
        """The reference before the last one is in use again."""
        self.mean_v = self._last_v
