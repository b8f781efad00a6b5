"""The complete electrode model against exact series, against scikit-fem, and against itself."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from disk_series import DWARFING_IMPEDANCE_OHM_M2, exact_voltages, polar_mesh
from eitskin.arrays import FloatArray
from eitskin.errors import ProtocolError, UsageError
from eitskin.fem.cem import Counters, ForwardModel
from eitskin.fem.mesh import Mesh, build_mesh, mesh_for_elements
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import Protocol, adjacent, opposite, skip, table
from eitskin.skin.skin import Skin, paper_skin


def _relative(found: FloatArray, exact: FloatArray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def _slope(sizes: list[float], errors: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


@pytest.mark.parametrize(
    ("radius_mm", "inside"), [(48.5, 0.09), (48.5, 0.001), (80.0, 0.05), (48.5, 0.01)]
)
def test_concentric_inclusion_converges_to_the_exact_series(radius_mm, inside):
    """Second order in the size, on meshes that follow the inclusion's rim."""
    skin = Skin("turned", disk(194.0), Electrodes(16, 194 * pi / 64, start_angle_deg=360 / 128))
    protocol = adjacent(16)
    exact = exact_voltages(skin, protocol, radius_mm, inside)
    sizes, errors = [], []
    for fineness in (1, 2, 4):
        inner, outer = ((0, radius_mm), (radius_mm, 97))
        rings = [np.linspace(*ends, 4 * fineness + 1)[1:] for ends in (inner, outer)]
        rings = np.concatenate(rings)
        mesh = polar_mesh(skin, rings, 64 * fineness)
        forward = ForwardModel(mesh, skin, protocol, DWARFING_IMPEDANCE_OHM_M2)
        away = np.hypot(*mesh.centroids_mm().T)
        conductivity = np.where(away < radius_mm, inside, skin.conductivity_s_per_m)
        sizes.append(1 / fineness)
        errors.append(_relative(forward.voltages(conductivity), exact))
    assert errors[-1] < 3e-3
    assert 1.7 < _slope(sizes, errors) < 2.4


def test_netgen_meshes_converge_to_the_exact_series():
    skin, protocol = paper_skin(), adjacent(16)
    exact = exact_voltages(skin, protocol, 9.0, 0.01)
    counts, errors = [], []
    for elements in (750, 1500, 3000, 6000, 12000):
        mesh = mesh_for_elements(skin, elements)
        counts.append(mesh.n_elements)
        forward = ForwardModel(mesh, skin, protocol, DWARFING_IMPEDANCE_OHM_M2)
        errors.append(_relative(forward.voltages(0.01), exact))
    assert errors[2] < 3e-3  # the default mesh
    assert errors[-1] < 8e-4
    # of the number of elements: about -1 is second order in the size
    assert -1.2 < _slope(counts, errors) < -0.75
    assert _relative(forward.voltages(0.01, 0.0), exact) > 4e-3  # a shunt's are others
    smaller = forward.voltages(0.01, 1e-2 * DWARFING_IMPEDANCE_OHM_M2)
    assert _relative(smaller, forward.voltages(0.01)) < 1e-4  # the impedance no longer enters


def test_32_electrodes_opposite_drive_against_the_series():
    skin = Skin("many", disk(100.0), Electrodes(32, 3.0, 17.0, True), 1.3, 7.0)
    protocol = opposite(32)
    exact = exact_voltages(skin, protocol, 9.0, 1.3)
    mesh = mesh_for_elements(skin, 9000)
    forward = ForwardModel(mesh, skin, protocol, DWARFING_IMPEDANCE_OHM_M2)
    assert _relative(forward.voltages(1.3), exact) < 2e-3


def test_driven_electrodes_see_their_contacts(paper_mesh):
    """Under a large impedance, a driven pair's voltage rises by 2 dz / area per ampere."""
    protocol = table(16, [[0, 5, 0, 5], [0, 5, 5, 0]], current_a=1e-3)
    forward = ForwardModel(paper_mesh, paper_skin(), protocol)
    # chords, a little shorter than 4 mm
    edges = paper_mesh.nodes_mm[paper_mesh.electrode_edges[0]]
    area_m2 = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum() * 1e-3 * 12e-3
    one, ten, hundred = (float(forward.voltages(0.01, z)[0]) for z in (1e3, 1e4, 1e5))
    assert (ten - one) / 9e3 == pytest.approx(2e-3 / area_m2, rel=1e-6)
    assert (hundred - ten) / (ten - one) == pytest.approx(10, rel=1e-6)  # linear in z
    assert hundred / 1e5 == pytest.approx(2e-3 / area_m2, rel=1e-3)


def _solved_by_scikit_fem(
    mesh: Mesh, skin: Skin, protocol: Protocol, conductivity: FloatArray, impedance: FloatArray
) -> FloatArray:
    """The same discrete problem put together by scikit-fem: contacts as facet forms, shunts as
    Lagrange constraints."""
    import skfem
    from scipy.sparse import bmat, coo_matrix
    from scipy.sparse.linalg import spsolve
    from skfem.helpers import dot, grad

    t = skin.thickness_mm * 1e-3
    triangulation = skfem.MeshTri(mesh.nodes_mm.T * 1e-3, mesh.triangles.T)
    basis = skfem.Basis(triangulation, skfem.ElementTriP1())
    sigma = basis.with_element(skfem.ElementTriP0()).interpolate(conductivity)
    matrix = skfem.BilinearForm(lambda u, v, w: w.sigma * t * dot(grad(u), grad(v))).assemble(
        basis, sigma=sigma
    )
    facet_of = {
        tuple(pair): k for k, pair in enumerate(np.sort(triangulation.facets, axis=0).T.tolist())
    }
    count, n = skin.electrodes.count, mesh.n_nodes
    coupling, corner, constraints = np.zeros((n, count)), np.zeros(count), []
    for k, edges in enumerate(mesh.electrode_edges):
        if impedance[k] == 0:
            constraints += [(int(node), k) for node in np.unique(edges)]
            continue
        facets = np.array([facet_of[tuple(sorted(edge))] for edge in edges.tolist()])
        rim = skfem.FacetBasis(triangulation, skfem.ElementTriP1(), facets=facets)
        scale = t / impedance[k]
        matrix = matrix + scale * skfem.BilinearForm(lambda u, v, w: u * v).assemble(rim)
        coupling[:, k] = -scale * skfem.LinearForm(lambda v, w: v).assemble(rim)
        corner[k] = -coupling[:, k].sum()
    rows = np.repeat(np.arange(len(constraints)), 2)
    columns = np.array([(node, n + k) for node, k in constraints], dtype=int).ravel()
    signs = np.tile([1.0, -1.0], len(constraints))
    mean = coo_matrix(
        (np.full(count, 1e-3), (np.zeros(count, int), n + np.arange(count))), shape=(1, n + count)
    )
    tied = coo_matrix((signs * 1e-3, (rows, columns)), shape=(len(constraints), n + count))
    constraint = bmat([[tied], [mean]]) if constraints else mean
    whole = bmat(
        [
            [bmat([[matrix, coupling], [coupling.T, np.diag(corner)]]), constraint.T],
            [constraint, None],
        ],
        "csc",
    )
    drives, row_drive = np.unique(
        protocol.drive_measure[:, :2].astype(int), axis=0, return_inverse=True
    )
    loads = np.zeros((whole.shape[0], len(drives)))
    loads[n + drives[:, 0], np.arange(len(drives))] = 1
    loads[n + drives[:, 1], np.arange(len(drives))] = -1
    potentials = spsolve(whole, loads)[n : n + count]
    plus, minus = protocol.drive_measure[:, 2:].astype(int).T
    return np.asarray(
        (potentials[plus, row_drive] - potentials[minus, row_drive]) * protocol.current_a
    )


@pytest.mark.parametrize("impedance", [0.01, 1e-4, 10.0, 0.0, "mixed", "mixed, ground shunted"])
@pytest.mark.parametrize("shape", ["disk", "l"])
def test_against_scikit_fem(impedance, shape, paper_mesh, l_skin, l_mesh):
    skin, mesh = (paper_skin(), paper_mesh) if shape == "disk" else (l_skin, l_mesh)
    rng = np.random.default_rng(5)
    count = skin.electrodes.count
    if isinstance(impedance, str):
        z = 10 ** rng.uniform(-4, 0, count)
        z[[0, 3, 4]] = 0
        z[-1] = 0 if "ground" in impedance else 0.02
    else:
        z = np.full(count, impedance)
    conductivity = skin.conductivity_s_per_m * 10 ** rng.uniform(-1, 1, mesh.n_elements)
    for protocol in (
        adjacent(count, 2e-3),
        skip(count, 2),
        table(count, [[0, 5, 0, 5], [3, 1, 7, 2], [2, 7, 1, 3]]),
    ):
        found = ForwardModel(mesh, skin, protocol, z).voltages(conductivity)
        assert _relative(found, _solved_by_scikit_fem(mesh, skin, protocol, conductivity, z)) < 1e-8


@pytest.mark.parametrize("impedance", [0.0, 1e-3, 1.0])
def test_reciprocity_to_rounding(impedance, paper_mesh):
    rng = np.random.default_rng(6)
    conductivity = 10 ** rng.uniform(-3, -1, paper_mesh.n_elements)
    for protocol in (adjacent(16), skip(16, 3)):
        forward = ForwardModel(paper_mesh, paper_skin(), protocol, impedance)
        voltages = forward.voltages(conductivity)
        pairs = protocol.reciprocal_pairs()
        difference = voltages[pairs.first] - pairs.sign * voltages[pairs.second]
        assert np.abs(difference).max() < 1e-11 * np.abs(voltages).max()


def test_every_protocol_reads_the_same_potentials(paper_mesh):
    """A table with more pairs than electrodes sums neighbours' pairs up; each row must agree with
    itself alone."""
    pairs = [(a, b) for a in range(16) for b in range(a + 1, 16)]
    rows = [
        [a, b, c, d]
        for k, (a, b) in enumerate(pairs[::7])
        for c, d in pairs[k::11]
        if not {a, b} & {c, d}
    ]
    everything = np.concatenate([adjacent(16).drive_measure.astype(int), rows])
    for protocol in (
        Protocol(16, everything),
        Protocol(16, everything[:, [2, 3, 0, 1]]),
        Protocol(16, everything[:5]),
    ):
        forward = ForwardModel(paper_mesh, paper_skin(), protocol)
        assert len(forward.patterns.solved) <= 16
        voltages = forward.voltages(0.01)
        for row in range(0, protocol.n_rows, 37):
            one = Protocol(16, protocol.drive_measure[row : row + 1])
            alone = ForwardModel(paper_mesh, paper_skin(), one)
            assert len(alone.patterns.solved) == 2
            assert voltages[row] == pytest.approx(float(alone.voltages(0.01)[0]), rel=1e-8)


def test_work_is_counted_and_patterns_kept(paper_mesh):
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16))
    assert forward.counters == Counters(1, 0, 0)
    first = forward.voltages(0.01)
    second = forward.voltages(np.full(paper_mesh.n_elements, 0.02), 0.005)
    assert forward.counters == Counters(1, 2, 32)
    np.testing.assert_allclose(second, first / 2, rtol=1e-10)
    forward.voltages(0.01, 0.0)
    assert forward.counters.patterns == 2
    assert np.array_equal(forward.voltages(0.01), first)
    assert forward.counters.patterns == 3


def test_scaling_laws(paper_mesh):
    """Voltages go with the current, and inversely with the thickness."""
    skin = paper_skin()
    base = ForwardModel(paper_mesh, skin, adjacent(16)).voltages(0.01)
    thick = replace(skin, thickness_mm=2 * skin.thickness_mm)
    found = ForwardModel(paper_mesh, thick, adjacent(16, 3e-3)).voltages(0.01)
    np.testing.assert_allclose(found, 1.5 * base, rtol=1e-10)
    assert (base[:13] < 0).all()  # towards the current's exit the potential falls


def test_impedance_tends_to_the_shunt(paper_mesh):
    forward = ForwardModel(paper_mesh, paper_skin(), adjacent(16), 0.0)
    shunt = forward.voltages(0.01)
    gaps = [_relative(forward.voltages(0.01, z), shunt) for z in (1e-4, 1e-5, 1e-6)]
    assert gaps[0] < 1e-3
    assert gaps[0] / gaps[1] == pytest.approx(10, rel=0.05)  # in proportion to z
    assert gaps[1] / gaps[2] == pytest.approx(10, rel=0.05)
    potentials = forward.solve(0.01, 0.0)
    for k, edges in enumerate(paper_mesh.electrode_edges):
        (found,) = np.unique(potentials.nodes[edges[:, 0]], axis=0)
        assert np.array_equal(found, potentials.electrodes[k])
    np.testing.assert_allclose(potentials.electrodes.mean(axis=0), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("conductivity", "impedance", "message"),
    [
        (0.0, None, "above 0"),
        (-1.0, None, "above 0"),
        (float("nan"), None, "finite"),
        (np.full(3, 0.01), None, "shape"),
        (0.01, -1.0, "at least 0"),
        (0.01, float("nan"), "finite"),
        (0.01, np.full(3, 0.1), "shape"),
    ],
)
def test_refused(conductivity, impedance, message, paper_mesh):
    with pytest.raises(UsageError, match=message):
        ForwardModel(paper_mesh, paper_skin(), adjacent(16)).voltages(conductivity, impedance)


def test_refused_protocol(paper_mesh):
    with pytest.raises(ProtocolError, match="8 electrodes, but skin 'paper' has 16"):
        ForwardModel(paper_mesh, paper_skin(), adjacent(8))


def test_kit4_reference_frame(shared_data):
    """The tank's measured saline frame: the voltages' shape, scale left free as the conductivity is
    not stated."""
    with np.load(shared_data / "kit4_dev.npz") as data:
        measured, rows = data["reference_voltage"], data["drive_measure"]
    electrodes = Electrodes(16, 25.0, start_angle_deg=90, clockwise=True)
    skin = Skin("kit4", disk(280.0), electrodes, 0.03, 70.0)
    forward = ForwardModel(mesh_for_elements(skin, 3000), skin, table(16, rows))
    correlation, misfit = {}, {}
    for z in (0.0, 1e-3, 5e-3, 1e-2, 0.1, 1.0):
        voltages = forward.voltages(skin.conductivity_s_per_m, z)
        fitted = voltages * (voltages @ measured) / (voltages @ voltages)
        correlation[z] = float(np.corrcoef(voltages, measured)[0, 1])
        misfit[z] = _relative(fitted, measured)
    assert min(correlation.values()) >= 0.99
    assert correlation[5e-3] >= 0.997
    pairs = table(16, rows).reciprocal_pairs()
    left = measured[pairs.first] - pairs.sign * measured[pairs.second]
    noise = np.linalg.norm(left) / np.linalg.norm(measured)
    assert misfit[5e-3] < 1.2 * noise  # about the measurement's own lack of reciprocity


def test_polygons_end_to_end(rounded_skin, l_skin):
    """Refining the mesh of a custom outline changes its voltages little, and ever less."""
    for skin in (rounded_skin, l_skin):
        protocol, voltages = adjacent(skin.electrodes.count), []
        for size in (6.0, 3.0, 1.0):
            mesh = build_mesh(skin, max_size_mm=size, electrode_size_mm=size / 6)
            voltages.append(ForwardModel(mesh, skin, protocol).voltages(0.01))
        coarse, fine = (_relative(v, voltages[-1]) for v in voltages[:2])
        assert fine < coarse < 0.02
        assert fine < 0.006  # the L's inner corner slows it down
