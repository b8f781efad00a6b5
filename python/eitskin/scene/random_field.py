"""A smooth random field over the plane, for properties that vary over a skin.

Its covariance is exp(-d^2 / (2 length^2)). It is a sum of cosines whose wave vectors are normal
with deviation 1 / length (random Fourier features; Rahimi and Recht, NIPS 2007). As a function of
place, it is the same on every mesh.
"""

from math import sqrt

import numpy as np

from eitskin.arrays import FloatArray

COSINES = 256


def random_field(
    places_mm: FloatArray, length_mm: float, generator: np.random.Generator
) -> FloatArray:
    """Return a Gaussian random field of mean 0 and variance 1 at ``places_mm`` (k, 2), (k,)."""
    waves_per_mm = generator.standard_normal((COSINES, 2)) / length_mm
    phases = generator.uniform(0, 2 * np.pi, COSINES)
    return np.asarray(np.cos(places_mm @ waves_per_mm.T + phases).sum(axis=1) * sqrt(2 / COSINES))
