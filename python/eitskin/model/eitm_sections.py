"""Encode and decode the sections of an .eitm file (docs/reference/eitm-format.md); every length,
index and number is checked."""

import json
import struct
from dataclasses import astuple, dataclass, fields
from math import isfinite
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from eitskin.core.options_table import ALL_TOUCH_FIT, CHOICES
from eitskin.errors import ModelError
from eitskin.fem.grid import Grid
from eitskin.fileio import parse_json
from eitskin.model.force_law import decode_force_law, encode_force_law
from eitskin.model.model import (
    DATA_KINDS,
    GAIN_DRIFT_KEPT,
    TRACKS_REFERENCE,
    Defaults,
    Fields,
    Golden,
    Model,
)
from eitskin.model.model_errors import (
    ModelErrors,
    check_geom,
    decode_model_errors,
    decode_places,
    decode_row_errors,
)
from eitskin.model.row_form import decode_row_form
from eitskin.model.storage import DTYPES, STORAGES, StoredMatrix, stride_for
from eitskin.skin.electrodes import MAX_COUNT, MIN_COUNT
from eitskin.skin.protocol import Protocol, Reciprocity
from eitskin.surface.section import decode_surface, encode_surface

REQUIRED = ("DIMS", "PROT", "FOLD", "VREF", "REDU", "SENS", "COLW", "GRID", "DEFS", "GOLD")
DIMS = struct.Struct("<10I6f")
DEFAULTS = struct.Struct("<2I12f2I")
FIELDS_HEAD = struct.Struct("<2f8x")
MIRROR_ROWS = 4
FOLD_DTYPE = np.dtype([("first", "<u2"), ("second", "<u2"), ("sign", "<i2"), ("reserved", "<u2")])
FOLD_NONE = 0xFFFF
REMOVED_SOLVER = 2
NEEDS = {"UNCE": "WHIT", "GEOM": "UNCE", "MOVE": "GEOM", "ROWE": "UNCE"}  # sections of others
"""Coordinate descent, in models of earlier versions: the number stays reserved."""
SCALED = ("i16", "i8")
MAX_ROWS, MAX_RANK, MAX_PIXELS, MAX_SIDE = 65534, 1024, 65535, 4096
MAX_ITERATIONS = 100_000
MIN_RADIUS_MM, HUGE = float(np.float32(1e-6)), float(np.float32(1e30))
NEARER = "choose units nearer to volts and siemens per metre"
MIN_LIPSCHITZ, MAX_FLOAT32 = 2.0**-126, float(np.finfo(np.float32).max)

Sections = dict[str, bytes]


def encode_sections(model: Model) -> Sections:
    """Return the contents of each section of ``model`` by tag, without SUMS.

    Raises:
        ModelError: a number does not fit float32.
    """
    _check_floats(model)
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
        "DEFS": _encode_defaults(model.defaults),
        "GOLD": (
            np.concatenate([golden.reference_v, golden.frame_v, golden.image])
            .astype("<f4")
            .tobytes()
        ),
        "META": json.dumps(model.meta, sort_keys=True).encode("utf-8"),
    }
    if model.force_law is not None:
        sections["LOAD"] = encode_force_law(model.force_law)
    if model.row_form is not None:
        sections["WHIT"] = model.row_form.encode()
    if model.precision is not None:
        sections["PREC"] = model.precision.astype("<f4").tobytes()
    if model.place_factor > 0:
        sections["PLAC"] = np.float32(model.place_factor).astype("<f4").tobytes()
    if model.protocol.drive_order:
        order = np.concatenate([model.protocol.scan_rows, model.protocol.scan_places])
        sections["ORDR"] = order.astype("<u2").tobytes()
    if model.model_errors is not None:
        sections["UNCE"] = model.model_errors.encode()
        if model.model_errors.places is not None:
            sections |= model.model_errors.places.encode()
            if model.model_errors.rows is not None:
                sections["ROWE"] = model.model_errors.rows.encode()
    if model.surface is not None:
        sections["SURF"] = encode_surface(model.surface)
    if stored.scale is not None:
        sections["SCAL"] = stored.scale.astype("<f4").tobytes()
    if model.fields is not None:
        halves = np.zeros(
            (len(model.fields.columns), _fields_stride(model.protocol.n_electrodes)), dtype="<f2"
        )
        halves[:, : model.fields.columns.shape[1]] = model.fields.columns
        sections["FLDS"] = (
            FIELDS_HEAD.pack(model.fields.volts, model.fields.per_sheet) + halves.tobytes()
        )
    return sections


def _encode_defaults(defaults: Defaults) -> bytes:
    return DEFAULTS.pack(
        *astuple(defaults)[:-2], CHOICES["solver"][defaults.solver], defaults.touch_fit_left_out
    )


def _fields_stride(n_electrodes: int) -> int:
    return -(-(2 * n_electrodes + MIRROR_ROWS) // 8) * 8


def _check_floats(model: Model) -> None:
    """Reject numbers that float32 cannot hold or that no reader would accept."""
    numbers = {
        "the Lipschitz constant": model.lipschitz, "the noise gain": model.noise_gain,
        "the current": model.protocol.current_a,
    }  # fmt: skip
    for name, value in numbers.items():
        if not abs(value) <= MAX_FLOAT32:
            raise ModelError(f"model: {name} of {value:g} does not fit float32; {NEARER}")
    if model.lipschitz < MIN_LIPSCHITZ:
        raise ModelError(
            f"model: the Lipschitz constant of {model.lipschitz:g} is too small for float32;"
            f" {NEARER}"
        )


def _encode_dims(model: Model, stride: int) -> bytes:
    grid, protocol = model.grid, model.protocol
    return DIMS.pack(
        protocol.n_electrodes, protocol.n_rows, len(model.fold.first), model.rank, stride,
        grid.n_pixels, grid.nx, grid.ny,
        STORAGES.index(model.stored.storage), DATA_KINDS.index(model.data_kind),
        grid.pixel_mm, *grid.origin_mm, protocol.current_a, model.lipschitz, model.noise_gain,
    )  # fmt: skip


@dataclass(frozen=True)
class _Dims:
    """The fields of section DIMS."""

    n_electrodes: int
    n_rows: int
    n_folded: int
    rank: int
    stride: int
    n_pixels: int
    nx: int
    ny: int
    storage: int
    kind: int
    pixel_mm: float
    origin_x_mm: float
    origin_y_mm: float
    current_a: float
    lipschitz: float
    noise_gain: float


def _refuse(where: str, what: str) -> NoReturn:
    raise ModelError(f"{where}: holds {what}; build the model again")


def _read_dims(content: bytes, where: str) -> _Dims:
    if len(content) != DIMS.size:
        _refuse(where, f"section 'DIMS' of {len(content)} bytes instead of {DIMS.size}")
    d = _Dims(*DIMS.unpack(content))
    in_range = (
        MIN_COUNT <= d.n_electrodes <= MAX_COUNT
        and 1 <= d.n_rows <= MAX_ROWS
        and 1 <= d.n_folded <= d.n_rows
        and 1 <= d.rank <= MAX_RANK
        and d.stride == stride_for(d.rank)
        and 1 <= d.n_pixels <= MAX_PIXELS
        and 1 <= d.nx <= MAX_SIDE
        and 1 <= d.ny <= MAX_SIDE
        and d.storage < len(STORAGES)
        and d.kind < len(DATA_KINDS)
    )
    if not in_range:
        _refuse(where, "a dimension out of range")
    numbers = (d.pixel_mm, d.origin_x_mm, d.origin_y_mm, d.current_a, d.lipschitz, d.noise_gain)
    if not all(map(isfinite, numbers)) or min(d.pixel_mm, d.current_a) <= 0 or d.noise_gain < 0:
        _refuse(where, "a number in section 'DIMS' that is out of range")
    if d.lipschitz < MIN_LIPSCHITZ:
        _refuse(where, "a matrix whose squares are too small for float32; scale it up")
    return d


def _check_sizes(sections: Sections, d: _Dims, where: str) -> None:
    item = DTYPES[STORAGES[d.storage]].itemsize
    sizes = {
        "PROT": 4 * d.n_rows,
        "FOLD": FOLD_DTYPE.itemsize * d.n_folded,
        "VREF": 4 * d.n_folded,
        "REDU": 4 * d.n_folded * d.stride,
        "SENS": item * d.n_pixels * d.stride,
        "SCAL": 4 * d.n_pixels if STORAGES[d.storage] in SCALED else None,
        "COLW": 4 * d.n_pixels,
        "GRID": 4 * d.n_pixels,
        "DEFS": DEFAULTS.size,
        "GOLD": 4 * (2 * d.n_rows + d.n_pixels),
    }
    for name, size in sizes.items():
        given = len(sections[name]) if name in sections else None
        if given != size:
            _refuse(
                where,
                f"section {name!r} of {given or 'no'} bytes where its dimensions need"
                f" {size or 'none'}",
            )


def _floats(
    sections: Sections, name: str, shape: tuple[int, ...], where: str
) -> npt.NDArray[np.float32]:
    values = np.frombuffer(sections[name], dtype="<f4").reshape(shape)
    if not np.isfinite(values).all():
        _refuse(where, f"a number in section {name!r} that is not finite")
    return values


def _read_fold(content: bytes, n_rows: int, where: str) -> Reciprocity:
    fold = np.frombuffer(content, dtype=FOLD_DTYPE)
    first, second, sign = (fold[name].astype(np.int64) for name in ("first", "second", "sign"))
    second = np.where(second == FOLD_NONE, -1, second)
    if (first >= n_rows).any() or (second >= n_rows).any() or (np.abs(sign) != 1).any():
        _refuse(where, "a fold of rows that do not exist, or a sign that is not 1 or -1")
    return Reciprocity(first, second, sign)


def _read_grid(content: bytes, d: _Dims, where: str) -> Grid:
    index = np.frombuffer(content, dtype="<u2").reshape(d.n_pixels, 2).astype(np.int64)
    if (index >= [d.nx, d.ny]).any():
        _refuse(where, "a pixel outside the image")
    if (np.diff(index[:, 1] * d.nx + index[:, 0]) <= 0).any():
        _refuse(where, "pixels that are not ordered by row, then column")
    return Grid(d.nx, d.ny, d.pixel_mm, (d.origin_x_mm, d.origin_y_mm), index)


def _solver_of(number: int, where: str) -> str:
    """Return the name of a solver by its number; files of format 1.0 have 0 here, which is
    FISTA."""
    if number == REMOVED_SOLVER:
        _refuse(where, "the solver coordinate descent, which eitskin no longer has")
    names = {value: name for name, value in CHOICES["solver"].items()}
    if number not in names:
        _refuse(where, f"solver {number}, which this eitskin does not know")
    return names[number]


def _read_defaults(content: bytes, where: str) -> Defaults:
    names = [entry.name for entry in fields(Defaults)]
    values: dict[str, Any] = dict(zip(names, map(_short, DEFAULTS.unpack(content)), strict=False))
    d = Defaults(**{**values, "solver": _solver_of(values["solver"], where)})
    shares = (d.lambda_rel, d.mask_threshold, d.touch_threshold, d.touch_min_fraction)
    sizes = (
        d.lambda_noise_factor,
        d.detection_factor,
        d.touch_change_s_per_m,
        d.follow_mm,
        d.touch_radius_weight,
    )
    in_range = (
        1 <= d.iterations <= MAX_ITERATIONS
        and d.touch_fit_left_out <= ALL_TOUCH_FIT | GAIN_DRIFT_KEPT | TRACKS_REFERENCE
        and all(0 <= share <= 1 for share in shares)
        and all(0 <= size <= HUGE for size in sizes)
        and MIN_RADIUS_MM
        <= d.touch_min_radius_mm
        <= d.touch_seed_radius_mm
        <= d.touch_max_radius_mm
        <= HUGE
    )
    if not in_range:
        _refuse(where, "a default out of range")
    return d


def _read_fields(content: bytes, d: _Dims, where: str) -> Fields:
    stride = _fields_stride(d.n_electrodes)
    if len(content) != FIELDS_HEAD.size + 2 * stride * d.n_pixels:
        _refuse(where, f"section 'FLDS' of {len(content)} bytes, which does not fit its dimensions")
    volts, per_sheet = FIELDS_HEAD.unpack_from(content)
    columns = np.frombuffer(content, dtype="<f2", offset=FIELDS_HEAD.size).reshape(
        d.n_pixels, stride
    )
    if not (0 <= volts <= HUGE and 0 <= per_sheet <= HUGE and np.isfinite(columns).all()):
        _refuse(where, "a number in section 'FLDS' that is out of range")
    return Fields(columns[:, : 2 * d.n_electrodes + MIRROR_ROWS], volts, per_sheet)


def _read_precision(sections: Sections, d: _Dims, where: str) -> npt.NDArray[np.float32] | None:
    if "PREC" not in sections:
        return None
    count = d.n_folded * (d.n_folded + 1) // 2
    if len(sections["PREC"]) != 4 * count:
        _refuse(where, "section 'PREC' of a size that does not fit its rows")
    values = _floats(sections, "PREC", (count,), where)
    diagonal = np.cumsum(np.arange(1, d.n_folded + 1)) - 1
    if "WHIT" in sections or not (values[diagonal] >= 0).all() or np.abs(values).max() > HUGE:
        _refuse(where, "a number in section 'PREC' that is out of range")
    return values


def _read_place_factor(sections: Sections, where: str) -> float:
    if "PLAC" not in sections:
        return 0.0
    if len(sections["PLAC"]) != 4:
        _refuse(where, "section 'PLAC' that is not one number")
    factor = float(_floats(sections, "PLAC", (1,), where)[0])
    if not 0 <= factor <= HUGE:
        _refuse(where, "a number in section 'PLAC' that is out of range")
    return factor


def _read_order(sections: Sections, table: npt.NDArray[np.uint8], where: str) -> tuple[int, ...]:
    """Return the order of the drives, or () if they are measured as listed."""
    if "ORDR" not in sections:
        return ()
    if len(sections["ORDR"]) != 4 * len(table):
        _refuse(where, "section 'ORDR' of a size that does not fit its rows")
    rows, places = np.frombuffer(sections["ORDR"], dtype="<u2").reshape(2, -1).astype(np.int64)
    starts = np.flatnonzero(np.r_[True, (table[1:, :2] != table[:-1, :2]).any(axis=1)])
    drives = np.searchsorted(starts, rows[np.isin(rows, starts)])
    runs = np.split(np.arange(len(table)), starts[1:])
    whole = np.array_equal(np.sort(drives), np.arange(len(starts))) and np.array_equal(
        rows, np.concatenate([runs[k] for k in drives])
    )
    if not whole or not np.array_equal(places, np.argsort(rows)):
        _refuse(where, "an order in section 'ORDR' that does not have each drive once, whole")
    return tuple(drives.tolist())


def _read_meta(content: bytes, where: str) -> dict[str, Any]:
    try:
        meta = parse_json(content.decode("utf-8"))
    except ValueError:
        _refuse(where, "section 'META' that is not JSON")
    skin = meta.get("skin", {}) if isinstance(meta, dict) else None
    if not isinstance(skin, dict) or not isinstance(skin.get("skin", {}), dict):
        _refuse(where, "section 'META' that does not describe a model")
    return dict(meta)


def decode_sections(sections: Sections, protocol_hash: int, where: str) -> Model:
    """Return the model that these sections hold; ``where`` names it in errors."""
    d = _read_dims(sections["DIMS"], where)
    _check_sizes(sections, d, where)
    table = np.frombuffer(sections["PROT"], dtype="u1").reshape(d.n_rows, 4)
    protocol = Protocol(
        d.n_electrodes, table, _short(d.current_a), _read_order(sections, table, where)
    )
    if protocol.hash != protocol_hash:
        _refuse(where, "a protocol table that does not fit its hash")
    if len(sections.get("SUMS", b"    ")) not in range(4, 2**32, 4):
        _refuse(where, "section 'SUMS' has the wrong size for checksums")
    name = STORAGES[d.storage]
    columns = np.frombuffer(sections["SENS"], dtype=DTYPES[name]).reshape(d.n_pixels, d.stride)
    if not np.isfinite(columns).all():
        _refuse(where, "a number in section 'SENS' that is not finite")
    projection = _floats(sections, "REDU", (d.n_folded, d.stride), where)[:, : d.rank].T
    golden = _floats(sections, "GOLD", (2 * d.n_rows + d.n_pixels,), where)
    return Model(
        protocol=protocol,
        fold=_read_fold(sections["FOLD"], d.n_rows, where),
        grid=_read_grid(sections["GRID"], d, where),
        data_kind=DATA_KINDS[d.kind],
        rank=d.rank,
        v_ref_v=_floats(sections, "VREF", (d.n_folded,), where),
        projection=projection,
        stored=StoredMatrix(
            name,
            columns,
            _floats(sections, "SCAL", (d.n_pixels,), where) if name in SCALED else None,
        ),
        column_weight=_floats(sections, "COLW", (d.n_pixels,), where),
        lipschitz=d.lipschitz,
        noise_gain=d.noise_gain,
        defaults=_read_defaults(sections["DEFS"], where),
        golden=Golden(golden[: d.n_rows], golden[d.n_rows : 2 * d.n_rows], golden[2 * d.n_rows :]),
        meta=_read_meta(sections["META"], where) if "META" in sections else {},
        fields=_read_fields(sections["FLDS"], d, where) if "FLDS" in sections else None,
        force_law=decode_force_law(sections["LOAD"], where) if "LOAD" in sections else None,
        row_form=(
            decode_row_form(sections["WHIT"], projection, where) if "WHIT" in sections else None
        ),
        precision=_read_precision(sections, d, where),
        place_factor=_read_place_factor(sections, where),
        model_errors=_read_model_errors(sections, d, where),
        surface=decode_surface(sections["SURF"], where) if "SURF" in sections else None,
    )


def _read_model_errors(sections: Sections, d: _Dims, where: str) -> ModelErrors | None:
    """Read the model errors. GEOM without MOVE (format 1.9) is ignored: no reader uses it any
    more; but its numbers must be in range."""
    for name, needed in NEEDS.items():
        if name in sections and needed not in sections:
            _refuse(where, f"section {name!r} without section {needed!r}")
    if "UNCE" not in sections:
        return None
    if "GEOM" in sections:
        check_geom(sections["GEOM"], d.n_folded, where)
    both = "GEOM" in sections and "MOVE" in sections
    places = decode_places(sections["GEOM"], sections["MOVE"], d.n_folded, where) if both else None
    rows = (
        decode_row_errors(sections["ROWE"], d.n_folded, places, where)
        if "ROWE" in sections
        else None
    )
    return decode_model_errors(sections["UNCE"], d.rank, where, places, rows)


def _short(value: float) -> float:
    """Return a float32 as the shortest decimal that converts back to it, so that 0.03 is read as
    0.03. Integers stay as they are."""
    return value if isinstance(value, int) else float(str(np.float32(value)))
