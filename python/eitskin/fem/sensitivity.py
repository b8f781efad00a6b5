"""The sensitivity of boundary voltages to the conductivity of each pixel, by the adjoint method on
the pixel grid.

For a drive field u and a measuring field w, both per ampere, dV / dsigma_pixel = -I t int_pixel
grad u . grad w (Geselowitz, IEEE Trans. Biomed. Eng. 18, 1971). Each field is solved only once; a
pixel then takes one small product of gradients.
"""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import missing_extra
from eitskin.fem.cem import ForwardModel, Solution
from eitskin.fem.grid import Grid
from eitskin.fem.mesh import Mesh
from eitskin.fem.patterns import Patterns

try:
    from scipy.sparse import csc_matrix, csr_matrix, identity
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error


PIXELS_AT_ONCE = 64  # the gradients and products of a block stay in the cache


def element_to_pixel(mesh: Mesh, grid: Grid) -> csr_matrix:
    """Return the fraction of each element's area that lies in each pixel, (E, n), exact to
    rounding; rows sum to at most 1."""
    elements, pixels = _candidates(mesh, grid)
    alone = np.bincount(elements)[elements] == 1
    elements, pixels, alone = (values[pixels >= 0] for values in (elements, pixels, alone))
    share = np.ones(len(elements))
    cut = np.flatnonzero(~alone)
    corners = mesh.triangles.T[:, elements[cut]]
    low = grid.index[pixels[cut]].T * grid.pixel_mm
    x, y = (mesh.nodes_mm[:, axis][corners] - (grid.origin_mm[axis] + low[axis]) for axis in (0, 1))
    share[cut] = _area_in_square(x, y, grid.pixel_mm) / mesh.areas_mm2[elements[cut]]
    kept = share > 1e-12
    indptr = np.concatenate(
        [[0], np.cumsum(np.bincount(elements[kept], minlength=mesh.n_elements))]
    )
    return csr_matrix((share[kept], pixels[kept], indptr), shape=(mesh.n_elements, grid.n_pixels))


def sensitivity(
    forward: ForwardModel,
    conductivity_s_per_m: npt.ArrayLike,
    grid: Grid,
    *,
    rows: npt.ArrayLike | None = None,
    weights: csr_matrix | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the Jacobian (m, n) in V per (S/m) and the voltages (m,) in V at a conductivity, (E,)
    or one number.

    ``rows`` selects rows of the protocol, such as one of each reciprocal pair. ``weights`` is
    ``element_to_pixel`` of the same mesh and grid; pass it if you call this repeatedly.
    """
    if weights is None:
        weights = element_to_pixel(forward.mesh, grid)
    return _sensitivity(forward, conductivity_s_per_m, weights, rows)


def element_sensitivity(
    forward: ForwardModel, conductivity_s_per_m: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the same as ``sensitivity`` with the elements of the mesh as pixels: (m, E) and
    (m,)."""
    each = identity(forward.mesh.n_elements, format="csr")
    return _sensitivity(forward, conductivity_s_per_m, each, None)


def _sensitivity(
    forward: ForwardModel,
    conductivity_s_per_m: npt.ArrayLike,
    weights: csr_matrix,
    rows: npt.ArrayLike | None,
) -> tuple[FloatArray, FloatArray]:
    solution = forward.solve(conductivity_s_per_m)
    chosen = (
        np.arange(forward.protocol.n_rows) if rows is None else np.asarray(rows, dtype=np.int64)
    )
    by_pixel, n_pixels = weights.tocsc(), weights.shape[1]
    by_pixel.data *= forward.mesh.true_areas_mm2[by_pixel.indices] * 1e-6
    fields = element_fields(forward, solution)
    jacobian = np.empty((len(chosen), n_pixels))
    for begin in range(0, n_pixels, PIXELS_AT_ONCE):
        block = slice(begin, min(begin + PIXELS_AT_ONCE, n_pixels))
        jacobian[:, block] = _rows_of_products(
            forward.patterns, _field_products(fields, by_pixel, block), chosen
        )
    sign = (forward.patterns.drive_sign * forward.patterns.measure_sign)[chosen]
    jacobian *= (-forward.protocol.current_a * forward.thickness_m * sign)[:, None]
    return jacobian, forward.voltages_of(solution)[chosen]


def element_fields(forward: ForwardModel, solution: Solution) -> FloatArray:
    """Return the gradient of each pattern's potential on each element in its true shape, (E, 2, P)
    in V/m per A."""
    triangles, gradients = forward.mesh.triangles, forward.gradients_per_m
    fields = gradients[:, 0, :, None] * solution.nodes[triangles[:, 0], None, :]
    for corner in (1, 2):
        fields += gradients[:, corner, :, None] * solution.nodes[triangles[:, corner], None, :]
    return np.asarray(fields)


def _field_products(fields: FloatArray, by_pixel: csc_matrix, block: slice) -> FloatArray:
    """Return the integral of grad u_p . grad u_q over each pixel of ``block`` for all patterns, (b,
    P, P).

    ``by_pixel`` (E, n) holds the area in m2 that each element and pixel share.
    """
    bounds = by_pixel.indptr[block.start : block.stop + 1]
    mine = slice(bounds[0], bounds[-1])
    n_patterns = fields.shape[2]
    plain = fields[by_pixel.indices[mine]]
    weighted = (plain * by_pixel.data[mine, None, None]).reshape(-1, n_patterns)
    plain = plain.reshape(-1, n_patterns)
    products = np.empty((len(bounds) - 1, n_patterns, n_patterns))
    for product, (begin, end) in zip(
        products, pairwise((2 * (bounds - bounds[0])).tolist()), strict=True
    ):
        np.dot(plain[begin:end].T, weighted[begin:end], out=product)
    return products


def _rows_of_products(patterns: Patterns, products: FloatArray, rows: IntArray) -> FloatArray:
    """Select the products (b, P, P) of the protocol's ``rows``, without their signs, (k, b)."""
    drive, measure = patterns.drive[rows], patterns.measure[rows]
    if not patterns.mixes:
        return np.asarray(
            products.reshape(len(products), -1)[:, drive * products.shape[1] + measure].T
        )
    picked = np.empty((len(rows), len(products)))
    for pair in np.unique(drive):
        mine = np.flatnonzero(drive == pair)
        picked[mine] = patterns.mix[measure[mine]] @ (patterns.mix[pair] @ products).T
    return picked


def _candidates(mesh: Mesh, grid: Grid) -> tuple[IntArray, IntArray]:
    """Return pairs of an element and a cell whose square meets the element's bounding box, (k,)
    each, ordered by element; -1 stands for a cell that is not kept."""
    cell = np.floor((mesh.nodes_mm - grid.origin_mm) / grid.pixel_mm).astype(np.int64)
    a, b, c = np.clip(cell, 0, np.array([grid.nx, grid.ny]) - 1)[mesh.triangles.T]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    width, height = (high - low + 1).T
    count = width * height
    elements = np.repeat(np.arange(mesh.n_elements), count)
    place = np.arange(len(elements)) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(place, width[elements])
    return elements, grid.number[low[elements, 1] + row, low[elements, 0] + column]


def _area_in_square(x: FloatArray, y: FloatArray, side: float) -> FloatArray:
    """Return the area of each counterclockwise triangle (corners x and y, (3, k)) within the square
    [0, side]^2, (k,).

    By Green's theorem it is the integral of clip(x, 0, side) dy around the triangle, over the parts
    with y in [0, side]. On a straight edge, the integral of the clipped x has a closed form.
    """
    area = np.zeros(x.shape[1])
    for begin, end in ((0, 1), (1, 2), (2, 0)):
        rise = y[end] - y[begin]
        low, high = np.clip(y[begin], 0, side), np.clip(y[end], 0, side)
        slope = np.divide(x[end] - x[begin], rise, out=np.zeros_like(rise), where=rise != 0)
        x0, x1 = (x[begin] + slope * (level - y[begin]) for level in (low, high))
        c0, c1 = np.clip(x0, 0, side), np.clip(x1, 0, side)
        past = np.maximum(x1 - side, 0) - np.maximum(x0 - side, 0)
        integral = (c1 - c0) * (c0 + c1) / 2 + side * past
        area += np.divide(integral, x1 - x0, out=c0.copy(), where=x1 != x0) * (high - low)
    return area
