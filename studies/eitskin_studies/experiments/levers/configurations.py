"""The configurations that are compared: ways of searching for touches, and ways of making the
image."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from eitskin.core.options_table import ALL_TOUCH_FIT, INTERACTION, LOG_DATA, SPLIT_MERGE
from eitskin.model.build import BuildSettings


@dataclass(frozen=True)
class Ablation:
    """The core with a model of ``settings`` and with ``options``."""

    name: str
    settings: BuildSettings = field(default_factory=BuildSettings)
    options: Mapping[str, Any] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """All that a result depends on."""
        return {"settings": repr(self.settings), "options": repr(sorted(self.options.items()))}


def _searching(name: str, bits: int, **options: Any) -> Ablation:
    return Ablation(name, options={"touch_fit": bits, **options})


SEARCHES = (
    _searching("peaks alone", 0),
    _searching("log data first", LOG_DATA),
    _searching("interaction", INTERACTION),
    _searching("log data, split and merge", LOG_DATA | SPLIT_MERGE),
    _searching("log data, interaction", LOG_DATA | INTERACTION),
    _searching("split and merge, interaction", SPLIT_MERGE | INTERACTION),
    _searching("all (the default)", ALL_TOUCH_FIT),
    _searching("all, 12 sweeps", ALL_TOUCH_FIT, touch_sweeps=12),
    Ablation("log-ratio model", BuildSettings(data_kind="log-ratio")),
)

CALM = {"iterations": 120, "lambda_rel": 0.01}
GOOD = {"lambda_rel": 0.01}
FINE = {"iterations": 90, "lambda_rel": 0.005}
BEST = BuildSettings(rank=80, pixels_across=40, regularisation=0.05)
LONG = {"iterations": 150, "lambda_rel": 0.003}

IMAGES = (
    Ablation("standard"),
    Ablation("standard, refined", options={"second_pass": True}),
    Ablation("good", options=GOOD),
    Ablation("good, refined", options={**GOOD, "second_pass": True}),
    Ablation("fine", options=FINE),
    Ablation("fine, refined", options={**FINE, "second_pass": True}),
    Ablation("calm", BuildSettings(regularisation=0.1), CALM),
    Ablation("calm, refined", BuildSettings(regularisation=0.1), {**CALM, "second_pass": True}),
    Ablation("best", BEST, LONG),
    Ablation("best, refined", BEST, {**LONG, "second_pass": True}),
    Ablation("log-ratio", BuildSettings(data_kind="log-ratio")),
    Ablation("log-ratio, fine", BuildSettings(data_kind="log-ratio"), FINE),
)
