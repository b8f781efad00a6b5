"""White noise: normal, with the same deviation on every row, independent from row to row and frame
to frame.

It stands for thermal and amplifier noise in the band of the demodulator. The signal-to-noise ratio
refers to the exact frame V0 of the untouched skin with ideal electrodes: SNR_dB = 20 log10(rms(V0)
/ sigma), rms over the rows of the protocol.
"""

from dataclasses import dataclass

import numpy as np

from eitskin.config import parameter
from eitskin.errors import ConfigError
from eitskin.scene.effect import EffectCost, EffectSession, Stage, Voltages, VoltageStep

NAME = "noise"
STAGE = Stage.DIGITISE
ORDER = 20
SUMMARY = "White noise on every row."
DEFAULT_SNR_DB = 60.0


@dataclass(frozen=True)
class Parameters:
    """The size of the noise, as an SNR or as a voltage; 60 dB if neither is given."""

    snr_db: float | None = parameter(
        None, "dB", "20 log10(rms of the untouched frame / noise)", low=-100, high=300
    )
    noise_v: float | None = parameter(None, "V", "standard deviation", low=0, high=1e6)

    def __post_init__(self) -> None:
        if self.snr_db is not None and self.noise_v is not None:
            raise ConfigError("snr_db: give either snr_db or noise_v")


def deviation_v(parameters: Parameters, session: EffectSession) -> float:
    """Return the standard deviation of the noise in V."""
    if parameters.noise_v is not None:
        return parameters.noise_v
    snr_db = DEFAULT_SNR_DB if parameters.snr_db is None else parameters.snr_db
    return session.v0_rms_v() / float(10 ** (snr_db / 20))


def make(parameters: Parameters, session: EffectSession) -> VoltageStep:
    """Return the step that adds a new draw to each frame."""
    sigma_v = deviation_v(parameters, session)

    def apply(v: Voltages, time_s: float, frame: int) -> Voltages:
        return np.asarray(v + sigma_v * session.stream(NAME, frame).standard_normal(len(v)))

    rows = session.protocol.n_rows
    cost = EffectCost(vector_passes_per_frame=2, random_numbers_per_frame=rows)
    return VoltageStep(NAME, STAGE, cost, f"white, sigma {sigma_v:.3g} V", apply)
