"""Touches in the words of the program on the emulated Cortex-M7 (tests/emulated/frames_m7.c)."""

import struct
from collections.abc import Sequence
from dataclasses import astuple

from eitskin.core.diagnostics_table import Touch


def bits(value: float) -> str:
    return f"{struct.unpack('<I', struct.pack('<f', value))[0]:08x}"


def printed_touches(touches: Sequence[Touch]) -> str:
    """Their number, then each one's id and the bits of its numbers."""
    each = ([value or 0.0 for value in astuple(t)[1:]] for t in touches)
    words = [f" {t.id}:{':'.join(map(bits, n))}" for t, n in zip(touches, each, strict=True)]
    return f"{len(words)}{''.join(words)}"
