"""Smooth random fields over the plane: how much a sheet differs from one place to the next."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

MODES = 256


class RandomField:
    """A Gaussian random field of mean 0 and standard deviation 1 whose correlation falls with the
    distance d as exp(-d^2 / (2 l^2)), l = ``correlation_mm``.

    It is a sum of 256 plane waves with random directions, lengths and phases (M. Shinozuka and G.
    Deodatis, Appl. Mech. Rev. 44 (1991) 191-204, doi 10.1115/1.3119501), so it depends on the
    generator and the place alone and not on a mesh.
    """

    def __init__(self, generator: np.random.Generator, correlation_mm: float) -> None:
        self._waves_per_mm = generator.standard_normal((2, MODES)) / correlation_mm
        self._phases = generator.uniform(0.0, 2 * np.pi, MODES)

    def at(self, points_mm: FloatArray) -> FloatArray:
        """Its values (k,) at ``points_mm`` (k, 2)."""
        waves = np.cos(points_mm @ self._waves_per_mm + self._phases)
        return np.asarray(waves.sum(axis=1) * np.sqrt(2 / MODES))
