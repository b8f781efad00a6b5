"""The bytes of a model bank: the model from its start, and in its last 32 bytes the record that
makes it valid.

The firmware programs the record last, as the commit of an upload; docs/reference/link-protocol.md,
"Model banks", specifies it.
"""

import struct
import zlib

from eitskin.errors import DeviceError

BANK_BYTES = 512 * 1024
MAGIC = 0x4B4E4245  # "EBNK"
ERASED = 0xFF
_RECORD = struct.Struct("<IIIIIIII")
RECORD_BYTES = _RECORD.size


def record_offset(bank_bytes: int = BANK_BYTES) -> int:
    """Return the byte at which the record begins in a bank, which is the longest a model can be."""
    return bank_bytes - _RECORD.size


def record_bytes(model: bytes, generation: int) -> bytes:
    """The 32 bytes that make ``model`` valid."""
    head = _RECORD.pack(MAGIC, generation % 2**32, len(model), zlib.crc32(model), 0, 0, 0, 0)[:-4]
    return head + struct.pack("<I", zlib.crc32(head))


def too_large(model_bytes: int, room_bytes: int) -> str:
    """Why a model of ``model_bytes`` has no place in a bank with room for ``room_bytes``."""
    return (
        f"the model has {model_bytes} bytes and a bank of the board holds {room_bytes}; build it"
        " with  --storage i8,  fewer pixels or a lower rank (eitskin model build --help)"
    )


def bank_bytes(model: bytes, generation: int, bank_bytes: int = BANK_BYTES) -> bytes:
    """A whole bank of ``bank_bytes`` with ``model`` and its record; what lies between is as erased
    flash reads, 0xFF."""
    room = record_offset(bank_bytes)
    if len(model) > room:
        raise DeviceError(too_large(len(model), room))
    return model + bytes([ERASED]) * (room - len(model)) + record_bytes(model, generation)
