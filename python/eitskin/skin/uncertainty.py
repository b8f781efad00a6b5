"""The table [uncertainty] of a skin's file: how far a real skin may differ from its description.

Lengths are fractions of the skin's radius R, the radius of the disk of equal area.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from math import isfinite
from typing import Any

from eitskin.config import check_keys, flag, integer, number
from eitskin.errors import ConfigError, UsageError

MIN_SAMPLES, MAX_SAMPLES = 2, 100_000
MAX_SEED = 2**63 - 1
Range = tuple[float, float]


@dataclass(frozen=True)
class Uncertainty:
    """The distributions from which random skins and touches are drawn (``model.model_errors``).

    ``electrode_position_sd`` is the standard deviation of electrode positions along the rim, in R.
    ``electrode_width_log_sd`` and ``contact_log_sd`` are those of the logarithms of width and
    contact impedance. ``out_of_round`` deforms the rim by two to four waves, together as strong as
    one wave of this amplitude in R. ``background_log_sd`` is the standard deviation of the
    logarithm of the conductivity, a smooth field with the correlation length ``background_length``
    in R; ``drift_log_sd`` is the same for what changes after the tare.

    Touches are discs of ``touch_radius`` in R and ``touch_contrast``. ``touch_shapes`` is the
    weight of shaped touches, which are up to ``touch_aspect_max`` times as long as wide. If
    ``row_gains`` is set, the tare scales each row to the model. ``samples`` random skins are drawn
    with the seed ``seed``.
    """

    electrode_position_sd: float = 0.01
    electrode_width_log_sd: float = 0.1
    contact_log_sd: float = 0.3
    out_of_round: float = 0.02
    background_log_sd: float = 0.2
    background_length: Range = (0.35, 1.0)
    drift_log_sd: float = 0.02
    touch_radius: Range = (0.06, 0.125)
    touch_contrast: Range = (1.5, 10.0)
    touch_shapes: float = 0.25
    touch_aspect_max: float = 2.2
    row_gains: bool = True
    samples: int = 500
    seed: int = 1

    def __post_init__(self) -> None:
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            ends = value if isinstance(value, tuple) else (value, value)
            if not (all(map(isfinite, ends)) and low <= ends[0] <= ends[1] <= high):
                raise UsageError(
                    f"uncertainty: {name} = {value} is out of range; use {low:g} to {high:g}"
                )


LIMITS: dict[str, Range] = {
    "electrode_position_sd": (0, 0.1),
    "electrode_width_log_sd": (0, 1),
    "contact_log_sd": (0, 3),
    "out_of_round": (0, 0.1),
    "background_log_sd": (0, 1),
    "background_length": (0.1, 10),
    "drift_log_sd": (0, 0.5),
    "touch_radius": (0.01, 0.5),
    "touch_contrast": (0.001, 1000),
    "touch_shapes": (0, 1),
    "touch_aspect_max": (1, 10),
    "samples": (MIN_SAMPLES, MAX_SAMPLES),
    "seed": (0, MAX_SEED),
}


DEFAULT_UNCERTAINTY = Uncertainty()


def uncertainty_from_table(value: object, where: str) -> Uncertainty | None:
    """Return the value of ``uncertainty`` in a skin's file: a table gives its values, None gives
    the defaults, and "none" gives None."""
    if value is None:
        return DEFAULT_UNCERTAINTY
    if value == "none":
        return None
    if not isinstance(value, Mapping):
        raise ConfigError(
            f'{where}: uncertainty must be a table [uncertainty], or "none", not {value!r}'
        )
    place, known = f"{where} [uncertainty]", {f.name: f.default for f in fields(Uncertainty)}
    check_keys(value, known, place)
    return Uncertainty(**{name: _value(value, name, known[name], place) for name in value})


def uncertainty_to_table(uncertainty: Uncertainty | None) -> object:
    """Return the value from which ``uncertainty_from_table`` makes an equal one."""
    if uncertainty is None:
        return "none"
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(uncertainty).items()
    }


def _value(table: Mapping[str, Any], name: str, default: Any, where: str) -> Any:
    if isinstance(default, bool):
        return flag(table, name, None, where)
    given, (low, high) = table[name], LIMITS[name]
    if isinstance(default, tuple):
        if not isinstance(given, list) or len(given) != 2:
            raise ConfigError(f"{where}: {name} must be [least, greatest], not {given!r}")
        ends = [number({name: end}, name, None, where, low=low, high=high) for end in given]
        if ends[0] > ends[1]:
            raise ConfigError(f"{where}: {name} = {given!r} must have the least first")
        return (ends[0], ends[1])
    if isinstance(default, int):
        return integer(table, name, default, where, low=int(low), high=int(high))
    return number(table, name, default, where, low=low, high=high)
