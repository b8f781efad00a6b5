"""The Jacobian against finite differences, exact laws, and its element-to-pixel areas against
clipping by hand."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError
from eitskin.fem.cem import Counters, ForwardModel
from eitskin.fem.grid import Grid, grid_for
from eitskin.fem.mesh import Mesh, build_mesh
from eitskin.fem.sensitivity import element_to_pixel, sensitivity
from eitskin.skin.protocol import Protocol, adjacent, opposite, table
from eitskin.skin.skin import paper_skin


def _whole(grid: Grid) -> Grid:
    """The grid with every cell kept, so that no part of the skin is left out."""
    iy, ix = np.divmod(np.arange(grid.nx * grid.ny), grid.nx)
    return replace(grid, index=np.column_stack([ix, iy]))


def _finite_differences(forward: ForwardModel, sigma: FloatArray, weight: FloatArray) -> FloatArray:
    """dV / dsigma for the elements weighted by ``weight`` (E,), central, fourth order."""
    step = 2e-3 * sigma[weight > 0].min()
    v = {k: forward.voltages(sigma + k * step * weight) for k in (-2, -1, 1, 2)}
    return (8 * (v[1] - v[-1]) - (v[2] - v[-2])) / (12 * step)


def _check_pixels(forward: ForwardModel, sigma: FloatArray, grid: Grid, *pixels: int) -> None:
    """The Jacobian's columns of ``pixels`` are the finite differences."""
    jacobian, voltages = sensitivity(forward, sigma, grid)
    assert jacobian.shape == (forward.protocol.n_rows, grid.n_pixels)
    assert np.array_equal(voltages, forward.voltages(sigma))
    weights = element_to_pixel(forward.mesh, grid).toarray()
    for pixel in (*pixels, grid.n_pixels - 1):
        found = _finite_differences(forward, sigma, weights[:, pixel])
        assert np.linalg.norm(jacobian[:, pixel] - found) < 1e-7 * np.linalg.norm(found)


@pytest.mark.parametrize("impedance", [0.01, 0.0])
@pytest.mark.parametrize("protocol", ["adjacent", "opposite", "flipped", "all pairs"])
def test_against_finite_differences(protocol, impedance, paper_mesh):
    pairs = [(a, b) for a in range(16) for b in range(a + 1, 16)]
    made: Protocol = {
        "adjacent": adjacent(16),
        "opposite": opposite(16, 3e-3),
        "flipped": table(16, [[3, 2, 9, 14], [0, 9, 5, 4], [4, 5, 0, 9], [7, 8, 7, 8]]),
        "all pairs": table(16, [[*pairs[k], *pairs[-1 - k]] for k in range(60)]),
    }[protocol]
    forward = ForwardModel(paper_mesh, paper_skin(), made, impedance)
    sigma = 0.01 * 10 ** np.random.default_rng(7).uniform(-0.3, 0.3, paper_mesh.n_elements)
    _check_pixels(forward, sigma, grid_for(paper_skin().outline, 16), 0, 7, 60, 104)


def test_custom_outline_against_finite_differences(l_skin, l_mesh):
    sigma = np.full(l_mesh.n_elements, l_skin.conductivity_s_per_m)
    forward = ForwardModel(l_mesh, l_skin, adjacent(12))
    _check_pixels(forward, sigma, grid_for(l_skin.outline, 20), 0, 55, 130)


def test_predicts_a_touch(paper_mesh):
    """A conductive spot of one pixel lowers the voltages near it as V + J ds says, to second order
    in ds."""
    grid = grid_for(paper_skin().outline)
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16))
    jacobian, base = sensitivity(forward, 0.01, grid)
    weight = element_to_pixel(paper_mesh, grid)[:, [123]].toarray()[:, 0]
    errors = []
    for ds in (1e-3, 5e-4, 2.5e-4):
        change = forward.voltages(0.01 + ds * weight) - base
        errors.append(np.linalg.norm(change - jacobian[:, 123] * ds))
        assert errors[-1] < 0.1 * np.linalg.norm(change)
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.15)


def test_euler_identity_with_shunts(paper_mesh):
    """Without contact impedance V is homogeneous of degree -1 in the conductivity, so the whole
    skin's J sigma = -V."""
    grid = _whole(grid_for(paper_skin().outline, 24))
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16), 0.0)
    jacobian, voltages = sensitivity(forward, 0.01, grid)
    np.testing.assert_allclose(jacobian.sum(axis=1) * 0.01, -voltages, rtol=1e-9)


def test_reciprocal_rows_and_chosen_rows(paper_mesh):
    grid = grid_for(paper_skin().outline)
    protocol = adjacent(16)
    forward = ForwardModel(paper_mesh, paper_skin(), protocol)
    whole, voltages = sensitivity(forward, 0.01, grid)
    pairs = protocol.reciprocal_pairs()
    off = whole[pairs.first] - pairs.sign[:, None] * whole[pairs.second]
    assert np.abs(off).max() < 1e-13 * np.abs(whole).max()
    weights = element_to_pixel(paper_mesh, grid)
    kept = weights.copy()
    folded, some = sensitivity(forward, 0.01, grid, rows=pairs.first, weights=weights)
    assert np.array_equal(folded, whole[pairs.first])
    assert np.array_equal(some, voltages[pairs.first])
    assert np.array_equal(weights.data, kept.data)


def test_one_factorisation_and_each_pair_once(paper_mesh):
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16))
    sensitivity(forward, 0.01, grid_for(paper_skin().outline))
    assert forward.counters == Counters(1, 1, 16)
    three = table(16, [[0, 1, 2, 3], [3, 2, 5, 6], [6, 5, 1, 0]])
    forward = ForwardModel(paper_mesh, paper_skin(), three)
    sensitivity(forward, 0.01, grid_for(paper_skin().outline))
    assert forward.counters.solves == 3


def test_a_symmetric_skin_has_a_symmetric_jacobian():
    """A quarter turn of a skin with 16 electrodes turns pixels and rows alike, to the mesh's own
    asymmetry."""
    skin, protocol = paper_skin(), adjacent(16)
    mesh = build_mesh(skin, max_size_mm=4.0, electrode_size_mm=0.5)
    grid = grid_for(skin.outline)
    jacobian, _ = sensitivity(ForwardModel(mesh, skin, protocol), 0.01, grid)
    turned_pixel = grid.locate(grid.centres_mm() @ np.array([[0, 1], [-1, 0]]))
    turned_rows = (protocol.drive_measure.astype(int) + 4) % 16
    place = {tuple(row): k for k, row in enumerate(protocol.drive_measure.tolist())}
    turned_row = [place[tuple(row)] for row in turned_rows.tolist()]
    turned = jacobian[np.ix_(turned_row, turned_pixel)]
    assert np.linalg.norm(turned - jacobian) < 0.02 * np.linalg.norm(jacobian)


def _clipped_area(triangle: FloatArray, low: FloatArray, side: float) -> float:
    """Sutherland and Hodgman's clipping of one triangle to one square."""
    points = [tuple(p) for p in triangle - low]
    for axis, sign, bound in ((0, 1, 0.0), (0, -1, -side), (1, 1, 0.0), (1, -1, -side)):
        clipped = []
        for p, q in zip(points, points[1:] + points[:1], strict=True):
            a, b = sign * p[axis] - bound, sign * q[axis] - bound
            if a >= 0:
                clipped.append(p)
            if (a >= 0) != (b >= 0):
                share = a / (a - b)
                clipped.append((p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])))
        points = clipped
    edges = zip(points, points[1:] + points[:1], strict=True)
    return sum(p[0] * q[1] - p[1] * q[0] for p, q in edges) / 2


def test_areas_against_clipping(l_mesh, l_skin):
    grid = grid_for(l_skin.outline, 23)
    weights = element_to_pixel(l_mesh, grid).toarray()
    low = np.asarray(grid.origin_mm) + grid.index * grid.pixel_mm
    for element in range(0, l_mesh.n_elements, 17):
        triangle = l_mesh.nodes_mm[l_mesh.triangles[element]]
        near = np.flatnonzero((np.abs(low - triangle.mean(axis=0)) < 15).all(axis=1))
        exact = np.zeros(grid.n_pixels)
        exact[near] = [_clipped_area(triangle, low[k], grid.pixel_mm) for k in near]
        np.testing.assert_allclose(weights[element], exact / l_mesh.areas_mm2[element], atol=1e-11)


@pytest.mark.parametrize("across", [4, 32, 150])
def test_areas_add_up(across, paper_mesh):
    grid = grid_for(paper_skin().outline, across)
    whole = element_to_pixel(paper_mesh, _whole(grid))
    np.testing.assert_allclose(np.asarray(whole.sum(axis=1)).ravel(), 1, rtol=1e-9)
    kept = element_to_pixel(paper_mesh, grid)
    assert kept.sum(axis=1).max() <= 1 + 1e-9
    covered = (kept.T @ paper_mesh.areas_mm2) / grid.pixel_area_mm2
    corner = np.abs(grid.centres_mm()) + grid.pixel_mm / 2
    inner = np.hypot(*corner.T) < 96
    np.testing.assert_allclose(covered[inner], 1, rtol=1e-9)
    assert covered.max() <= 1 + 1e-9
    assert covered.min() > 0.4


def test_triangles_with_edges_along_the_grid():
    """Right-angled triangles whose legs run exactly along pixel borders."""
    nodes = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
    mesh = Mesh(nodes, np.array([[0, 1, 2], [1, 3, 2]]), ())
    grid = Grid(2, 2, 1.0, (0.0, 0.0), np.array([[0, 0], [1, 0], [0, 1], [1, 1]]))
    weights = element_to_pixel(mesh, grid).toarray()
    expected = [[0.5, 0.25, 0.25, 0.0], [0.0, 0.25, 0.25, 0.5]]
    np.testing.assert_allclose(weights, expected, atol=1e-15)


def test_refused_conductivity(paper_mesh):
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16))
    with pytest.raises(UsageError, match="above 0"):
        sensitivity(forward, 0.0, grid_for(paper_skin().outline))
