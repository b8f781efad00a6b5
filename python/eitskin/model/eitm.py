"""The .eitm file, byte by byte as docs/eitm-format.md specifies; this reader is independent of the C one."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from eitskin.errors import EitskinError, ModelError
from eitskin.fem.grid import Grid
from eitskin.fileio import read_bytes, write_bytes
from eitskin.model.model import DATA_KINDS, Defaults, Golden, Model
from eitskin.model.storage import DTYPES, STORAGES, StoredMatrix, stride_for
from eitskin.skin.protocol import Protocol, Reciprocity

MAGIC = b"EITM"
MAJOR, MINOR = 1, 0
HEADER = struct.Struct("<4sHHIIIIQ32x")
ENTRY = struct.Struct("<4sIII")
DIMS = struct.Struct("<10I6f")
DEFAULTS = struct.Struct("<2I12f2f")
REQUIRED = ("DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS", "COLW", "GRID", "DEFS", "GOLD")
FOLD_DTYPE = np.dtype([("first", "<u2"), ("second", "<u2"), ("sign", "<i2"), ("reserved", "<u2")])
FOLD_NONE = 0xFFFF
REQUIRED_FLAG = 1

Sections = dict[str, bytes]


def encode_model(model: Model) -> bytes:
    """The file's bytes."""
    stored, stride = model.stored, stride_for(model.rank)
    projection = np.zeros((model.projection.shape[1], stride), dtype="<f4")
    projection[:, : model.rank] = model.projection.T
    fold = np.zeros(len(model.fold.first), dtype=FOLD_DTYPE)
    fold["first"] = model.fold.first
    fold["second"] = np.where(model.fold.second < 0, FOLD_NONE, model.fold.second)
    fold["sign"] = model.fold.sign
    golden = model.golden
    sections: Sections = {
        "DIMS": _encode_dims(model, stride),
        "PROT": model.protocol.drive_measure.tobytes(),
        "FOLD": fold.tobytes(),
        "VREF": model.v_ref_v.astype("<f4").tobytes(),
        "REDU": projection.tobytes(),
        "SENS": stored.columns.tobytes(),
        "COLW": model.column_weight.astype("<f4").tobytes(),
        "GRID": model.grid.index.astype("<u2").tobytes(),
        "DEFS": DEFAULTS.pack(*astuple(model.defaults), *[0.0] * 2),
        "GOLD": np.concatenate([golden.reference_v, golden.frame_v, golden.image]).astype("<f4").tobytes(),
        "META": json.dumps(model.meta, sort_keys=True).encode("utf-8"),
    }
    if stored.scale is not None:
        sections["SCAL"] = stored.scale.astype("<f4").tobytes()
    return _assemble(sections, model.protocol.hash)


def _encode_dims(model: Model, stride: int) -> bytes:
    grid, protocol = model.grid, model.protocol
    return DIMS.pack(
        protocol.n_electrodes, protocol.n_rows, len(model.fold.first), model.rank, stride, grid.n_pixels, grid.nx, grid.ny,
        STORAGES.index(model.stored.storage), DATA_KINDS.index(model.data_kind),
        grid.pixel_mm, *grid.origin_mm, protocol.current_a, model.lipschitz, model.noise_gain,
    )  # fmt: skip


def _padded(content: bytes) -> bytes:
    return content + bytes(-len(content) % 16)


def _assemble(sections: Sections, protocol_hash: int) -> bytes:
    offset = HEADER.size + len(sections) * ENTRY.size
    entries, bodies = [], []
    for tag, content in sections.items():
        flags = REQUIRED_FLAG if tag in REQUIRED or tag == "SCAL" else 0
        entries.append(ENTRY.pack(tag.encode(), offset, len(content), flags))
        bodies.append(_padded(content))
        offset += len(bodies[-1])
    body = b"".join(entries + bodies)
    tail = HEADER.pack(MAGIC, MAJOR, MINOR, offset, 0, len(sections), 0, protocol_hash)[16:]
    crc = zlib.crc32(tail + body)
    return HEADER.pack(MAGIC, MAJOR, MINOR, offset, crc, len(sections), 0, protocol_hash) + body


def decode_model(blob: bytes, where: str) -> Model:
    """The model in ``blob``; ``where`` names it in errors.

    Raises:
        ModelError: it is truncated, corrupted, newer or foreign.
    """
    sections = _split(blob, where)
    try:
        return _decode_sections(sections, _header(blob, where)[7], where)
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise ModelError(f"{where}: a section does not fit the dimensions ({error}); build the model again") from None
    except ModelError:
        raise
    except EitskinError as error:
        raise ModelError(f"{where}: {error}; build the model again") from None


def _header(blob: bytes, where: str) -> tuple[Any, ...]:
    if blob[:4] != MAGIC:
        raise ModelError(f"{where}: this is not an .eitm model; make one with  eitskin model build")
    if len(blob) < HEADER.size:
        raise ModelError(f"{where}: the model is truncated ({len(blob)} bytes); copy or build it again")
    header: tuple[Any, ...] = HEADER.unpack_from(blob)
    return header


def _split(blob: bytes, where: str) -> Sections:
    _, major, minor, total, crc, count, _, _ = _header(blob, where)
    if major != MAJOR:
        raise ModelError(
            f"{where}: the model's format is {major}.{minor}, this eitskin reads {MAJOR}.x; upgrade eitskin or build the model again"
        )
    if len(blob) < total or total < HEADER.size:
        raise ModelError(f"{where}: the model is truncated ({len(blob)} of {total} bytes); copy or build it again")
    if zlib.crc32(blob[16:total]) != crc:
        raise ModelError(f"{where}: the model is corrupted (its checksum does not fit); copy or build it again")
    table_end = HEADER.size + count * ENTRY.size
    if table_end > total:
        raise ModelError(f"{where}: the section table runs past the end; build the model again")
    sections: Sections = {}
    for place in range(count):
        tag, offset, size, flags = ENTRY.unpack_from(blob, HEADER.size + place * ENTRY.size)
        name = tag.decode("ascii", "replace")
        if offset < table_end or offset + size > total or offset % 16 or name in sections:
            raise ModelError(f"{where}: section {name!r} is misplaced or repeated; build the model again")
        if name not in (*REQUIRED, "SCAL", "META"):
            if flags & REQUIRED_FLAG:
                raise ModelError(f"{where}: needs section {name!r}, which this eitskin does not know; upgrade eitskin")
            continue
        sections[name] = blob[offset : offset + size]
    absent = [name for name in REQUIRED if name not in sections]
    if absent:
        raise ModelError(f"{where}: section {absent[0]!r} is missing; build the model again")
    return sections


def _floats(content: bytes, shape: tuple[int, ...], where: str) -> npt.NDArray[np.float32]:
    values = np.frombuffer(content, dtype="<f4").reshape(shape)
    if not np.isfinite(values).all():
        _bad_value(where, "a number that is not finite")
    return values


def _bad_value(where: str, what: str) -> NoReturn:
    raise ModelError(f"{where}: holds {what}; build the model again")


def _decode_sections(sections: Sections, protocol_hash: int, where: str) -> Model:
    (n_electrodes, n_rows, n_folded, rank, stride, n_pixels, nx, ny, storage, kind,
     pixel_mm, origin_x, origin_y, current_a, lipschitz, noise_gain) = DIMS.unpack(sections["DIMS"])  # fmt: skip
    if storage >= len(STORAGES) or kind >= len(DATA_KINDS) or stride != stride_for(rank) or rank == 0:
        _bad_value(where, "a dimension out of range")
    if not (np.isfinite([pixel_mm, origin_x, origin_y, lipschitz, noise_gain]).all() and lipschitz > 0 and pixel_mm > 0):
        _bad_value(where, "a number that is not finite or not positive")
    protocol = Protocol(n_electrodes, np.frombuffer(sections["PROT"], dtype="u1").reshape(n_rows, 4), _short(current_a))
    if protocol.hash != protocol_hash:
        _bad_value(where, "a protocol table that does not fit its hash")
    fold = np.frombuffer(sections["FOLD"], dtype=FOLD_DTYPE)
    if len(fold) != n_folded:
        _bad_value(where, "a fold of the wrong length")
    name = STORAGES[storage]
    columns = np.frombuffer(sections["SENS"], dtype=DTYPES[name]).reshape(n_pixels, stride)
    scale = _floats(sections["SCAL"], (n_pixels,), where) if name in ("i16", "i8") else None
    if not np.isfinite(columns).all():
        _bad_value(where, "a number that is not finite")
    index = np.frombuffer(sections["GRID"], dtype="<u2").reshape(n_pixels, 2).astype(np.int64)
    if (index >= [nx, ny]).any():
        _bad_value(where, "a pixel outside the grid")
    golden = _floats(sections["GOLD"], (2 * n_rows + n_pixels,), where)
    names = [entry.name for entry in fields(Defaults)]
    return Model(
        protocol=protocol,
        fold=Reciprocity(
            first=fold["first"].astype(np.int64),
            second=np.where(fold["second"] == FOLD_NONE, -1, fold["second"].astype(np.int64)),
            sign=fold["sign"].astype(np.int64),
        ),
        grid=Grid(nx, ny, float(pixel_mm), (float(origin_x), float(origin_y)), index),
        data_kind=DATA_KINDS[kind],
        rank=rank,
        v_ref_v=_floats(sections["VREF"], (n_folded,), where),
        projection=_floats(sections["REDU"], (n_folded, stride), where)[:, :rank].T,
        stored=StoredMatrix(name, columns, scale),
        column_weight=_floats(sections["COLW"], (n_pixels,), where),
        lipschitz=float(lipschitz),
        noise_gain=float(noise_gain),
        defaults=Defaults(**dict(zip(names, map(_short, DEFAULTS.unpack(sections["DEFS"])), strict=False))),
        golden=Golden(golden[:n_rows], golden[n_rows : 2 * n_rows], golden[2 * n_rows :]),
        meta=json.loads(sections["META"]) if "META" in sections else {},
    )


def _short(value: float) -> float:
    """A float32 as the shortest decimal that gives it again, so that 0.03 is read as 0.03; whole numbers stay."""
    return value if isinstance(value, int) else float(str(np.float32(value)))


def load_model(path: str | Path) -> tuple[Model, bytes]:
    """The model in the file ``path``, decoded, and its bytes for the C core.

    Raises:
        FileError: it cannot be read.
        ModelError: it is truncated, corrupted, newer or foreign.
    """
    blob = read_bytes(path, "model")
    return decode_model(blob, str(path)), blob


def save_model(path: str | Path, model: Model) -> int:
    """Write ``model`` to ``path`` whole or not at all; returns the number of bytes.

    Raises:
        FileError: it cannot be written.
    """
    content = encode_model(model)
    write_bytes(path, content)
    return len(content)
