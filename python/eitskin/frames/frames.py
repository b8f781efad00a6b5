"""Frames: boundary voltages with their reference, protocol and, if known, truth, and the file that
holds them.

The file is an .npz; docs/reference/frames-format.md lists its fields. It is read without pickle and
checked completely.
"""

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.errors import EitskinError, FrameError
from eitskin.fileio import parse_json, write_beside
from eitskin.frames.arrays import read_npz
from eitskin.frames.paths import NAMES as PATH_FIELDS
from eitskin.frames.paths import Paths
from eitskin.skin.protocol import Protocol, in_order, table

FORMAT = "eitskin-frames"
VERSION = 1
FOREIGN = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log", ".npy", ".mat")  # import reads these
TOUCH_FIELDS = ("touch_frame", "touch_xy_mm", "touch_radius_mm", "touch_strength", "touch_sign")
HEAD = ("format", "version", "truth_mask_extent_mm")
REQUIRED = (
    "voltage_v",
    "reference_voltage_v",
    "drive_measure",
    "n_electrodes",
    "current_a",
    "frame_name",
    "meta",
)
OPTIONAL = ("time_s", "row_time_s", *TOUCH_FIELDS, "truth_mask", "truth_conductivity_s_per_m")
OTHER = ("drive_order", *PATH_FIELDS)  # optional; Frames has no fields with these names


@dataclass(frozen=True, eq=False)
class Frames:
    """Measured or simulated frames, in the row order of ``protocol``.

    Shapes: n frames, m rows, k untouched frames, t touches, masks with h rows (row 0 at the lowest
    y) and w columns.

    ``voltage_v`` is (n, m) and ``reference_voltage_v`` is (k, m), in V; (m,) becomes (1, m).
    ``frame_name`` holds n names, by default "0", "1", and so on. ``time_s`` (n,) counts seconds
    from any start; ``row_time_s`` (m,), if known, is when each row was measured after that time.

    The truth, if known, is that at the end of a frame's scan (for a snapshot, at its time).
    ``touch_frame`` (t,) is the index of each touch's frame, ``touch_xy_mm`` (t, 2) its place in the
    skin's coordinates, ``touch_radius_mm`` (t,) its radius, ``touch_strength`` (t,) the relative
    conductivity change inside it (NaN: unknown), and ``touch_sign`` (t,) is +1 if it is more
    conductive, -1 if less (by default from the strength). ``truth_mask`` (n, h, w) is +1, -1 or 0
    over ``truth_mask_extent_mm`` (xmin, ymin, xmax, ymax). ``truth_conductivity_s_per_m`` (n, h, w)
    float32 uses the same raster, NaN outside the skin. ``paths`` give the touches at any instant.
    ``meta`` describes how the frames were made (JSON values only).

    Raises:
        FrameError: a shape is wrong, or a value is not finite (unless ``allow_nonfinite`` is set,
            for examination only).
    """

    protocol: Protocol
    voltage_v: FloatArray
    reference_voltage_v: FloatArray
    frame_name: tuple[str, ...] = ()
    time_s: FloatArray | None = None
    row_time_s: FloatArray | None = None
    touch_frame: IntArray | None = None
    touch_xy_mm: FloatArray | None = None
    touch_radius_mm: FloatArray | None = None
    touch_strength: FloatArray | None = None
    touch_sign: NDArray[np.int8] | None = None
    truth_mask: NDArray[np.int8] | None = None
    truth_mask_extent_mm: tuple[float, float, float, float] | None = None
    truth_conductivity_s_per_m: NDArray[np.float32] | None = None
    paths: Paths | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    allow_nonfinite: bool = False

    def __post_init__(self) -> None:
        rows = len(self.protocol.drive_measure)
        reference = np.atleast_2d(_floats(self.reference_voltage_v, "reference_voltage_v"))
        self._set("reference_voltage_v", _shaped(reference, (None, rows), "reference_voltage_v"))
        if not len(reference):
            raise FrameError(
                "reference_voltage_v is empty; frames need at least one untouched frame"
            )
        voltage = _shaped(_floats(self.voltage_v, "voltage_v"), (None, rows), "voltage_v")
        self._set("voltage_v", voltage)
        n = len(voltage)
        if not self.allow_nonfinite:
            for name, values in (("voltage_v", voltage), ("reference_voltage_v", reference)):
                _refuse_nonfinite(values, name)
        names = tuple(str(name) for name in self.frame_name) or tuple(str(k) for k in range(n))
        if len(names) != n:
            raise FrameError(f"frame_name has {len(names)} names for {n} frames")
        self._set("frame_name", names)
        if self.time_s is not None:
            self._set("time_s", _shaped(_floats(self.time_s, "time_s"), (n,), "time_s"))
        if self.row_time_s is not None:
            row_time_s = _shaped(_floats(self.row_time_s, "row_time_s"), (rows,), "row_time_s")
            _refuse_nonfinite(row_time_s[None], "row_time_s")
            self._set("row_time_s", row_time_s)
        self._check_touches(n)
        self._check_mask(n)

    def row_times_s(self, k: int) -> FloatArray | None:
        """Return when each row of frame k was measured (m,), if that is known."""
        if self.time_s is None or self.row_time_s is None:
            return None
        return np.asarray(self.row_time_s + float(self.time_s[k]))

    def _set(self, name: str, value: Any) -> None:
        if isinstance(value, np.ndarray):
            value = value.view()
            value.flags.writeable = False
        object.__setattr__(self, name, value)

    def _check_touches(self, n: int) -> None:
        if self.touch_frame is None:
            given = [name for name in TOUCH_FIELDS if getattr(self, name) is not None]
            if given:
                raise FrameError(
                    f"{given[0]} without touch_frame; touches need frame, position and radius"
                )
            return
        if self.touch_xy_mm is None or self.touch_radius_mm is None:
            raise FrameError(
                "touch_frame without touch_xy_mm and touch_radius_mm; touches need all three"
            )
        frame = np.asarray(self.touch_frame)
        if frame.ndim != 1 or (frame.size and not np.issubdtype(frame.dtype, np.integer)):
            raise FrameError(
                f"touch_frame must be whole numbers of shape (t,), not {frame.dtype} {frame.shape}"
            )
        if frame.size and (frame.min() < 0 or frame.max() >= n):
            raise FrameError(
                f"touch_frame holds {int(frame.min())} to {int(frame.max())}; there are 0 to"
                f" {n - 1}"
            )
        t = len(frame)
        self._set("touch_frame", frame.astype(np.int64))
        self._set(
            "touch_xy_mm",
            _finite(_shaped(_floats(self.touch_xy_mm, "touch_xy_mm"), (t, 2), "touch_xy_mm")),
        )
        radius = _shaped(_floats(self.touch_radius_mm, "touch_radius_mm"), (t,), "touch_radius_mm")
        self._set("touch_radius_mm", _finite(radius))
        strength = (
            np.full(t, np.nan)
            if self.touch_strength is None
            else _floats(self.touch_strength, "touch_strength")
        )
        self._set("touch_strength", _shaped(strength, (t,), "touch_strength"))
        sign = (
            np.sign(np.nan_to_num(strength))
            if self.touch_sign is None
            else np.asarray(self.touch_sign)
        )
        if sign.shape != (t,) or not np.isin(sign, (-1, 0, 1)).all():
            raise FrameError(f"touch_sign must be {t} values of +1, -1 or 0 (unknown)")
        self._set("touch_sign", sign.astype(np.int8))

    def _check_mask(self, n: int) -> None:
        if self.truth_mask is None:
            if self.truth_conductivity_s_per_m is not None:
                raise FrameError(
                    "truth_conductivity_s_per_m without truth_mask; it lies on the mask's raster"
                )
            return
        mask = np.asarray(self.truth_mask)
        if mask.ndim != 3 or len(mask) != n or not np.isin(mask, (-1, 0, 1)).all():
            raise FrameError(
                f"truth_mask must be ({n}, rows, columns) of +1, -1, 0; it is {mask.dtype}"
                f" {mask.shape}"
            )
        self._set("truth_mask", mask.astype(np.int8))
        extent = (
            ()
            if self.truth_mask_extent_mm is None
            else tuple(float(v) for v in self.truth_mask_extent_mm)
        )
        if len(extent) != 4 or not (extent[0] < extent[2] and extent[1] < extent[3]):
            raise FrameError("truth_mask needs truth_mask_extent_mm: xmin, ymin, xmax, ymax")
        self._set("truth_mask_extent_mm", extent)
        if self.truth_conductivity_s_per_m is not None:
            conductivity = _floats(
                self.truth_conductivity_s_per_m, "truth_conductivity_s_per_m"
            ).astype(np.float32)
            if conductivity.shape != mask.shape:
                raise FrameError(
                    f"truth_conductivity_s_per_m is {conductivity.shape}, truth_mask {mask.shape};"
                    " make them equal"
                )
            self._set("truth_conductivity_s_per_m", conductivity)

    def __repr__(self) -> str:
        untouched = len(self.reference_voltage_v)
        return f"<Frames {self.n_frames} of {self.protocol.n_rows} rows, {untouched} untouched>"

    @property
    def n_frames(self) -> int:
        """The number of frames, without the untouched ones of the reference."""
        return len(self.voltage_v)

    @property
    def reference_v(self) -> FloatArray:
        """The mean of the untouched frames (m,), in V."""
        return np.asarray(self.reference_voltage_v.mean(axis=0))

    def touches_in(self, frame: int) -> IntArray:
        """Return the indices of the touches in ``frame``, for the touch fields; empty if no truth
        is known."""
        if self.touch_frame is None:
            return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(self.touch_frame == frame)


def save_frames(path: str | Path, frames: Frames) -> None:
    """Write ``frames`` to ``path`` (.npz) completely or not at all; equal frames give equal bytes.

    Raises:
        FileError: the folder does not exist or cannot be written.
        FrameError: the frames hold values that are not finite.
    """
    for name in ("voltage_v", "reference_voltage_v"):
        _refuse_nonfinite(getattr(frames, name), name)
    fields: dict[str, Any] = {
        "format": np.array(FORMAT),
        "version": np.array(VERSION, dtype=np.int32),
        "voltage_v": frames.voltage_v,
        "reference_voltage_v": frames.reference_voltage_v,
        "drive_measure": np.asarray(frames.protocol.drive_measure, dtype=np.uint8),
        "n_electrodes": np.array(frames.protocol.n_electrodes, dtype=np.int32),
        "current_a": np.array(frames.protocol.current_a, dtype=np.float64),
        "frame_name": np.array(frames.frame_name, dtype=np.str_),
        "meta": np.array(json.dumps(dict(frames.meta), sort_keys=True, allow_nan=False)),
    }
    if frames.protocol.drive_order:
        fields["drive_order"] = np.array(frames.protocol.drive_order, dtype=np.int64)
    optional = {name: getattr(frames, name) for name in (*OPTIONAL, "truth_mask_extent_mm")}
    if frames.paths is not None:
        optional |= vars(frames.paths)
    fields |= {name: np.asarray(value) for name, value in optional.items() if value is not None}
    with write_beside(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **fields)


def refuse_recording(path: str | Path) -> None:
    """Raise a FrameError if ``path`` names a recording of a board, in place of a file of frames."""
    if Path(path).suffix.lower() == ".eits" and Path(path).exists():
        frames = shlex.quote(str(Path(path).with_suffix(".npz")))
        raise FrameError(
            f"{path}: a recording of a board, not a file of frames; export its raw frames:  eitskin"
            f" replay {shlex.quote(str(path))} --frames {frames}"
        )


def load_frames(path: str | Path, *, allow_nonfinite: bool = False) -> Frames:
    """Read a frames file. ``allow_nonfinite`` accepts NaN and Inf voltages, for ``eitskin doctor``.

    Raises:
        FileError: the file cannot be read.
        FrameError: it is not a frames file, it is a newer one, or a field is missing, unknown or
            wrong.
    """
    where = str(path)
    refuse_recording(path)
    if Path(path).suffix.lower() in FOREIGN and Path(path).exists():
        raise FrameError(
            f"{where}: not a frames file; convert it:  eitskin import {where} -o"
            f" {Path(path).with_suffix('.npz')}  with the options that  eitskin doctor {where} "
            " finds"
        )
    arrays = read_npz(path, "frames file", (*REQUIRED, *OPTIONAL, *OTHER, *HEAD))
    if "format" not in arrays or str(arrays["format"]) != FORMAT:
        raise FrameError(
            f"{where}: not an eitskin frames file (its arrays:"
            f" {', '.join(sorted(arrays)) or 'none'}); convert it with  eitskin import {where} -o"
            " OUT.npz  and the options that say what its arrays are"
        )
    version = arrays.get("version")
    if version is None or version.shape != () or not np.issubdtype(version.dtype, np.integer):
        raise FrameError(
            f"{where}: the field 'version' is missing or not a whole number; make the file again"
        )
    if int(version) != VERSION:
        raise FrameError(
            f"{where}: frames format version {int(version)}; this eitskin reads {VERSION}; make the"
            " file again"
        )
    try:
        return _from_arrays(arrays, allow_nonfinite)
    except EitskinError as error:
        raise type(error)(f"{where}: {error}") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise FrameError(
            f"{where}: a field has the wrong type ({error}); make the file again"
        ) from None


def _from_arrays(arrays: dict[str, AnyArray], allow_nonfinite: bool) -> Frames:
    for name in REQUIRED:
        if name not in arrays:
            raise FrameError(f"the field {name!r} is missing; make the file again")
    unknown = sorted(set(arrays) - {*REQUIRED, *OPTIONAL, *OTHER, *HEAD})
    if unknown:
        raise FrameError(
            f"unknown field {unknown[0]!r}; docs/reference/frames-format.md lists the fields"
        )
    try:
        meta = parse_json(str(arrays["meta"]))
    except ValueError:
        raise FrameError("the field 'meta' is not JSON; make the file again") from None
    if not isinstance(meta, dict):
        raise FrameError("the field 'meta' is not a JSON object; make the file again")
    extent = arrays.get("truth_mask_extent_mm")
    given = [name for name in PATH_FIELDS if name in arrays]
    if given and len(given) < len(PATH_FIELDS):
        raise FrameError(f"{given[0]} without the other path fields; paths need all five")
    protocol = table(
        int(arrays["n_electrodes"]), arrays["drive_measure"].tolist(), float(arrays["current_a"])
    )
    return Frames(
        protocol=in_order(protocol, arrays.get("drive_order", np.zeros(0, np.int64)).tolist()),
        voltage_v=arrays["voltage_v"],
        reference_voltage_v=arrays["reference_voltage_v"],
        frame_name=tuple(str(name) for name in np.atleast_1d(arrays["frame_name"])),
        truth_mask_extent_mm=None if extent is None else tuple(extent.tolist()),
        paths=Paths(*(arrays[name] for name in PATH_FIELDS)) if given else None,
        meta=meta,
        allow_nonfinite=allow_nonfinite,
        **{name: arrays.get(name) for name in OPTIONAL},
    )


def _floats(values: object, name: str) -> FloatArray:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise FrameError(f"{name} must be real numbers, not {array.dtype}")
    return array.astype(np.float64)


def _shaped(values: FloatArray, shape: tuple[int | None, ...], name: str) -> FloatArray:
    if values.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, values.shape, strict=True)
    ):
        wanted = ", ".join("any" if want is None else str(want) for want in shape)
        raise FrameError(
            f"{name} has shape {values.shape}; the protocol and the frames need ({wanted})"
        )
    return values


def _finite(values: FloatArray) -> FloatArray:
    if not np.isfinite(values).all():
        raise FrameError("a touch's position or radius is not finite")
    return values


def _refuse_nonfinite(values: FloatArray, name: str) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        frame, row = bad[0]
        raise FrameError(
            f"{name}: frame {frame}, row {row} is {values[frame, row]} ({len(bad)} such"
            " values); run  eitskin doctor  on the source, or leave those rows out"
        )
