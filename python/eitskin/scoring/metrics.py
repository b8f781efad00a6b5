"""Score how well an image shows where the touches are: MIoU on a fine raster, as a curve over the
threshold.

The exact rule, with every choice that changes the score, is in docs/reference/metrics.md. In short,
MIoU = (IoU(background) + IoU(touch)) / 2 over the cells of a fine raster inside the skin. A cell of
the image is a touch if x > t max(x). The fraction t is chosen once per method, on training scenes,
and then kept. A cell takes the value of the nearest pixel, or is interpolated between pixels; this
choice changes every score, so it is always named.

Nothing here depends on a reconstruction method or a mesh: images are given as (frames, pixels), the
truth as discs or as a mask.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.fem.grid import Grid
from eitskin.skin.outline import Outline

RASTER_MM = 1.5
LOOKUPS = ("nearest", "bilinear")
LOOKUP = "bilinear"
DRAWN_THRESHOLD = 0.48  # t of the image that is drawn of touches: where half of a pixel is covered


@dataclass(frozen=True, eq=False)
class Raster:
    """The cells on which masks are compared: squares of ``spacing_mm`` with the centres
    ``points_mm`` (p, 2), all inside the skin."""

    points_mm: FloatArray
    spacing_mm: float


def raster_inside(outline: Outline, spacing_mm: float = RASTER_MM) -> Raster:
    """Return the square cells of ``spacing_mm`` over the bounding box whose centres are inside
    ``outline``.

    Raises:
        UsageError: the spacing is not above 0, or no cell is inside.
    """
    if not spacing_mm > 0:
        raise UsageError(f"raster spacing {spacing_mm!r} mm must be above 0; 1.5 is usual")
    x0, y0, x1, y1 = outline.bounding_box_mm
    x = np.arange(x0 + spacing_mm / 2, x1, spacing_mm)
    y = np.arange(y0 + spacing_mm / 2, y1, spacing_mm)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    kept = points[outline.contains(points)] if len(points) else points
    if not len(kept):
        raise UsageError(
            f"a raster of {spacing_mm:g} mm has no cell inside this skin; use a finer one"
        )
    return Raster(kept, spacing_mm)


def disc_mask(
    points_mm: FloatArray, centres_mm: npt.ArrayLike, radii_mm: npt.ArrayLike
) -> BoolArray:
    """Return a mask (p,) of the ``points_mm`` (p, 2) that lie in any disc. The discs have centres
    (k, 2) and radii (k,); k may be 0."""
    centres = np.asarray(centres_mm, dtype=np.float64).reshape(-1, 2)
    radii = np.broadcast_to(np.asarray(radii_mm, dtype=np.float64), (len(centres),))
    inside = np.zeros(len(points_mm), dtype=np.bool_)
    along_x, along_y = np.ascontiguousarray(points_mm.T)
    for (x, y), radius in zip(centres, radii, strict=True):
        inside |= (along_x - x) ** 2 + (along_y - y) ** 2 <= radius**2
    return inside


def pixel_cover(
    grid: Grid, centres_mm: npt.ArrayLike, radii_mm: npt.ArrayLike, samples: int = 16
) -> FloatArray:
    """Return the fraction (n,) of each pixel that discs cover, from ``samples`` squared points per
    pixel.

    It is the perfect image of these discs: its MIoU is the best that the pixels allow.
    """
    steps = ((np.arange(samples) + 0.5) / samples - 0.5) * grid.pixel_mm
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    points = (grid.centres_mm()[:, None, :] + offsets[None]).reshape(-1, 2)
    return np.asarray(
        disc_mask(points, centres_mm, radii_mm).reshape(grid.n_pixels, -1).mean(axis=1)
    )


def mask_on_points(
    points_mm: FloatArray, mask: npt.ArrayLike, box_mm: tuple[float, float, float, float]
) -> BoolArray:
    """Return the values (p,) of a truth mask at points (p, 2).

    The mask (ny, nx), with the lowest row first, covers ``box_mm`` (xmin, ymin, xmax, ymax); points
    outside the box are background.
    """
    cells = np.asarray(mask, dtype=np.bool_)
    ny, nx = cells.shape
    x0, y0, x1, y1 = box_mm
    ix = np.floor((points_mm[:, 0] - x0) / (x1 - x0) * nx).astype(np.int64)
    iy = np.floor((points_mm[:, 1] - y0) / (y1 - y0) * ny).astype(np.int64)
    inside = (ix >= 0) & (ix < nx) & (iy >= 0) & (iy < ny)
    found = np.zeros(len(points_mm), dtype=np.bool_)
    found[inside] = cells[iy[inside], ix[inside]]
    return found


@dataclass(frozen=True, eq=False)
class Lookup:
    """The weights by which cells take values from an image: the value of cell i is sum_j weight[i,
    j] x[pixel[i, j]].

    ``pixel`` (p, c) are indices of kept pixels, with c = 1 for "nearest" and c = 4 for "bilinear".
    Each row of ``weight`` (p, c) sums to 1.
    """

    pixel: IntArray
    weight: FloatArray

    def show(self, values: npt.ArrayLike) -> FloatArray:
        """Return the values of the cells (..., p) for pixel values (..., n)."""
        return np.asarray(
            (np.asarray(values, dtype=np.float64)[..., self.pixel] * self.weight).sum(axis=-1)
        )


def lookup_for(points_mm: FloatArray, grid: Grid, kind: str = LOOKUP) -> Lookup:
    """Return the lookup from cells at ``points_mm`` (p, 2) to the kept pixels of ``grid``.

    "nearest" takes the nearest kept pixel. "bilinear" weights the up to four kept pixels whose
    centres surround the cell, and takes the nearest pixel if none of them is kept.

    Raises:
        UsageError: ``kind`` is neither of these.
    """
    nearest = _nearest_pixels(points_mm, grid)
    if kind == "nearest":
        return Lookup(nearest[:, None], np.ones((len(points_mm), 1)))
    if kind != "bilinear":
        raise UsageError(f"lookup {kind!r} is unknown; use one of {', '.join(LOOKUPS)}")
    place = (points_mm - np.asarray(grid.origin_mm)) / grid.pixel_mm - 0.5
    low = np.floor(place).astype(np.int64)
    part = place - low
    framed = np.pad(grid.number, 2, constant_values=-1)
    pixel, weight = [], []
    for right, up in ((0, 0), (1, 0), (0, 1), (1, 1)):
        ix, iy = (
            np.clip(low[:, k] + step + 2, 0, framed.shape[1 - k] - 1)
            for k, step in ((0, right), (1, up))
        )
        pixel.append(framed[iy, ix])
        weight.append(
            (part[:, 0] if right else 1 - part[:, 0]) * (part[:, 1] if up else 1 - part[:, 1])
        )
    pixels, weights = np.stack(pixel, axis=1), np.stack(weight, axis=1)
    weights[pixels < 0] = 0.0
    total = weights.sum(axis=1, keepdims=True)
    alone = total[:, 0] <= 1e-12
    weights = np.where(
        alone[:, None],
        np.array([1.0, 0.0, 0.0, 0.0]),
        weights / np.where(total > 1e-12, total, 1.0),
    )
    return Lookup(np.where((pixels < 0) | alone[:, None], nearest[:, None], pixels), weights)


def _nearest_pixels(points_mm: FloatArray, grid: Grid) -> IntArray:
    """Return the index of the nearest kept pixel for each point (p, 2), as (p,).

    This is usually the pixel around the point. If that pixel is not kept, or the point lies on its
    edge, the distances to all pixels are compared.
    """
    place = (points_mm - np.asarray(grid.origin_mm)) / grid.pixel_mm
    on_edge = (np.abs(place - np.rint(place)) < 1e-6).any(axis=1)
    found = np.where(on_edge, -1, grid.locate(points_mm))
    (others,) = np.nonzero(found < 0)
    centres_mm = grid.centres_mm()
    for start in range(0, len(others), 2048):
        block = others[start : start + 2048]
        dx, dy = (points_mm[block, None] - centres_mm).transpose(2, 0, 1)
        found[block] = np.argmin(dx**2 + dy**2, axis=1)
    return found


def touch_mask(values: npt.ArrayLike, threshold: npt.ArrayLike, sign: int = 1) -> BoolArray:
    """Return the mask x > t max(x) along the last axis, or -x > t max(-x) if ``sign`` is -1
    (resistive changes).

    ``threshold`` is one number, or an array that broadcasts against ``values``: (T, 1) gives T
    masks of one image. An image without any value of the wanted sign has an empty mask.
    """
    wanted = sign * np.asarray(values, dtype=np.float64)
    top = wanted.max(axis=-1, keepdims=True)
    return np.asarray((wanted > threshold * top) & (top > 0))


def iou(estimate: BoolArray, truth: BoolArray) -> float:
    """Return |both| / |either| of two masks of the same shape, or 1 if both are empty, as they then
    agree."""
    either = np.count_nonzero(estimate | truth)
    return float(np.count_nonzero(estimate & truth) / either) if either else 1.0


def miou(estimate: BoolArray, truth: BoolArray) -> float:
    """Return the mean of IoU(touch) and IoU(background) of two masks of the same shape."""
    return (iou(estimate, truth) + iou(~estimate, ~truth)) / 2


@dataclass(frozen=True, eq=False)
class ImageScorer:
    """The raster and lookup that the MIoU of images with ``n_pixels`` needs."""

    raster: Raster
    lookup: Lookup
    n_pixels: int


def judge_for(
    outline: Outline, grid: Grid, spacing_mm: float = RASTER_MM, lookup: str = LOOKUP
) -> ImageScorer:
    """Return the scorer for images on ``grid`` of a skin with this outline."""
    raster = raster_inside(outline, spacing_mm)
    return ImageScorer(raster, lookup_for(raster.points_mm, grid, lookup), grid.n_pixels)
