"""A smooth random field over the plane: how much a sheet differs from one place to the next.

It has the covariance exp(-d^2 / (2 length^2)), as a sum of cosines whose wave vectors are normal
with deviation 1 / length (random Fourier features; Rahimi and Recht, NIPS 2007). It is a function
of place, so that another mesh samples the same field.
"""

from math import sqrt

import numpy as np

from eitskin.arrays import FloatArray

COSINES = 256


def random_field(
    places_mm: FloatArray, length_mm: float, generator: np.random.Generator
) -> FloatArray:
    """A Gaussian random field of mean 0 and variance 1 at ``places_mm`` (k, 2): (k,)."""
    waves_per_mm = generator.standard_normal((COSINES, 2)) / length_mm
    phases = generator.uniform(0, 2 * np.pi, COSINES)
    return np.asarray(np.cos(places_mm @ waves_per_mm.T + phases).sum(axis=1) * sqrt(2 / COSINES))
