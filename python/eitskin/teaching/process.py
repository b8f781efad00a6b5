"""The responses of all rows to a press anywhere, learned from presses: Gaussian processes with one
kernel, solved together.

y_c = a o s_c(places) + noise of variance lambda, where a are the amplitudes of the presses and each
row is over its own rms. The prior mean of s_c is 0, or, with ``about_own``, the feature of its own
row. A = a a' o K + lambda I is factored once; the own-row term of each row has rank one (Sherman
and Morrison). Leaving a press out costs nothing more: its residual is A^-1 (y - a o mean) /
diag(A^-1).
"""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.teaching.kernel import Kernel


@dataclass(frozen=True, eq=False)
class Process:
    """The processes after n presses. ``weight`` is A_c^-1 y_c (n, m), ``own_solved`` is A^-1 (a o
    j_c) sqrt(g) (n, m) with the denominators ``own_gain`` (m,), and ``inverse`` is A^-1 (n, n)."""

    kernel: Kernel
    place_mm: FloatArray
    amplitude: FloatArray
    data: FloatArray
    j: FloatArray
    common_unit: float
    own_unit: FloatArray
    inverse: FloatArray
    own_solved: FloatArray
    own_gain: FloatArray
    weight: FloatArray
    log_likelihood: float
    about_own: bool = False

    def mean(self, q_mm: FloatArray) -> FloatArray:
        """Return s (k, m) for a press of amplitude 1 at each of ``q_mm`` (k, 2)."""
        jq = self.kernel.features(q_mm)
        shared, own = self._at(q_mm, jq)
        total = (self.amplitude[:, None] * self._own_data() * self.weight).sum(axis=0)
        expected = jq if self.about_own else 0.0
        return np.asarray(expected + shared @ self.weight + own * total)

    def left_out(self) -> FloatArray:
        """Return the residual (n, m) of each press when the others are known."""
        diagonal = np.diag(self.inverse)[:, None] - self.own_solved**2 / self.own_gain
        return np.asarray(self.weight / diagonal)

    def corrections(self, q_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return h (k, n), v (n, m), w (k, m). Without press i, the mean at q is smaller by (h[q,
        i] + v[i] w[q]) times its left-out residual."""
        jq = self.kernel.features(q_mm)
        shared, own = self._at(q_mm, jq)
        return (
            np.asarray(shared @ self.inverse),
            self.own_solved / self.own_gain,
            np.asarray(own - shared @ self.own_solved),
        )

    def _own_data(self) -> FloatArray:
        """Return sqrt(g) j_c of the presses, in units."""
        if self.kernel.sensitivity is None:
            return np.zeros((len(self.place_mm), self.data.shape[1]))
        return np.asarray(np.sqrt(self.kernel.own) * self.j / self.own_unit)

    def _at(self, q_mm: FloatArray, jq: FloatArray) -> tuple[FloatArray, FloatArray]:
        shared = self.kernel.common(q_mm, self.place_mm, jq, self.j) / self.common_unit
        own = (
            np.zeros((len(q_mm), self.data.shape[1]))
            if self.kernel.sensitivity is None
            else np.sqrt(self.kernel.own) * jq / self.own_unit
        )
        return shared * self.amplitude, own


def condition(
    kernel: Kernel,
    place_mm: FloatArray,
    amplitude: FloatArray,
    data: FloatArray,
    about_own: bool = False,
) -> Process:
    """Return the processes after presses at ``place_mm`` (n, 2) of ``amplitude`` (n,) with ``data``
    (n, m), with the own-row feature or 0 as prior mean."""
    from scipy.linalg import cho_factor, cho_solve

    count = len(place_mm)
    j = kernel.features(place_mm)
    common = kernel.common(place_mm, place_mm, j, j)
    common_unit = float(np.mean(np.diag(common)))
    own_unit = np.sqrt(np.mean(j**2, axis=0)) if j.shape[1] else np.ones(data.shape[1])
    covariance = np.outer(amplitude, amplitude) * common / common_unit
    covariance[np.diag_indices(count)] += kernel.noise * (1 + kernel.own)
    factor = cho_factor(covariance, lower=True)
    inverse = cho_solve(factor, np.eye(count))
    own = (
        np.sqrt(kernel.own) * amplitude[:, None] * j / own_unit
        if j.shape[1]
        else np.zeros_like(data)
    )
    own_solved = inverse @ own
    own_gain = 1 + np.sum(own * own_solved, axis=0)
    new = data - amplitude[:, None] * j if about_own else data
    solved = inverse @ new
    weight = solved - own_solved * (np.sum(own * solved, axis=0) / own_gain)
    fit = np.maximum(np.sum(new * weight, axis=0), 1e-300)
    log_determinant = 2 * np.log(np.diag(factor[0])).sum()
    likelihood = -0.5 * float(
        (count * np.log(fit / count) + np.log(own_gain)).sum() + data.shape[1] * (log_determinant)
    )
    return Process(
        kernel, place_mm, amplitude, data, j, common_unit, own_unit, inverse, own_solved, own_gain,
        weight, likelihood, about_own,
    )  # fmt: skip
