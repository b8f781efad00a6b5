"""The inputs and results of a reconstruction, for every engine."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, BoolArray, FloatArray
from eitskin.core.diagnostics import names, words
from eitskin.core.diagnostics_table import InfoFields, Touch
from eitskin.core.notebook import places_text, touches_html
from eitskin.core.options_table import (
    ALL_TOUCH_FIT,
    CHOICES,
    INTERACTION,
    JOINT,
    LOG_DATA,
    RANGES,
    SPLIT_MERGE,
    OptionFields,
)
from eitskin.errors import FrameError, UsageError

TAKE_REFERENCE = "take it from frames of the untouched skin with  tare()"


@dataclass(frozen=True)
class Options(OptionFields):
    """The options of the core; tables/options.toml explains each."""


_OPTION_KINDS = get_type_hints(Options)


def check_options(o: Options) -> None:
    """Reject the values that eits_set_options in the C core rejects, and name the option."""
    for name, kind in _OPTION_KINDS.items():
        value = getattr(o, name)
        if name in RANGES:
            _check_number(name, value, *RANGES[name], whole=kind is int)
        elif name in CHOICES and value not in CHOICES[name]:
            known = ", ".join(CHOICES[name])
            raise UsageError(f"options: {name} = {value!r} is not known; use one of {known}")
        elif kind is bool and value not in (False, True):
            raise UsageError(f"options: {name} = {value!r} must be true or false")
    if o.touch_fit & ~ALL_TOUCH_FIT:
        raise UsageError(
            f"options: touch_fit = {o.touch_fit} is out of range: it has bits without a meaning;"
            f" use a sum of LOG_DATA {LOG_DATA}, SPLIT_MERGE {SPLIT_MERGE}, INTERACTION"
            f" {INTERACTION} and JOINT {JOINT}"
        )
    if not o.touch_min_radius_mm <= o.touch_seed_radius_mm <= o.touch_max_radius_mm:
        raise UsageError(
            f"options: touch radii of {o.touch_min_radius_mm:g}, {o.touch_seed_radius_mm:g} and "
            f"{o.touch_max_radius_mm:g} mm (least, seed, most) must ascend from above 0"
        )


def _check_number(name: str, value: Any, low: float, high: float, *, whole: bool) -> None:
    kind = (int, np.integer) if whole else (int, float, np.integer, np.floating)
    if isinstance(value, bool) or not isinstance(value, kind):
        raise UsageError(f"options: {name} = {value!r} must be a {'whole ' * whole}number")
    if not low <= value <= high:
        raise UsageError(f"options: {name} = {value!r} is out of range; use {low:g} to {high:.10g}")


def check_shape(frames: AnyArray, n_rows: int, what: str, least: int = 0) -> None:
    """Raise a FrameError unless ``frames``, called ``what`` in the error, are (k, n_rows) with k at
    ``least``."""
    if frames.ndim != 2 or frames.shape[1] != n_rows or len(frames) < least:
        raise FrameError(
            f"{what}: of shape {frames.shape}, but the model's protocol has {n_rows} rows"
        )


def frame_numbers(values: npt.ArrayLike | None, what: str) -> FloatArray:
    """Return ``values`` as an array; values hidden by a numpy mask become NaN, and their rows are
    not used."""
    if values is None:
        raise FrameError(
            f"{what}: is None, not an array of voltages; a stream has them only if its mode asks"
            ' for them: mode="raw,touches"'
        )
    try:
        if isinstance(values, np.ma.MaskedArray):
            return np.where(np.ma.getmaskarray(values), np.nan, np.asarray(values, np.float64))
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise FrameError(
            f"{what}: is not an array of voltages; give numbers in V, rows of one length"
        ) from None


def check_reference_frames(frames: FloatArray, masked: BoolArray, saturation_v: float) -> None:
    """Raise a FrameError if untouched ``frames`` (k, m) have an unusable voltage in a row that is
    not ``masked`` (m,). With ``saturation_v`` 0 no voltage counts as saturated."""
    values = np.where(masked, 0.0, frames)
    unusable = ~np.isfinite(values) | ((saturation_v > 0) & (np.abs(values) >= saturation_v))
    if unusable.any():
        frame, row = (int(place[0]) for place in np.nonzero(unusable))
        raise FrameError(
            f"reference frame {frame} (from 0): row {row} (from 0) is not finite or saturated; mask"
            " it or measure again"
        )


@dataclass(frozen=True)
class LearnedReference:
    """The reference as learned. ``correlation`` is with the model's own reference, ``gain`` is in
    model volts per measured volt, ``noise_v`` (rms over rows) and ``lambda_noise`` are 0 if fewer
    than ``MIN_REFERENCE_FRAMES`` (4) frames were given, and ``outliers`` is the number of readings
    that were left out."""

    frames: int
    correlation: float
    gain: float
    v0_rms_v: float
    noise_v: float
    lambda_noise: float
    outliers: int = 0

    @property
    def snr_db(self) -> float | None:
        """The SNR of a frame, 20 log10(v0_rms_v / noise_v), or None if the noise is not known."""
        return 20 * math.log10(self.v0_rms_v / self.noise_v) if self.noise_v > 0 else None


NEWTONS_PER_GRAM = 9.80665e-3  # of a weight, at the standard acceleration of gravity


def force_text(force_n: float) -> str:
    """Return a force as text: in millinewtons below 1 N, else in newtons."""
    return f"{1000 * force_n:.0f} mN" if force_n < 0.9995 else f"{force_n:.2f} N"


@dataclass(frozen=True)
class Info(InfoFields):
    """The cost of a frame, the end of its solve, and its diagnostics. ``solve_us`` (frame stage and
    solver) and ``touch_us`` are measured by the host's clock; they are ignored when two results are
    compared."""

    solve_us: float = field(default=0.0, compare=False)
    touch_us: float = field(default=0.0, compare=False)

    @property
    def found(self) -> tuple[str, ...]:
        """Each diagnostic of the frame as a short text: "electrode 5 open", "2 rows left out as
        outliers"..."""
        return words(self)

    @property
    def diagnostics_by_name(self) -> tuple[str, ...]:
        """The names of the diagnostics that were made."""
        return names(self.diagnostics)

    def as_dict(self) -> dict[str, Any]:
        """Return the values for JSON under the same names, without the underscore of ``lambda_``,
        and with the names of the diagnostics."""
        values = {key.rstrip("_"): value for key, value in asdict(self).items()}
        return values | {"diagnostics": list(self.diagnostics_by_name), "found": list(self.found)}


# all but the last one, `confirmed`
_MAY_BE_UNKNOWN = [kind == float | None for kind in get_type_hints(Touch).values()][:-1]


def known_touch(values: Sequence[Any]) -> Touch:
    """Return a touch from the fields of eits_touch in order. Fields that are 0 because they are
    unknown become None."""
    *whole, confirmed = values
    first = _MAY_BE_UNKNOWN.index(True)
    if not whole[first]:
        whole[first] = None
    if not whole[first + 1]:
        whole[first + 1 :] = [None] * (len(whole) - first - 1)
    if not any(whole[-3:-1]):  # no long axis: the data do not distinguish it from a disc
        whole[-3:-1] = [None, None]
    if not whole[-1]:  # the data do not determine the radius
        whole[-1] = None
    return replace(Touch(*whole), confirmed=bool(confirmed))


def solve_text(iterations: int, stop: str, gap_rel: float, macs: int, time_us: float) -> str:
    """Return a line that states how a solve ended and what it and the touches cost; a time of 0 is
    unknown and left out."""
    reason = "limit" if stop == "iterations" else stop
    text = f"{iterations} iterations ({reason})" + (f", gap {gap_rel:.1e}" if iterations else "")
    text += f", {macs / 1e6:.2f} MMAC" if macs else ""
    return text + (f", {time_us / 1000:.2f} ms" if time_us else "")


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """The result of one frame.

    Attributes:
        solver_image: (n,) S/m on the model's pixels, as the solver left it.
        coefficients: (n,), the same over the column weights.
        touches: the strongest first.
        info: cost, end and diagnostics.
        model: None where it is not known.
        touch_image: (n,) S/m, the touches as discs and ellipses of one height
            (``eits_draw_touches``); None if there are none, or where they do not explain the frame.
    """

    solver_image: npt.NDArray[np.floating[Any]]
    coefficients: npt.NDArray[np.floating[Any]]
    touches: tuple[Touch, ...]
    info: Info
    model: Any = None
    touch_image: npt.NDArray[np.floating[Any]] | None = None

    @property
    def image(self) -> npt.NDArray[np.floating[Any]]:
        """The image that shows the frame, (n,) S/m: ``touch_image`` if the touches explain the
        frame, else ``solver_image``; ``image_is`` says which of the two."""
        return self.solver_image if self.touch_image is None else self.touch_image

    @property
    def image_is(self) -> str:
        """The kind of ``image``: "touches" or "solver"."""
        return "solver" if self.touch_image is None else "touches"

    def __repr__(self) -> str:
        return f"<Reconstruction, touches: {places_text(self.touches)}; {self.info.stop}>"

    def _repr_html_(self) -> str:
        return touches_html("touches", self.touches)

    def _repr_png_(self) -> bytes | None:
        """Return a picture if the model is known and matplotlib is installed."""
        if self.model is None or find_spec("matplotlib") is None:
            return None
        view = import_module("eitskin.view.touch_axes")  # core must not depend on view
        png: bytes = view.touches_png(self.model, self.touches, self.image)
        return png
