"""The numpy reference of csrc/src/frame/places.c: what the reference tells of places."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.fem.grid import Grid
from eitskin.model.model_errors import ModelErrors
from eitskin_reference.constants_table import MAX_SHIFT

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TarePlaces:
    """``moved_mm2``: how unlike the model, in what moves touches, the skin is; ``shift_mm`` (2, t):
    the polynomials that take places back to where touches lie, None where they stay."""

    grid: Grid
    moved_mm2: float
    shift_mm: FloatArray | None = None

    def on_skin(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Where a touch lies that the modelled skin has there."""
        if self.shift_mm is None:
            return x_mm, y_mm
        pixel, terms = self.grid.pixel_mm, self.shift_mm.shape[1]
        half = np.array([self.grid.nx, self.grid.ny]) * pixel / 2
        x, y = (np.array([x_mm, y_mm]) - self.grid.origin_mm - half) / half.max()
        power = np.array([x ** (n - j) * y**j for n in range(terms) for j in range(n + 1)])
        reach = MAX_SHIFT * pixel
        dx, dy = np.clip(self.shift_mm @ power[:terms], -reach, reach)
        return x_mm + float(dx), y_mm + float(dy)


def tare_places(
    grid: Grid, errors: ModelErrors, log_gains: FloatArray, corrects: bool
) -> TarePlaces | None:
    """Of a reference whose folds have ``log_gains`` (k,), NaN for one without; ``corrects``: row
    gains are in force. None: the model does not tell."""
    if errors.places is None:
        return None
    told = errors.places.astype(np.float64) @ np.nan_to_num(log_gains)
    shift = errors.moves @ told if corrects and errors.moves is not None else None
    return TarePlaces(grid, float(told @ told), shift)
