"""The numpy reference of csrc/src/frame/places.c: what the reference tells of places."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.fem.grid import Grid
from eitskin.model.model_errors import ModelErrors
from eitskin_reference.constants_table import MAX_SHIFT, ROW_SPREAD


@dataclass(frozen=True, eq=False)
class Corrected:
    """``left_mm2``: what the variance of a place grows by; ``shift_mm`` (2, t): the polynomials
    that take places back to where touches lie; ``trust``: how much of it, 0 to 1."""

    grid: Grid
    left_mm2: float
    shift_mm: FloatArray
    trust: float

    def on_skin(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Where a touch lies that the modelled skin has there."""
        pixel, terms = self.grid.pixel_mm, self.shift_mm.shape[1]
        half = np.array([self.grid.nx, self.grid.ny]) * pixel / 2
        x, y = (np.array([x_mm, y_mm]) - self.grid.origin_mm - half) / half.max()
        power = np.array([x ** (n - j) * y**j for n in range(terms) for j in range(n + 1)])
        reach = MAX_SHIFT * pixel
        dx, dy = np.clip(self.shift_mm @ power[:terms], -reach, reach)
        return x_mm + float(dx), y_mm + float(dy)


def corrected(grid: Grid, errors: ModelErrors, log_gains: FloatArray) -> Corrected | None:
    """Of a reference whose folds have ``log_gains`` (k,), NaN for one without. None: the model does
    not tell."""
    if errors.places is None:
        return None
    known = np.nan_to_num(log_gains)
    left = errors.places.left.astype(np.float64) @ known
    shift = errors.places.moves @ (errors.places.seen.astype(np.float64) @ known)
    outside = errors.places.rest.astype(np.float64) @ known
    limit = ROW_SPREAD**2 * len(outside)
    trust = (limit / (limit + float(outside @ outside))) ** 2 if len(outside) else 1.0
    return Corrected(grid, float(left @ left), trust * shift, trust)
