"""The SNR of every study: 20 log10(rms(V0) / sigma), of measurements of 80 samples."""

import math

import numpy as np
import numpy.typing as npt

from eitskin.tuning.configuration import BASE_SAMPLES

FINE_CONVERTER_DB, FINE_BITS = 70.0, 16  # from there on the steps of 12 bits would be the noise


def noise_deviation_v(
    untouched_v: npt.ArrayLike, snr_db: float, samples: int = BASE_SAMPLES
) -> float:
    """Sigma in V of white noise at ``snr_db``, with V0 = ``untouched_v`` (m,) the untouched skin's
    frame, rms over its rows; it falls with the root of the samples."""
    return (
        float(np.sqrt(np.mean(np.square(untouched_v))))
        * 10 ** (-snr_db / 20)
        * math.sqrt(BASE_SAMPLES / samples)
    )
