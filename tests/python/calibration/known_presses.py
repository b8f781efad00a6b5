"""Presses whose law and gain are known."""

import numpy as np
import numpy.typing as npt

from eitskin.calibration.presses import WeighedPresses

RADIUS_MM = 97.0
FORCES_N = np.array([0.5, 0.8, 1.0, 1.5, 2.0])


def saturating(force_n: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(-4.0 * np.expm1(-force_n / 1.5))


def places(count: int) -> npt.NDArray[np.float64]:
    """A sunflower's spiral to 85 mm."""
    k = np.arange(count)
    angle, away = 2.39996 * k, 85 * np.sqrt((k + 0.5) / count)
    return np.column_stack([away * np.cos(angle), away * np.sin(angle)])


def gain_of(place_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The factor of a strength at a place: a gain that is tilted and bent over the skin."""
    u, v = place_mm.T / RADIUS_MM
    return np.asarray(1 + 0.1 * u - 0.05 * v + 0.3 * (u**2 + v**2))


def presses(
    count: int = 24, noise: float = 0.01, bent: bool = True, seed: int = 3
) -> WeighedPresses:
    """Every force at each of ``count`` places, with ``noise`` of the strength."""
    place = np.repeat(places(count), len(FORCES_N), axis=0)
    force = np.tile(FORCES_N, count)
    scatter = np.exp(noise * np.random.default_rng(seed).standard_normal(len(force)))
    return WeighedPresses(
        force, saturating(force) * scatter / (gain_of(place) if bent else 1.0), place
    )
