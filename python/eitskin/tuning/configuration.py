"""A configuration: every choice between a skin and its touches that trades accuracy for cost, as
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
BASE_SAMPLES = 80  # of a measurement, those of which an SNR is said
HELD_FRAMES = 4
ELEMENTS = 3000  # of the mesh that a configuration's model is made on


@dataclass(frozen=True)
class Configuration:
    """One point of the scale. The defaults are those of a model that ``eitskin model build`` makes,
    and of a board's scan.

    Attributes:
        name: what tables and pictures call it.
        rank, pixels, storage, regularisation, column_power: of the model: rows of the reduced
            Jacobian, pixels along the skin's longer side, the type it is stored in, mu and p of the
            reduction (``eitskin.model.reduction``).
        solver, iterations, gap, mac_limit: how the image is found; at most ``iterations``, or until
            the relative duality gap is below ``gap`` (0: never), or at most ``mac_limit``
            multiply-accumulates (0: no limit) where the core has one.
        lambda_rel: least lambda over lambda_max; below what the noise asks for it changes nothing.
        warm_start: each frame begins from the last one's image. Judged at the fourth frame of
            touches that are held, after others were: what a user sees of touches that rest, not of
            those that land.
        touch_sweeps: of the off-grid fit; 0 leaves touches at the image's peaks.
        touch_fit: parts of the search for touches (``core.results``: straight data 1, regrouping 2,
            coupling 4).
        model_errors: whether the model says what it may be wrong by, for row gains and the test of
            touches: these cost, and keep false touches away on skins unlike the model.
        second_pass: the image is solved again with the touches' interplay taken out of the data;
            not over a board's link.
        samples: of a measurement, at 1 MS/s; white noise falls with the root of them.
        scan: "full" measures every row, "reciprocal" one of each reciprocal pair, in half the time
            with sqrt(2) of the noise.
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
    warm_start: bool = False
    touch_sweeps: int = parameter(6, low=0, high=1000)
    samples: int = parameter(BASE_SAMPLES, low=PERIOD_SAMPLES, high=1020)
    scan: str = parameter("full", choices=SCANS)
    second_pass: bool = False
    touch_fit: int = parameter(ALL_TOUCH_FIT, low=0, high=ALL_TOUCH_FIT)
    model_errors: bool = True

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)

    @property
    def model_settings(self) -> tuple[int, int, str, float, float, bool]:
        """What a model is built by: pixels, rank, storage, regularisation, column power, and
        whether it has errors."""
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
        """What the solver is told, by the names of ``core.results.Options``."""
        settings = {
            "solver": self.solver,
            "iterations": self.iterations,
            "gap_rel": self.gap,
            "lambda_rel": self.lambda_rel,
            "warm_start": self.warm_start,
            "touch_sweeps": self.touch_sweeps,
            "touch_fit": self.touch_fit,
        }
        settings |= {"second_pass": True} if self.second_pass else {}
        return settings | ({"mac_limit": self.mac_limit} if self.mac_limit else {})

    @property
    def held(self) -> int:
        """How many frames touches are held before they are judged."""
        return HELD_FRAMES if self.warm_start else 1


def configuration_from(table: Mapping[str, Any], where: str) -> Configuration:
    """A configuration from a TOML table or a results file; what is not there has its default."""
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
            f"{where}: samples = {one.samples} is no whole number of the excitation's periods; use"
            f" a multiple of {PERIOD_SAMPLES}"
        )
    return one


def build_settings(
    one: Configuration, skin: Skin, mask_threshold: float | None = None
) -> BuildSettings:
    """How the model of a configuration is built; its solver's settings and t become the model's
    defaults, as far as a model has them: not the gap, a limit of MACs, the warm start and the
    sweeps."""
    usual = scaled_defaults(skin, "difference")
    left_out = ALL_TOUCH_FIT & ~one.touch_fit
    defaults = replace(
        usual,
        solver=one.solver,
        iterations=one.iterations,
        lambda_rel=one.lambda_rel,
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
