"""The truth that a source holds about its own scenes: touches and masks, converted to the units of
the frames file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import FrameError, UsageError
from eitskin.frames.arrays import pick


@dataclass(frozen=True)
class TruthOptions:
    """The names of the source's arrays, and their units.

    ``touch_frame`` (t,) is a frame index from 0 or a frame name. ``touch_xy`` (t, 2) and
    ``touch_radius`` (t,) are in units of ``touch_unit_mm``. ``touch_strength`` (t,) is the relative
    conductivity change. ``touch_sign`` (t,) is true or above 0 for a more conductive touch.
    ``mask`` (n, h, w) is +1, -1 or 0 over ``mask_extent_mm``; with ``mask_top_first`` its row 0 has
    the highest y.
    """

    touch_frame: str | None = None
    touch_xy: str | None = None
    touch_radius: str | None = None
    touch_strength: str | None = None
    touch_sign: str | None = None
    touch_unit_mm: float = 1.0
    mask: str | None = None
    mask_extent_mm: tuple[float, float, float, float] | None = None
    mask_top_first: bool = False


def truth_fields(
    arrays: Mapping[str, AnyArray],
    options: TruthOptions,
    names: Sequence[str],
    box_mm: tuple[float, float, float, float] | None,
    where: str,
) -> dict[str, Any]:
    """Return the truth fields of ``Frames`` that ``options`` ask for; ``names`` are those of the
    frames, ``box_mm`` is the bounding box of the skin."""
    return _touches(arrays, options, names, where) | _mask(arrays, options, box_mm, where)


def _touches(
    arrays: Mapping[str, AnyArray], options: TruthOptions, names: Sequence[str], where: str
) -> dict[str, Any]:
    needed = {
        "truth-frame": options.touch_frame,
        "truth-xy": options.touch_xy,
        "truth-radius": options.touch_radius,
    }
    extra = {"truth-strength": options.touch_strength, "truth-sign": options.touch_sign}
    keys = needed | extra
    if not any(keys.values()):
        return {}
    absent = [name for name, key in needed.items() if key is None]
    if absent:
        raise UsageError(
            f"touches need --{absent[0]} too (--truth-frame, --truth-xy and --truth-radius)"
        )
    picked = {
        name: pick(arrays, key, f"--{name}", where) for name, key in keys.items() if key is not None
    }
    frame = picked["truth-frame"]
    if frame.dtype.kind in "US":
        absent = [str(name) for name in frame if str(name) not in names]
        if absent:
            raise FrameError(
                f"{where}: {options.touch_frame} names frame {absent[0]!r}; frames are"
                f" {', '.join(names)}"
            )
        frame = np.array([list(names).index(str(name)) for name in frame], dtype=np.int64)
    elif frame.dtype.kind == "f" and (frame == np.round(frame)).all():
        frame = frame.astype(np.int64)

    def scaled(name: str, unit: float = 1.0) -> FloatArray:
        values = picked[name]
        if values.dtype.kind not in "fiub":
            raise FrameError(f"{where}: {keys[name]}: holds {values.dtype}, not numbers")
        return np.asarray(values, dtype=np.float64) * unit

    fields: dict[str, Any] = {"touch_frame": frame}
    fields["touch_xy_mm"] = scaled("truth-xy", options.touch_unit_mm)
    fields["touch_radius_mm"] = scaled("truth-radius", options.touch_unit_mm)
    if "truth-strength" in picked:
        fields["touch_strength"] = scaled("truth-strength")
    if "truth-sign" in picked:
        fields["touch_sign"] = np.where(scaled("truth-sign") > 0, 1, -1).astype(np.int8)
    return fields


def _mask(
    arrays: Mapping[str, AnyArray],
    options: TruthOptions,
    box_mm: tuple[float, float, float, float] | None,
    where: str,
) -> dict[str, Any]:
    if options.mask is None:
        return {}
    extent = box_mm if options.mask_extent_mm is None else options.mask_extent_mm
    if extent is None:
        raise UsageError(
            "a truth mask needs --truth-mask-extent XMIN,YMIN,XMAX,YMAX in mm, or --skin"
        )
    mask = pick(arrays, options.mask, "--truth-mask", where)
    if mask.ndim == 2:
        mask = mask[None]
    if options.mask_top_first:
        mask = mask[:, ::-1]
    return {"truth_mask": mask, "truth_mask_extent_mm": extent}
