"""What goes into a reconstruction and what comes out, whichever engine does it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.diagnostics import ALL_DIAGNOSTICS, names, words
from eitskin.errors import FrameError, UsageError

SIGNS = ("increase", "decrease", "both")
SOLVERS = ("fista", "working-set", "coordinate", "active-set")
MAX_TOUCHES = 16
LOG_DATA, SPLIT_MERGE, INTERACTION = 1, 2, 4
ALL_TOUCH_FIT = LOG_DATA | SPLIT_MERGE | INTERACTION
MAX_TRACK_FRAMES = 1000
MIN_RADIUS_MM, HUGE = 1e-6, 1e30
STOPS = ("iterations", "gap", "below-threshold", "zero", "diverged", "macs", "optimum")


@dataclass(frozen=True)
class Options:
    """The solver's options; csrc/include/eitskin/context.h documents each. Lambdas in the units of
    S'y.

    ``sign`` is which change is looked for: "increase" (conducting touches), "decrease" or "both".
    ``solver`` is "fista" (every column in every iteration), "working-set" (FISTA on the columns
    that may differ from zero), "coordinate" (sweeps of coordinate descent) or "active-set" (rounds
    to the exact optimum). ``mac_limit`` (0: none): the best so far when the next step would take
    the solve beyond so many multiply-accumulates. ``diagnostics``: what is looked for, bit k of
    ``DIAGNOSTICS``. ``track_confirm``, ``track_hold`` (frames) and ``track_smooth`` (pixels) follow
    touches in time; all 0: each frame by itself (``solve.options.tracking`` sets them,
    docs/guide/tracking.md). ``regularisation_noise_factor``: the whitening's regularisation is at
    least this times the tare's noise over rms(V0); 0: as the model has it.
    """

    iterations: int
    max_touches: int
    max_masked: int
    lambda_rel: float
    lambda_noise_factor: float
    detection_factor: float
    touch_threshold: float
    touch_min_fraction: float
    touch_min_radius_mm: float
    touch_max_radius_mm: float
    touch_seed_radius_mm: float
    touch_change_s_per_m: float
    touch_radius_weight: float
    follow_mm: float
    gap_every: int = 10
    sign: str = "increase"
    solver: str = "fista"
    warm_start: bool = False
    project_reference: bool = True
    lambda_abs: float = 0.0
    gap_rel: float = 0.0
    saturation_v: float = 0.0
    touch_sweeps: int = 6
    mac_limit: int = 0
    diagnostics: int = ALL_DIAGNOSTICS
    touch_fit: int = ALL_TOUCH_FIT
    second_pass: bool = False
    track_confirm: int = 0
    track_hold: int = 0
    track_smooth: float = 0.0
    regularisation_noise_factor: float = 5.0

    @property
    def tracks(self) -> bool:
        """Whether touches depend on the frames before, beyond their ids."""
        return self.track_confirm > 1 or self.track_hold > 0 or self.track_smooth > 0


WHOLE = {
    "iterations": (1, 2**32 - 1),
    "gap_every": (1, 2**32 - 1),
    "max_touches": (0, MAX_TOUCHES),
    "max_masked": (0, 2**32 - 1),
    "touch_sweeps": (0, 1000),
    "mac_limit": (0, 2**32 - 1),
    "diagnostics": (0, ALL_DIAGNOSTICS),
    "touch_fit": (0, ALL_TOUCH_FIT),
    "track_confirm": (0, MAX_TRACK_FRAMES),
    "track_hold": (0, MAX_TRACK_FRAMES),
}
SHARES = ("lambda_rel", "gap_rel", "touch_threshold", "touch_min_fraction")


def check_options(o: Options) -> None:
    """Refuse what eits_set_options in the C core refuses, naming the option.

    Raises:
        UsageError: one is out of its range, or of the wrong type.
    """
    for name, value in asdict(o).items():
        if name in ("sign", "solver"):
            known = SIGNS if name == "sign" else SOLVERS
            if value not in known:
                raise UsageError(
                    f"options: {name} = {value!r} is not known; use one of {', '.join(known)}"
                )
        elif name in ("warm_start", "project_reference", "second_pass"):
            if value not in (False, True):
                raise UsageError(f"options: {name} = {value!r} must be true or false")
        else:
            _check_number(name, value, *WHOLE.get(name, (0, 1) if name in SHARES else (0, HUGE)))
    if (
        not MIN_RADIUS_MM
        <= o.touch_min_radius_mm
        <= o.touch_seed_radius_mm
        <= o.touch_max_radius_mm
    ):
        raise UsageError(
            f"options: touch radii of {o.touch_min_radius_mm:g}, {o.touch_seed_radius_mm:g} and "
            f"{o.touch_max_radius_mm:g} mm (least, seed, most) must ascend from above 0"
        )


def _check_number(name: str, value: Any, low: float, high: float) -> None:
    kind = (int, np.integer) if name in WHOLE else (int, float, np.integer, np.floating)
    if isinstance(value, bool) or not isinstance(value, kind):
        raise UsageError(
            f"options: {name} = {value!r} must be a {'whole ' if name in WHOLE else ''}number"
        )
    if not low <= value <= high:
        raise UsageError(f"options: {name} = {value!r} is out of range; use {low:g} to {high:.10g}")


def check_reference_frames(
    frames: npt.NDArray[np.float64], masked: npt.NDArray[np.bool_], saturation_v: float
) -> None:
    """Refuse quiet ``frames`` (k, m) with an unusable voltage in a row that is not ``masked`` (m,);
    0: no saturation.

    Raises:
        FrameError: naming the first such frame and row.
    """
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
    """The reference as learned: ``correlation`` with the model's own, ``gain`` in model volts per
    measured volt, ``noise_v`` (rms over rows) and ``lambda_noise``, both 0 if only one frame was
    given; ``outliers`` readings were left out.
    """

    frames: int
    correlation: float
    gain: float
    v0_rms_v: float
    noise_v: float
    lambda_noise: float
    outliers: int = 0


@dataclass(frozen=True)
class Touch:
    """One touch: centre, radius, conductivity change integrated over it; ``id`` follows it from
    frame to frame. One that is held while it is not found has confidence 0. ``force_n`` is how hard
    it presses, in newtons, where the model is calibrated (docs/guide/calibration.md), else 0."""

    id: int
    x_mm: float
    y_mm: float
    radius_mm: float
    strength_s_per_m_mm2: float
    confidence: float
    force_n: float = 0.0


NEWTONS_PER_GRAM = 9.80665e-3  # grams-force, by the standard acceleration of free fall


def force_text(force_n: float) -> str:
    """A load in words: grams (of force), as weights are marked."""
    return f"{force_n / NEWTONS_PER_GRAM:.1f} g"


@dataclass(frozen=True)
class Info:
    """What a frame cost and how its solve ended (eits_info in csrc/include/eitskin/context.h).
    ``solve_us`` and ``touch_us`` are this host's, by its clock, the frame stage with the solve; two
    runs that differ in nothing else are equal.
    """

    iterations: int
    stop: str
    nonzeros: int
    masked: int
    step_halvings: int
    touches: int
    macs: int
    touch_macs: int
    lambda_: float
    lambda_max: float
    lambda_noise: float
    gap: float
    gap_rel: float
    residual: float
    data_norm: float
    diagnostics: int = 0
    saturated: int = 0
    outliers: int = 0
    model_mismatch: float = 0.0
    unexplained: float = 0.0
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()
    noisy_electrodes: tuple[int, ...] = ()
    regularisation: float = 0.0
    solve_us: float = field(default=0.0, compare=False)
    touch_us: float = field(default=0.0, compare=False)

    @property
    def found(self) -> tuple[str, ...]:
        """What was found wrong with the frame, each in a few words: "electrode 5 open", "2 rows
        left out as outliers"..."""
        return words(self)

    @property
    def diagnostics_by_name(self) -> tuple[str, ...]:
        """Those of ``DIAGNOSTICS`` that were made."""
        return names(self.diagnostics)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the same names, without the underscore of ``lambda_``; diagnostics by name."""
        values = {key.rstrip("_"): value for key, value in asdict(self).items()}
        return values | {"diagnostics": list(self.diagnostics_by_name), "found": list(self.found)}


def solve_text(iterations: int, stop: str, gap_rel: float, macs: int, time_us: float) -> str:
    """How a solve ended and what it and the touches cost, in a line; a time of 0 is not known."""
    text = f"{iterations} iterations ({stop})" + (f", gap {gap_rel:.1e}" if iterations else "")
    text += f", {macs / 1e6:.2f} MMAC" if macs else ""
    return text + (f", {time_us / 1000:.2f} ms" if time_us else "")


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """One frame's result: ``image`` (n,) S/m on the model's pixels, ``coefficients`` (n,), touches
    strongest first, info."""

    image: npt.NDArray[np.floating[Any]]
    coefficients: npt.NDArray[np.floating[Any]]
    touches: tuple[Touch, ...]
    info: Info
