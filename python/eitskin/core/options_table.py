"""The options of the core. Written by tables/make_tables.py from tables/options.toml."""

from dataclasses import dataclass

from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS

# eits_sign: The sign of the conductivity changes that the image may have.
SIGNS = ("increase", "decrease", "both")
# eits_solver: The method that finds the image; all minimise the same objective (solve.h).
SOLVERS = ("fista", "working-set", "active-set")
# eits_touch_fit: Bits: what the touch fit does beyond fitting discs to the image's peaks.
LOG_DATA = 1
SPLIT_MERGE = 2
INTERACTION = 4
JOINT = 32
ALL_TOUCH_FIT = 39
MAX_TOUCHES = 16


@dataclass(frozen=True)
class OptionFields:
    """The options. Lambdas are in the units of S'y. docs/reference/options.md lists default values
    and ranges.
    """

    # the maximum number of iterations; FISTA runs exactly this many if gap_rel is 0
    iterations: int
    max_touches: int  # the maximum number of touches that are reported; the default is the model's
    # the core rejects a frame in which more rows cannot be used; by default half of the rows
    max_masked: int
    solver: str  # the method: fista, working-set or active-set (solve.h)
    # 1: ignore changes along the reference frame, that is, drift of the gain; the default is 1, in
    # taught models 0
    project_reference: bool
    lambda_rel: float  # lambda is at least this fraction of lambda_max, unless lambda_abs is given
    # lambda is at least this multiple of lambda_noise, unless lambda_abs is given
    lambda_noise_factor: float
    # a frame has no touch if lambda_max < detection_factor lambda_noise; 0: no threshold
    detection_factor: float
    # a local maximum of the image below this fraction of the greatest one starts no touch
    touch_threshold: float
    # a touch that explains less than this fraction of |y|^2 beside the others is dropped
    touch_min_fraction: float
    touch_min_radius_mm: float  # the least radius of a touch
    touch_max_radius_mm: float  # the greatest radius of a touch
    touch_seed_radius_mm: float  # the radius from which a fit starts, between the other two
    # expected conductivity change under a touch, which separates radius from strength; 0: unknown
    touch_change_s_per_m: float
    # weight, against the data, of the radius that touch_change_s_per_m implies, relative to the
    # touch's own energy
    touch_radius_weight: float
    # a touch keeps its id if the next frame shows it within this distance of the place to which its
    # velocity brings it
    follow_mm: float
    # 1: discs start where they explain most of the data, one after the other, and each is placed
    # again beside the others; 0: they start at the image's peaks. The default is 0, in taught
    # models 1
    touch_seek: bool
    # parts of the touch fit, one bit each; by default all that the model does not leave out
    touch_fit: int
    # > 0: reference tracking: while nothing touches the skin, the reference follows it with this
    # time constant, in frames; 0: the reference stays as it was taken. The default is 0, in taught
    # models 512. Works only if eits_find_touches is called for each frame, and not in a batch
    reference_frames: int
    # iterations between checks of the duality gap and of divergence, and before the working set is
    # chosen again
    gap_every: int = 10
    # the change that is looked for: increase (conducting touches), decrease or both
    sign: str = "increase"
    # 1: start from the last frame's coefficients, with the momentum reset (solve.h)
    warm_start: bool = False
    # > 0: lambda itself; 0: lambda is the greater of lambda_rel lambda_max and lambda_noise_factor
    # lambda_noise
    lambda_abs: float = 0.0
    gap_rel: float = 0.0  # > 0: stop once the duality gap <= gap_rel |y|^2 / 2
    # > 0: a row at or beyond +-saturation_v, V, is left out; 0: no row is saturated
    saturation_v: float = 0.0
    # sweeps of the off-grid fit over all touches; 0: peaks with their strengths only
    touch_sweeps: int = 6
    # > 0: stop with the best image so far before info.macs exceeds this (solve.h); 0: no limit
    mac_limit: int = 0
    diagnostics: int = ALL_DIAGNOSTICS  # the diagnostics that are examined, one bit each
    # 1: if more than one touch is found, eits_find_touches solves the frame again with their
    # interaction taken out of the data; image and info are then those of the second solve. Ignored
    # with a mac_limit
    second_pass: bool = False
    # the whitening's regularisation is at least this times noise_v / v0_rms, if both are known; 0:
    # it is the model's
    regularisation_noise_factor: float = 5.0
    # 1: each row's data are multiplied by the gain that makes its reference equal to the model's.
    # Needs a model with section UNCE; not done if the reference shows that the instrument differs
    # rather than the skin
    row_gains: bool = True
    # 1: a touch that the model's own errors could have caused is not reported, and close touches
    # that could be one become one. Needs a model with section UNCE
    touch_test: bool = True
    # the most columns that the touch test may compute per frame (about 6 kMAC each at rank 64)
    # after a first look at each touch. When they are used up, the touches found so far are reported
    # as crowded; 0: no limit but the frame's budget (TEST_WORK)
    test_columns: int = 200
    # the noise of a row is at least this, V; for a converter, its step over the square root of 12
    noise_floor_v: float = 0.0


# Least and greatest value of each option that is a number.
RANGES: dict[str, tuple[float, float]] = {
    "iterations": (1, 2**32 - 1),
    "gap_every": (1, 2**32 - 1),
    "max_touches": (0, MAX_TOUCHES),
    "max_masked": (0, 2**32 - 1),
    "lambda_abs": (0, 1e30),
    "lambda_rel": (0, 1),
    "lambda_noise_factor": (0, 1e30),
    "detection_factor": (0, 1e30),
    "gap_rel": (0, 1),
    "saturation_v": (0, 1e30),
    "touch_threshold": (0, 1),
    "touch_min_fraction": (0, 1),
    "touch_min_radius_mm": (1e-06, 1e30),
    "touch_max_radius_mm": (1e-06, 1e30),
    "touch_seed_radius_mm": (1e-06, 1e30),
    "touch_change_s_per_m": (0, 1e30),
    "touch_radius_weight": (0, 1e30),
    "touch_sweeps": (0, 1000),
    "follow_mm": (0, 1e30),
    "mac_limit": (0, 2**32 - 1),
    "diagnostics": (0, 511),
    "touch_fit": (0, 39),
    "regularisation_noise_factor": (0, 1e30),
    "test_columns": (0, 2**32 - 1),
    "reference_frames": (0, 2**32 - 1),
    "noise_floor_v": (0, 1e30),
}
# The names that an option may have, and the numbers that stand for them.
CHOICES: dict[str, dict[str, int]] = {
    "sign": {"increase": 0, "decrease": 1, "both": 2},
    "solver": {"fista": 0, "working-set": 1, "active-set": 3},
}
# The own defaults of a model, by the same names.
OF_MODEL = (
    "iterations",
    "solver",
    "lambda_rel",
    "lambda_noise_factor",
    "detection_factor",
    "touch_threshold",
    "touch_min_fraction",
    "touch_min_radius_mm",
    "touch_max_radius_mm",
    "touch_seed_radius_mm",
    "touch_change_s_per_m",
    "touch_radius_weight",
    "follow_mm",
)
