"""What a taught model knows, read back from its file: the answer of every row to a press anywhere,
and the noise. P = U'W / s_1 and S = diag(s / s_1) V' of W s D = U s V' with R = W'W / s_1^2 stored
give s = R^-1 P' S / D up to what lies beyond the model's rank."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import ModelError
from eitskin.fem.grid import Grid, between_pixels
from eitskin.model.model import Model


@dataclass(frozen=True, eq=False)
class Known:
    """``answer`` (n_pixels, m) V of a press of amplitude 1 at each pixel of ``grid``; ``noise``
    (m, m) V^2, its covariance; ``presses``: how many taught it."""

    grid: Grid
    answer: FloatArray
    noise: FloatArray
    presses: int

    def at(self) -> Callable[[FloatArray], FloatArray]:
        """The answer (k, m) at places (k, 2)."""
        return between_pixels(self.grid, self.answer)


def known_of(model: Model, where: str) -> Known:
    """What ``model`` was taught; ``where`` names it in errors."""
    if model.precision is None or "teach" not in model.meta:
        raise ModelError(
            f"{where}: a model from physics, which no press has taught; make one with  eitskin"
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
