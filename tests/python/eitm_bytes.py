"""The bytes of an .eitm file by docs/reference/eitm-format.md alone, without the project's own
reader: to look, to break, to seal."""

import struct
import zlib
from typing import NamedTuple

HEADER_SIZE = 64
ENTRY_SIZE = 16


class Place(NamedTuple):
    offset: int
    size: int
    flags: int


def sections_of(blob: bytes | bytearray) -> dict[str, Place]:
    count = struct.unpack_from("<I", blob, 16)[0]
    entries = [
        struct.unpack_from("<4sIII", blob, HEADER_SIZE + ENTRY_SIZE * k) for k in range(count)
    ]
    return {tag.decode(): Place(offset, size, flags) for tag, offset, size, flags in entries}


def entry_place(blob: bytes | bytearray, name: str) -> int:
    return HEADER_SIZE + ENTRY_SIZE * list(sections_of(blob)).index(name)


def fnv1a(content: bytes) -> int:
    value = 0xCBF29CE484222325
    for byte in content:
        value = ((value ^ byte) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return value


def sealed(
    blob: bytes | bytearray,
    *,
    total: int | None = None,
    count: int | None = None,
    rehash: bool = False,
) -> bytes:
    """``blob`` with its checksum repaired, and its size, number of sections and protocol hash where
    wanted."""
    out = bytearray(blob)
    if total is not None:
        struct.pack_into("<I", out, 8, total)
    if count is not None:
        struct.pack_into("<I", out, 16, count)
    if rehash:
        dims, table = sections_of(out)["DIMS"], sections_of(out)["PROT"]
        head = struct.pack(
            "<HH", *(value & 0xFFFF for value in struct.unpack_from("<2I", out, dims.offset))
        )
        struct.pack_into("<Q", out, 24, fnv1a(head + out[table.offset : table.offset + table.size]))
    size = struct.unpack_from("<I", out, 8)[0]
    struct.pack_into("<I", out, 12, zlib.crc32(bytes(out[16:size])))
    return bytes(out)


def patched(
    blob: bytes | bytearray, at: int, layout: str, *values: float, rehash: bool = False
) -> bytes:
    """``blob`` with ``values`` packed at ``at``, and sealed again."""
    out = bytearray(blob)
    struct.pack_into(layout, out, at, *values)
    return sealed(out, rehash=rehash)
