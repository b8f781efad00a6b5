"""Read back what a taught model knows: the response of every row to a press anywhere, and the
noise.

With P = U'W / s_1, S = diag(s / s_1) V', W s D = U s V' and the stored R = W'W / s_1^2, the
response is s = R^-1 P' S / D, except for the part beyond the model's rank.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import ModelError
from eitskin.fem.grid import Grid, between_pixels
from eitskin.model.model import Model


@dataclass(frozen=True, eq=False)
class Known:
    """``answer`` (n_pixels, m) in V is the response to a press of amplitude 1 at each pixel of
    ``grid``; ``noise`` (m, m) in V^2 is the covariance of the noise; ``presses`` is the number of
    presses that taught it."""

    grid: Grid
    answer: FloatArray
    noise: FloatArray
    presses: int

    def at(self) -> Callable[[FloatArray], FloatArray]:
        """Return a function that gives the responses (k, m) at places (k, 2)."""
        return between_pixels(self.grid, self.answer)


def known_of(model: Model, where: str) -> Known:
    """Return what ``model`` was taught; ``where`` names it in errors.

    Raises:
        ModelError: the model was not taught.
    """
    if model.precision is None or "teach" not in model.meta:
        raise ModelError(
            f"{where}: this model comes from physics and was not taught; make one with  eitskin"
            " teach fit"
        )
    rows = model.protocol.n_rows
    lower = np.zeros((rows, rows))
    lower[np.tril_indices(rows)] = model.precision
    covariance = np.linalg.inv(lower + np.tril(lower, -1).T)
    s = model.sensitivity
    answer = (covariance @ model.projection.T.astype(np.float64) @ (s / model.column_weight)).T
    s1 = 1 / float(np.linalg.norm(s, axis=0).max())
    presses = int(model.meta["teach"].get("presses", 1))
    noise = np.asarray(covariance / s1**2, dtype=np.float64)
    return Known(model.grid, answer, noise, presses)
