"""A configuration: every setting, from the scan to the touches, that trades accuracy for cost, as
one frozen value."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from eitskin.config import from_table, parameter
from eitskin.core.options_table import ALL_TOUCH_FIT, SOLVERS
from eitskin.errors import ConfigError
from eitskin.model.build import BuildSettings, scaled_defaults
from eitskin.model.model import Defaults
from eitskin.model.reduction import DEFAULT_COLUMN_POWER, DEFAULT_REGULARISATION
from eitskin.model.storage import STORAGES
from eitskin.skin.skin import Skin

SCANS = ("full", "reciprocal")
PERIOD_SAMPLES = 20
BASE_SAMPLES = 80  # samples per measurement to which a stated SNR refers
HELD_FRAMES = 4
ELEMENTS = 3000  # elements of the mesh for the model of a configuration


@dataclass(frozen=True)
class Configuration:
    """The settings of one operating point. The defaults are those of a model that ``eitskin model
    build`` makes, and of a board's scan.

    Attributes:
        name: the name in tables and pictures.
        rank, pixels, storage, regularisation, column_power: settings of the model: rows of the
            reduced Jacobian, pixels along the skin's longer side, the type that it is stored in,
            and mu and p of the reduction (``eitskin.model.reduction``).
        solver, iterations, gap, mac_limit: how the image is found: with at most ``iterations``, or
            until the relative duality gap is below ``gap`` (0: never), or with at most
            ``mac_limit`` multiply-accumulates (0: no limit).
        lambda_rel: least lambda over lambda_max; a value below the lambda that the noise requires
            has no effect.
        lambda_noise_factor: least lambda over lambda_noise, which the tare measures, so that the
            image of a noisy instrument is smoothed more. It cannot be set over a board's link.
        warm_start: each frame starts from the last one's image. It is scored at the fourth frame of
            touches that are held, after other touches: what a user sees of resting touches, not of
            new ones.
        touch_sweeps: sweeps of the off-grid fit; 0 leaves touches at the peaks of the image.
        touch_fit: parts of the touch fit (``core.results``: log data 1, split and merge 2,
            interaction 4, joint fit 32).
        model_errors: whether the model holds model errors, for row gains and the test of touches.
            They cost time, and prevent false touches on skins unlike the model.
        second_pass: the image is solved again with the interaction of touches removed from the
            data. It cannot be set over a board's link.
        samples: samples per measurement, at 1 MS/s; white noise falls with their square root.
        scan: "full" measures every row; "reciprocal" measures one of each reciprocal pair, in half
            the time with sqrt(2) of the noise.
    """

    name: str
    rank: int = parameter(64, low=1, high=1024)
    pixels: int = parameter(32, low=4, high=128)
    storage: str = parameter("f32", choices=STORAGES)
    regularisation: float = parameter(DEFAULT_REGULARISATION, low=0, high=1e6)
    column_power: float = parameter(DEFAULT_COLUMN_POWER, low=0, high=1)
    solver: str = parameter(Defaults.solver, choices=SOLVERS)
    iterations: int = parameter(Defaults.iterations, low=1, high=100_000)
    gap: float = parameter(0.0, low=0, high=1)
    mac_limit: int = parameter(0, low=0, high=2**62)
    lambda_rel: float = parameter(Defaults.lambda_rel, low=0, high=1)
    lambda_noise_factor: float = parameter(Defaults.lambda_noise_factor, low=0, high=1000)
    warm_start: bool = False
    touch_sweeps: int = parameter(6, low=0, high=1000)
    samples: int = parameter(BASE_SAMPLES, low=PERIOD_SAMPLES, high=1020)
    scan: str = parameter("full", choices=SCANS)
    second_pass: bool = False
    touch_fit: int = parameter(ALL_TOUCH_FIT, low=0, high=ALL_TOUCH_FIT)
    model_errors: bool = True

    def as_dict(self) -> dict[str, Any]:
        """Return the settings as JSON values."""
        return asdict(self)

    @property
    def model_settings(self) -> tuple[int, int, str, float, float, bool]:
        """The settings that a model is built with: pixels, rank, storage, regularisation, column
        power, and whether it has model errors."""
        return (
            self.pixels,
            self.rank,
            self.storage,
            self.regularisation,
            self.column_power,
            self.model_errors,
        )

    @property
    def solver_settings(self) -> dict[str, Any]:
        """The settings of the solver, by the names of ``core.results.Options``."""
        settings = {
            "solver": self.solver,
            "iterations": self.iterations,
            "gap_rel": self.gap,
            "lambda_rel": self.lambda_rel,
            "lambda_noise_factor": self.lambda_noise_factor,
            "warm_start": self.warm_start,
            "touch_sweeps": self.touch_sweeps,
            "touch_fit": self.touch_fit,
        }
        settings |= {"second_pass": True} if self.second_pass else {}
        return settings | ({"mac_limit": self.mac_limit} if self.mac_limit else {})

    @property
    def held(self) -> int:
        """The number of frames that touches are held before they are scored."""
        return HELD_FRAMES if self.warm_start else 1


def configuration_from(table: Mapping[str, Any], where: str) -> Configuration:
    """Return the configuration in a TOML table or a results file; missing keys take their defaults.

    Raises:
        ConfigError: a key is unknown, wrong or out of range, or there is no name.
    """
    name = table.get("name")
    if not isinstance(name, str) or not name.strip() or "," in name:
        raise ConfigError(
            f"{where}: the key 'name' is required: a word or two without commas, for tables and"
            " pictures"
        )
    where = f"{where} {name!r}"
    one: Configuration = from_table(Configuration, table, where)
    if one.samples % PERIOD_SAMPLES:
        raise ConfigError(
            f"{where}: samples = {one.samples} is not a whole number of excitation periods; use"
            f" a multiple of {PERIOD_SAMPLES}"
        )
    return one


def build_settings(
    one: Configuration, skin: Skin, mask_threshold: float | None = None
) -> BuildSettings:
    """Return how the model of a configuration is built. The solver's settings and the mask
    threshold become defaults of the model, except those that a model does not hold: gap, MAC limit,
    warm start and sweeps."""
    defaults = scaled_defaults(skin, "difference")
    left_out = ALL_TOUCH_FIT & ~one.touch_fit
    defaults = replace(
        defaults,
        solver=one.solver,
        iterations=one.iterations,
        lambda_rel=one.lambda_rel,
        lambda_noise_factor=one.lambda_noise_factor,
        touch_fit_left_out=left_out,
    )
    if mask_threshold is not None:
        defaults = replace(defaults, mask_threshold=mask_threshold)
    return BuildSettings(
        rank=one.rank,
        pixels_across=one.pixels,
        storage=one.storage,
        regularisation=one.regularisation,
        column_power=one.column_power,
        elements=ELEMENTS,
        samples=None if one.model_errors else 0,
        defaults=defaults,
    )
