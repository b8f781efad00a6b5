"""Makes the bytes that a board sends: the inverse of ``payloads.parse``."""

from dataclasses import astuple

from eitskin.device.wire.link_table import RawHead, TouchPacket
from eitskin.device.wire.packets import RawFrame, SolvedImage, SolvedTouches
from eitskin.device.wire.payloads import pack


def build_raw(raw: RawFrame) -> bytes:
    head = RawHead(raw.frame, raw.time_us, raw.scan_us, len(raw.voltage_v), raw.flags)
    return pack(head) + raw.voltage_v.astype("<f4").tobytes() + raw.quality.astype("u1").tobytes()


def build_image(image: SolvedImage) -> bytes:
    return pack(image.solved) + image.image.astype("<f4").tobytes()


def build_touches(touches: SolvedTouches) -> bytes:
    each = (
        TouchPacket.LAYOUT.struct.pack(*(value or 0 for value in astuple(touch)))
        for touch in touches.touches
    )
    return pack(touches.solved) + b"".join(each)
