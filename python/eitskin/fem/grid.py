"""The image grid: square pixels over the bounding box of the outline. Pixels whose centre lies
inside the outline are kept."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil, sqrt

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.skin.outline import Outline

MAX_PIXELS_ACROSS = 512
WIDTHS_ACROSS = 4.5
FULL = 1.5  # pixels of a narrow skin, per square of pixels_across; a disk has 0.79


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of nx by ny square pixels. The n kept pixels are ordered row by row from the lowest y,
    and within a row from the lowest x.

    ``origin_mm`` is the lower-left corner (x, y); ``index`` (n, 2) int64 holds each kept pixel's
    (ix, iy).
    """

    nx: int
    ny: int
    pixel_mm: float
    origin_mm: tuple[float, float]
    index: IntArray

    @property
    def n_pixels(self) -> int:
        """The number of kept pixels, n."""
        return len(self.index)

    @property
    def pixel_area_mm2(self) -> float:
        return self.pixel_mm**2

    @cached_property
    def number(self) -> IntArray:
        """The number of each cell among the kept pixels, (ny, nx); -1 for cells that are not
        kept."""
        place = np.full((self.ny, self.nx), -1, dtype=np.int64)
        place[self.index[:, 1], self.index[:, 0]] = np.arange(self.n_pixels)
        place.flags.writeable = False
        return place

    def centres_mm(self) -> FloatArray:
        """Return the centres of the kept pixels, (n, 2)."""
        return np.asarray(np.asarray(self.origin_mm) + (self.index + 0.5) * self.pixel_mm)

    def image(self, values: npt.ArrayLike) -> FloatArray:
        """Return ``values`` (n,) as an image (ny, nx). Row 0 has the lowest y; cells that are not
        kept are nan."""
        flat = np.asarray(values, dtype=np.float64)
        if flat.shape != (self.n_pixels,):
            raise UsageError(
                f"grid: values of shape {flat.shape} for {self.n_pixels} pixels; give one value per"
                " pixel"
            )
        picture = np.full((self.ny, self.nx), np.nan)
        picture[self.index[:, 1], self.index[:, 0]] = flat
        return picture

    def values(self, image: npt.ArrayLike) -> FloatArray:
        """Return the kept pixels of ``image`` (ny, nx), (n,): the inverse of the method
        ``image``."""
        picture = np.asarray(image, dtype=np.float64)
        if picture.shape != (self.ny, self.nx):
            raise UsageError(
                f"grid: an image of shape {picture.shape} on a grid of {(self.ny, self.nx)}"
            )
        return picture[self.index[:, 1], self.index[:, 0]]

    def locate(self, points_mm: npt.ArrayLike) -> IntArray:
        """Return the number of the kept pixel in which each of ``points_mm`` (k, 2) lies, (k,); -1
        if in none."""
        points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
        cell = np.floor((points - self.origin_mm) / self.pixel_mm)
        known = (cell >= 0).all(axis=1) & (cell[:, 0] < self.nx) & (cell[:, 1] < self.ny)
        ix, iy = np.where(known[:, None], cell, 0).astype(np.int64).T
        return np.asarray(np.where(known, self.number[iy, ix], -1))


def grid_for(outline: Outline, pixels_across: int = 32) -> Grid:
    """Return the grid with ``pixels_across`` pixels along the longer side of the bounding box,
    centred on the shorter side.

    A skin whose width, 2 area / perimeter, is small beside that side gets pixels as if
    the side were WIDTHS_ACROSS widths, but at most FULL pixels per square of ``pixels_across``.

    Raises:
        UsageError: ``pixels_across`` is out of range.
    """
    if not 4 <= pixels_across <= MAX_PIXELS_ACROSS:
        raise UsageError(
            f"grid: {pixels_across} pixels across is out of range; use 4 to {MAX_PIXELS_ACROSS}"
        )
    x0, y0, x1, y1 = outline.bounding_box_mm
    width_mm = 2 * outline.area_mm2 / outline.perimeter_mm
    narrow_mm = max(WIDTHS_ACROSS * width_mm, sqrt(outline.area_mm2 / FULL))
    pixel_mm = min(max(x1 - x0, y1 - y0), narrow_mm) / pixels_across
    nx, ny = (max(1, ceil(side / pixel_mm - 1e-9)) for side in (x1 - x0, y1 - y0))
    origin_mm = ((x0 + x1 - nx * pixel_mm) / 2, (y0 + y1 - ny * pixel_mm) / 2)
    iy, ix = np.divmod(np.arange(nx * ny), nx)
    index = np.column_stack([ix, iy])
    kept = outline.contains(np.asarray(origin_mm) + (index + 0.5) * pixel_mm)
    return Grid(nx, ny, pixel_mm, origin_mm, np.ascontiguousarray(index[kept], dtype=np.int64))


def between_pixels(grid: Grid, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a function that interpolates ``values`` (n_pixels, ...) linearly between the centres
    of the kept pixels, and gives (k, ...) at places (k, 2) in mm. Outside the outline it uses the
    nearest pixel."""
    from scipy.ndimage import distance_transform_edt

    whole = np.zeros((grid.ny, grid.nx, *values.shape[1:]))
    whole[grid.index[:, 1], grid.index[:, 0]] = values
    near = distance_transform_edt(grid.number < 0, return_distances=False, return_indices=True)
    whole = whole[tuple(near)]
    size = np.array([grid.nx, grid.ny])
    axes = (slice(None), *(None,) * (values.ndim - 1))

    def at(place_mm: FloatArray) -> FloatArray:
        cell = np.clip((place_mm - grid.origin_mm) / grid.pixel_mm - 0.5, 0, size - 1.001)
        low = cell.astype(int)
        (i, j), (u, v) = low.T, (cell - low).T
        u, v = u[axes], v[axes]
        return np.asarray(
            (1 - v) * ((1 - u) * whole[j, i] + u * whole[j, i + 1])
            + v * ((1 - u) * whole[j + 1, i] + u * whole[j + 1, i + 1])
        )

    return at
