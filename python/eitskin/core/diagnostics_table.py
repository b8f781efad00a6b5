"""Diagnostics and info of a frame, from the core. Written by tables/make_tables.py from
tables/diagnostics.toml.
"""

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
# eits_shown: The image that shows a frame.
SHOWN = ("solver", "touches")


@dataclass(frozen=True)
class InfoFields:
    """eits_info: The cost of a reconstruction, how it ended, and what was wrong with the frame."""

    iterations: int  # iterations of the solver
    stop: str  # why the solver stopped
    nonzeros: int  # coefficients that are not zero
    masked: int  # rows of the protocol that were left out of this frame
    step_halvings: int  # how often the solver halved its step because the objective rose
    touches: int  # number of touches; set by eits_find_touches
    # multiply-accumulates with a stored matrix, a basis vector, F or the active set's factor;
    # vector sums are not counted
    macs: int
    touch_macs: int  # the same for eits_find_touches
    lambda_: float  # lambda as used
    lambda_max: float  # the smallest lambda whose image is zero: max(S'y), by the option sign
    # the reference's lambda_noise, times a factor for the rows that are left out
    lambda_noise: float
    # duality gap at the result, absolute; 0 if stop is BELOW_THRESHOLD, ZERO or DIVERGED, or if it
    # is MACS and not even one product with S was affordable
    gap: float
    gap_rel: float  # gap / (|y|^2 / 2)
    residual: float  # |y - S x|
    data_norm: float  # |y|
    diagnostics: int = 0  # bits of eits_diagnostic; CROWDED is set by eits_find_touches
    saturated: int = 0  # saturated rows, masked ones not counted
    outliers: int = 0  # rows left out as outliers
    # fraction of |d| above noise that lies outside the model's range, 0 to 1; 0 if it was not
    # examined
    model_mismatch: float = 0.0
    # fraction of |y|^2 that the touches do not explain, or of |d|^2 if they were fitted jointly;
    # set by eits_find_touches; 0 if no touches were looked for
    unexplained: float = 0.0
    # bit e: electrode e is open, for the first 64; eits_get_electrode_states has all
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()  # bit e: electrode e is bridged with another one
    noisy_electrodes: tuple[int, ...] = ()  # bit e: electrode e is noisy
    # regularisation of the whitening of this frame, over s_1^2; 0 if the model does not state it
    regularisation: float = 0.0
    shown: str = "solver"  # which image shows the frame; set by eits_find_touches


@dataclass(frozen=True)
class Touch:
    """eits_touch: One touch."""

    id: int  # number from 1 that a touch keeps from frame to frame
    x_mm: float  # centre of the touch
    y_mm: float
    radius_mm: float  # radius of the fitted disc, or of a disc with the ellipse's area
    strength_s_per_m_mm2: float  # conductivity change integrated over the touch: S mm^2/m
    # fraction of |y|^2 that would be unexplained without this touch, 0 to 1; 0 if it was not found
    # in this frame and is held from earlier ones
    explained: float
    force_n: float = 0.0  # its force, N; 0 if the model is not calibrated (force.h)
    # probability that this is a touch, and not a second one found for the same touch; 0 if it is
    # not known: the model has no section UNCE, or the touch is held
    confidence: float | None = None
    # covariance of the centre in this frame, mm^2; 0 if it is not known
    x_variance_mm2: float | None = None
    xy_covariance_mm2: float | None = None
    y_variance_mm2: float | None = None
    # half of the long axis, as a vector, mm, of the ellipse that the touch is found to be. Its area
    # is pi radius_mm^2, so half of the short axis is radius_mm^2 over this length. 0, 0: a disc, or
    # the data do not show a shape
    long_x_mm: float | None = None
    long_y_mm: float | None = None
    # standard deviation of radius_mm; 0 if the data do not determine the radius. Then radius_mm is
    # the one expected of touches of this strength, and the change of conductivity, which is the
    # strength over the area, is not known either
    radius_sd_mm: float | None = None
    # 1: a whole frame has shown it; 0: so far only drives have, or a single frame
    # (eits_fast_report)
    confirmed: bool = True
