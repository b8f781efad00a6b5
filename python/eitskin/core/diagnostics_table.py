"""What the core says of a frame. Written by tables/make_tables.py from tables/diagnostics.toml."""

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
STOPS = ("iterations", "gap", "below-threshold", "zero", "diverged", "macs", "optimum")


@dataclass(frozen=True)
class InfoFields:
    """eits_info: What a reconstruction cost, how it ended and what was wrong with the frame."""

    iterations: int  # of the solver
    stop: str
    nonzeros: int  # coefficients that are not zero
    masked: int  # rows of the protocol that were left out of this frame
    step_halvings: int
    touches: int  # set by eits_find_touches
    # multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
    # vector sums are not counted
    macs: int
    touch_macs: int  # the same for eits_find_touches
    lambda_: float  # as used
    lambda_max: float  # the least lambda whose image is zero: max(S'y) along the sign
    lambda_noise: float  # the reference's, times what rows left out add
    # duality gap at the result, absolute; 0 where stop is BELOW_THRESHOLD, ZERO or DIVERGED, and
    # where MACS came before anything was known
    gap: float
    gap_rel: float  # gap / (|y|^2 / 2)
    residual: float  # |y - S x|
    data_norm: float  # |y|
    diagnostics: int = 0  # bits of eits_diagnostic; CROWDED is set by eits_find_touches
    saturated: int = 0  # saturated rows, without masked ones
    outliers: int = 0  # rows left out as outliers
    # fraction of |d| beyond noise that lies outside the model's range, 0 to 1; 0 where that was not
    # examined
    model_mismatch: float = 0.0
    # fraction of |y|^2 that the touches leave, set by eits_find_touches; 0 where none were looked
    # for
    unexplained: float = 0.0
    # bit e: electrode e, of the first 64; eits_get_electrode_states has all
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()  # bit e: electrode e, of one or more pairs
    noisy_electrodes: tuple[int, ...] = ()  # bit e: electrode e
    # of the whitening, over s_1^2, as this frame was reduced; 0 where the model does not say
    regularisation: float = 0.0


@dataclass(frozen=True)
class Touch:
    """eits_touch: One touch."""

    id: int  # counts up from 1; stays with a touch from frame to frame
    x_mm: float  # the centre
    y_mm: float
    radius_mm: float
    strength_s_per_m_mm2: float  # conductivity change integrated over the touch: S mm^2/m
    # fraction of |y|^2 that leaving this touch out would leave unexplained: 0 to 1; 0 where it was
    # not found in this frame and is held
    explained: float
    force_n: float = 0.0  # how hard it presses, N; 0 where the model is not calibrated (force.h)
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
