"""Read and write .eitm files as docs/reference/eitm-format.md specifies them, byte by byte: header,
checksum and table of sections. ``eitm_sections`` handles the contents of the sections. This reader
is independent of the C reader."""

import struct
import zlib
from pathlib import Path
from typing import Any

from eitskin.core.engine import CoreEngine
from eitskin.errors import EitskinError, ModelError
from eitskin.fileio import read_bytes, write_bytes
from eitskin.model.eitm_sections import REQUIRED, Sections, decode_sections, encode_sections
from eitskin.model.model import GAIN_DRIFT_KEPT, TRACKS_REFERENCE, Model

MAGIC = b"EITM"
MAJOR, MINOR = 1, 12
HEADER = struct.Struct("<4sHHIIIIQ32x")
ENTRY = struct.Struct("<4sIII")
OPTIONAL = (
    "SCAL", "META", "FLDS", "LOAD", "WHIT", "UNCE", "GEOM", "MOVE", "ROWE", "PREC", "PLAC", "ORDR",
    "SUMS", "SURF",
)  # fmt: skip
REQUIRED_FLAG = 1
MAX_SECTIONS = 256


def encode_model(model: Model, sums: bytes = b"") -> bytes:
    """Return the bytes of the file, with ``sums`` as the section SUMS unless empty."""
    sections = encode_sections(model)
    if sums:
        sections["SUMS"] = sums
    taught = bool(model.defaults.touch_fit_left_out & (GAIN_DRIFT_KEPT | TRACKS_REFERENCE))
    return _assemble(sections, model.protocol.hash, taught)


def _padded(content: bytes) -> bytes:
    return content + bytes(-len(content) % 16)


def _assemble(sections: Sections, protocol_hash: int, taught: bool) -> bytes:
    offset = HEADER.size + len(sections) * ENTRY.size
    entries, bodies = [], []
    for tag, content in sections.items():
        flags = REQUIRED_FLAG if tag in REQUIRED or tag == "SCAL" else 0
        entries.append(ENTRY.pack(tag.encode(), offset, len(content), flags))
        bodies.append(_padded(content))
        offset += len(bodies[-1])
    body = b"".join(entries + bodies)
    newest = ("SURF", "ROWE", "MOVE", "GEOM", "PLAC", "SUMS", "ORDR", "PREC", "UNCE")
    have = [name in sections or (taught and name == "PREC") for name in newest]
    minor = MINOR - [*have, True].index(True)
    tail = HEADER.pack(MAGIC, MAJOR, minor, offset, 0, len(sections), 0, protocol_hash)[16:]
    crc = zlib.crc32(tail + body)
    return HEADER.pack(MAGIC, MAJOR, minor, offset, crc, len(sections), 0, protocol_hash) + body


def decode_model(blob: bytes, where: str) -> Model:
    """Return the model in ``blob``; ``where`` names it in errors.

    Raises:
        ModelError: it is truncated, corrupted, newer, or not a model.
    """
    sections = _split(blob, where)
    try:
        return decode_sections(sections, _header(blob, where)[7], where)
    except ModelError:
        raise
    except EitskinError as error:
        raise ModelError(f"{where}: {error}; build the model again") from None


def _header(blob: bytes, where: str) -> tuple[Any, ...]:
    if blob[:4] != MAGIC:
        raise ModelError(f"{where}: this is not an .eitm model; make one with  eitskin model build")
    if len(blob) < HEADER.size:
        raise ModelError(
            f"{where}: the model is truncated ({len(blob)} bytes); copy or build it again"
        )
    header: tuple[Any, ...] = HEADER.unpack_from(blob)
    return header


def _split(blob: bytes, where: str) -> Sections:
    _, major, minor, total, crc, count, _, _ = _header(blob, where)
    if major != MAJOR:
        raise ModelError(
            f"{where}: the model's format is {major}.{minor}, this eitskin reads {MAJOR}.x; "
            "upgrade eitskin or build the model again"
        )
    if total < HEADER.size or total % 16:
        raise ModelError(
            f"{where}: the header states an impossible size of {total} bytes; build the model again"
        )
    if len(blob) < total:
        raise ModelError(
            f"{where}: the model is truncated ({len(blob)} of {total} bytes); copy or build it"
            " again"
        )
    if zlib.crc32(blob[16:total]) != crc:
        raise ModelError(
            f"{where}: the model is corrupted (its checksum does not fit); copy or build it again"
        )
    table_end = HEADER.size + count * ENTRY.size
    if count > MAX_SECTIONS or table_end > total:
        raise ModelError(f"{where}: the section table is too long; build the model again")
    sections: Sections = {}
    for place in range(count):
        tag, offset, size, flags = ENTRY.unpack_from(blob, HEADER.size + place * ENTRY.size)
        name = tag.decode("ascii", "replace")
        if offset < table_end or offset + size > total or offset % 16 or name in sections:
            raise ModelError(
                f"{where}: section {name!r} is misplaced or repeated; build the model again"
            )
        if name not in (*REQUIRED, *OPTIONAL):
            if flags & REQUIRED_FLAG:
                raise ModelError(
                    f"{where}: needs section {name!r}, which this eitskin does not know; upgrade"
                    " eitskin"
                )
            continue
        sections[name] = blob[offset : offset + size]
    absent = [name for name in REQUIRED if name not in sections]
    if absent:
        raise ModelError(f"{where}: section {absent[0]!r} is missing; build the model again")
    return sections


def load_model(path: str | Path) -> tuple[Model, bytes]:
    """Read the file ``path``; return the decoded model, and the file's bytes for the C core.

    Raises:
        FileError: the file cannot be read.
        ModelError: it is truncated, corrupted, newer, or not a model.
    """
    blob = read_bytes(path, "model")
    return decode_model(blob, str(path)), blob


def encode_tested(model: Model) -> bytes:
    """Return the bytes of the file, with checksums of the results that the float32 core calculates
    for the golden frames."""
    return encode_model(model, CoreEngine(encode_model(model), "float32").self_test_sums())


def save_model(path: str | Path, model: Model) -> int:
    """Write ``model`` to ``path`` completely or not at all; return the number of bytes.

    Raises:
        FileError: the file cannot be written.
        ModelError, FrameError: as :func:`encode_tested`.
    """
    content = encode_tested(model)
    write_bytes(path, content)
    return len(content)
