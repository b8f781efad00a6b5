"""The options of the core. Written by tables/make_tables.py from tables/options.toml."""

from dataclasses import dataclass

from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS

# eits_sign: Which conductivity changes are looked for.
SIGNS = ("increase", "decrease", "both")
# eits_solver: How an image is found; each minimises the same objective (solve.h).
SOLVERS = ("fista", "working-set", "active-set")
# eits_touch_fit: Bits: what the touch fit does beyond fitting discs to the image's peaks.
LOG_DATA = 1
SPLIT_MERGE = 2
INTERACTION = 4
ALL_TOUCH_FIT = 7
MAX_TOUCHES = 16
MAX_TRACK_FRAMES = 1000


@dataclass(frozen=True)
class OptionFields:
    """The options. Lambdas are in the units of S'y. docs/reference/options.md lists usual values
    and ranges.
    """

    iterations: int  # the most iterations; exactly so many where gap_rel is 0
    max_touches: int  # the most touches that are reported; the model's number by default
    max_masked: int  # the core rejects a frame with more unusable rows; half of the rows by default
    solver: str  # fista, working-set or active-set (solve.h)
    # 1: ignore changes along the reference frame, that is drift of the gain; 0 by default in taught
    # models
    project_reference: bool
    lambda_rel: float  # lambda, where lambda_abs is 0, is at least this fraction of lambda_max
    lambda_noise_factor: float  # and at least this multiple of lambda_noise
    # no touch where lambda_max < detection_factor lambda_noise; 0: no such threshold
    detection_factor: float
    touch_threshold: float  # a local maximum below this fraction of the greatest starts no touch
    # a touch that explains less than this fraction of |y|^2 beside the others is dropped
    touch_min_fraction: float
    touch_min_radius_mm: float  # the least radius of a touch
    touch_max_radius_mm: float  # the greatest
    touch_seed_radius_mm: float  # the radius that a fit starts from, between the two
    # expected conductivity change under a touch, which separates radius from strength; 0: unknown
    touch_change_s_per_m: float
    # weight of the radius so expected against the data, relative to the touch's own energy
    touch_radius_weight: float
    follow_mm: float  # a touch that moved at most so far since the last frame keeps its id
    # 1: discs start where the data answer most, one after the other, each sought again beside the
    # others, and not at the image's peaks; the default in taught models
    touch_seek: bool
    # parts of the touch fit, a bit each; all but those that the model leaves out by default
    touch_fit: int
    # > 0: between touches the reference follows the untouched skin, with this time constant in
    # frames; 0: it stays as it was taken, the default but in taught models. After eits_find_touches
    # alone, and not in a batch
    reference_frames: int
    # iterations between checks of the duality gap and of divergence, and until the working set is
    # chosen again
    gap_every: int = 10
    # the change that is looked for: increase (conducting touches), decrease or both
    sign: str = "increase"
    # 1: start from the last frame's coefficients, momentum reset (solve.h)
    warm_start: bool = False
    # > 0: this lambda; 0: the greater of those that lambda_rel and lambda_noise_factor give
    lambda_abs: float = 0.0
    gap_rel: float = 0.0  # > 0: stop once the duality gap <= gap_rel |y|^2 / 2
    saturation_v: float = 0.0  # > 0: a channel at or beyond +-saturation_v is unusable, V
    # sweeps of the off-grid fit over all touches; 0: peaks with their strengths only
    touch_sweeps: int = 6
    mac_limit: int = 0  # > 0: stop with the best so far before info.macs goes beyond this (solve.h)
    diagnostics: int = ALL_DIAGNOSTICS  # the diagnostics that are looked for, a bit each
    # 1: where more than one touch is found, eits_find_touches solves again with their interaction
    # taken out of the data; image and info are then the second solve's. Not with a mac_limit
    second_pass: bool = False
    # a tentative touch is reported once it was found in so many frames in a row; 0, 1: at once
    track_confirm: int = 0
    # a touch that is not found keeps its id for so many frames, and is still reported if it was
    # faint before
    track_hold: int = 0
    # > 0: follow places, radii and strengths in time; how uncertain the place of a touch is whose
    # S'y is as great as that of noise, in pixels
    track_smooth: float = 0.0
    # the whitening's regularisation is at least this times noise_v / v0_rms, where both are known;
    # 0: as the model has it
    regularisation_noise_factor: float = 5.0
    # 1: where the model says what it may be wrong by, each row's data are multiplied by what makes
    # its reference the model's, unless the reference says that the instrument differs and not the
    # skin
    row_gains: bool = True
    # 1: where the model says what it may be wrong by, a touch that such errors could have made is
    # not reported, and near ones that could be one touch become one
    touch_test: bool = True
    # columns that the test of touches may make a frame (about 6 kMAC each at rank 64) beyond a
    # first look at each touch; then what stands is reported as crowded; 0: any number
    test_columns: int = 200
    # the noise of a row is at least this, V: of a converter its step over the root of 12
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
    "touch_fit": (0, 7),
    "track_confirm": (0, MAX_TRACK_FRAMES),
    "track_hold": (0, MAX_TRACK_FRAMES),
    "track_smooth": (0, 1e30),
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
# What a model's own defaults say, by the same names.
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
