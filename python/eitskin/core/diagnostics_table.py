"""What the core says of a frame. Written by tables/make_tables.py from tables/diagnostics.toml."""

from __future__ import annotations

from dataclasses import dataclass

# eits_diagnostic: Bits of info.diagnostics and options.diagnostics. No bit ever gets another
# meaning.
DIAGNOSTICS = (
    "saturated",
    "electrode open",
    "electrodes bridged",
    "outlier",
    "electrode noisy",
    "model mismatch",
    "stale reference",
    "crowded",
    "unlike the model",
)
ALL_DIAGNOSTICS = 511
# eits_stop: Why the solver stopped.
STOPS = (
    "iterations",
    "gap",
    "below-threshold",
    "zero",
    "diverged",
    "macs",
    "optimum",
)


@dataclass(frozen=True)
class InfoFields:
    """eits_info: What a reconstruction cost, how it ended and what was wrong with the frame."""

    # of the solver
    iterations: int
    stop: str
    # coefficients that are not zero
    nonzeros: int
    # rows of the protocol that were left out of this frame
    masked: int
    step_halvings: int
    # set by eits_find_touches
    touches: int
    # multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
    # vector sums are not counted
    macs: int
    # the same for eits_find_touches
    touch_macs: int
    # as used
    lambda_: float
    # the least lambda whose image is zero: max(S'y) along the sign
    lambda_max: float
    # the reference's, times what rows left out add
    lambda_noise: float
    # duality gap at the result, absolute; 0 where stop is BELOW_THRESHOLD, ZERO or DIVERGED, and
    # where MACS came before anything was known
    gap: float
    # gap / (|y|^2 / 2)
    gap_rel: float
    # |y - S x|
    residual: float
    # |y|
    data_norm: float
    # bits of eits_diagnostic; CROWDED is set by eits_find_touches
    diagnostics: int = 0
    # saturated rows, without masked ones
    saturated: int = 0
    # rows left out as outliers
    outliers: int = 0
    # fraction of |d| beyond noise that lies outside the model's range, 0 to 1; 0 where that was not
    # examined
    model_mismatch: float = 0.0
    # fraction of |y|^2 that the touches leave, set by eits_find_touches; 0 where none were looked
    # for
    unexplained: float = 0.0
    # bit e: electrode e, of the first 64; eits_get_electrode_states has all
    open_electrodes: tuple[int, ...] = ()
    # bit e: electrode e, of one or more pairs
    bridged_electrodes: tuple[int, ...] = ()
    # bit e: electrode e
    noisy_electrodes: tuple[int, ...] = ()
    # of the whitening, over s_1^2, as this frame was reduced; 0 where the model does not say
    regularisation: float = 0.0


@dataclass(frozen=True)
class Touch:
    """eits_touch: One touch."""

    # counts up from 1; stays with a touch from frame to frame
    id: int
    # the centre
    x_mm: float
    y_mm: float
    radius_mm: float
    # conductivity change integrated over the touch: S mm^2/m
    strength_s_per_m_mm2: float
    # fraction of |y|^2 that leaving this touch out would leave unexplained: 0 to 1; 0 where it was
    # not found in this frame and is held
    explained: float
    # how hard it presses, N; 0 where the model is not calibrated (force.h)
    force_n: float = 0.0
    # probability that there is a touch, and no second one of the same; 0 where that is not known:
    # the model does not say what it may be wrong by, or the touch is held
    confidence: float | None = None
    # covariance of the centre as this frame shows it, mm^2; 0 where it is not known
    x_variance_mm2: float | None = None
    xy_covariance_mm2: float | None = None
    y_variance_mm2: float | None = None
    # half of the long axis as a vector, mm, of the ellipse of area pi radius_mm^2 that the touch is
    # found to be; the short one is radius_mm^2 over its length. 0, 0: a disc, or the data do not
    # tell
    long_x_mm: float | None = None
    long_y_mm: float | None = None
