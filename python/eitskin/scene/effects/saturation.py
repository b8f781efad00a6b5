"""Saturation: an amplifier cannot exceed its supply, so larger voltages are clipped.

It is a hard limiter, symmetric about 0. The limit is given in V or as a multiple of the largest
voltage of the untouched skin with ideal electrodes. The characteristic is the same for every row
and has no memory, so equal rows stay equal.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "saturation"
STAGE = Stage.DIGITISE
ORDER = 30
SUMMARY = "Voltages beyond a limit are clipped."


@dataclass(frozen=True)
class Parameters:
    """The limit as a voltage or as a headroom (default 1.25)."""

    limit_v: float | None = parameter(
        None, "V", "greatest magnitude of a voltage", low=0, open_low=True
    )
    headroom: float | None = parameter(
        None, "1", "limit / largest untouched voltage", low=0, high=1e6, open_low=True
    )

    def __post_init__(self) -> None:
        if self.limit_v is not None and self.headroom is not None:
            raise ConfigError("limit_v: give either limit_v or headroom")


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that clips every row."""
    limit = session.limit_v(parameters.limit_v, parameters.headroom)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(np.clip(v, -limit, limit))

    return VoltageStep(
        NAME, STAGE, EffectCost(vector_passes_per_frame=1), f"clipped at +-{limit:.3g} V", apply
    )
