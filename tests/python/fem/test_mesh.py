"""Meshes: the filled area, the ends of electrodes, and a mesher that hangs or fails."""

import os
import subprocess
import sys
from collections.abc import Iterator
from unittest.mock import Mock

import numpy as np
import pytest

from eitskin.errors import GeometryError, UsageError
from eitskin.fem import mesh as mesh_module
from eitskin.fem.mesh import Mesh, build_mesh, mesh_for_elements, run_mesher
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk, polygon
from eitskin.skin.skin import Skin, paper_skin
from kept_meshes import made_here


@pytest.fixture(scope="module", autouse=True)
def the_mesher_runs() -> Iterator[None]:
    """Here nothing is kept."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mesh_module, "run_mesher", run_mesher)
        yield


def _rim_edges(mesh: Mesh) -> set[tuple[int, int]]:
    """Directed edges that only one triangle has: the rim, counterclockwise."""
    edges = {(int(t[k]), int(t[(k + 1) % 3])) for t in mesh.triangles for k in range(3)}
    assert len(edges) == 3 * mesh.n_elements
    return {(a, b) for a, b in edges if (b, a) not in edges}


def least_angle_deg(mesh: Mesh) -> float:
    """The smallest angle of any triangle: a measure of the mesh's quality (60 at best)."""
    p = mesh.nodes_mm[mesh.triangles]
    sides = np.roll(p, -1, axis=1) - p
    lengths = np.hypot(sides[..., 0], sides[..., 1])
    sines = 2 * mesh.areas_mm2[:, None] / (lengths * np.roll(lengths, 1, axis=1))
    return float(np.degrees(np.arcsin(np.clip(sines, 0, 1)).min()))


def _check(mesh: Mesh, skin: Skin) -> None:
    assert mesh.areas_mm2.min() > 0
    assert sorted(np.unique(mesh.triangles)) == list(range(mesh.n_nodes))
    assert least_angle_deg(mesh) > 12
    rim = _rim_edges(mesh)
    # Euler: one piece, no holes
    assert mesh.n_nodes - (3 * mesh.n_elements + len(rim)) // 2 + mesh.n_elements == 1
    assert len(mesh.electrode_edges) == skin.electrodes.count
    seen: set[int] = set()
    for edges, span in zip(mesh.electrode_edges, skin.electrode_spans_mm(), strict=True):
        assert {(int(a), int(b)) for a, b in edges} <= rim
        assert np.array_equal(edges[1:, 0], edges[:-1, 1])
        ends = mesh.nodes_mm[[edges[0, 0], edges[-1, 1]]]
        np.testing.assert_allclose(ends, skin.outline.points_at(span), atol=0.006)
        steps = mesh.nodes_mm[edges[:, 1]] - mesh.nodes_mm[edges[:, 0]]
        assert np.hypot(*steps.T).sum() == pytest.approx(skin.electrodes.width_mm, rel=5e-3)
        nodes = {int(n) for n in edges.ravel()}
        assert not nodes & seen
        seen |= nodes


def test_disk(paper_mesh):
    skin = paper_skin()
    _check(paper_mesh, skin)
    rim = {n for edge in _rim_edges(paper_mesh) for n in edge}
    np.testing.assert_allclose(np.hypot(*paper_mesh.nodes_mm[sorted(rim)].T), 97, rtol=1e-9)
    assert paper_mesh.areas_mm2.sum() == pytest.approx(skin.outline.area_mm2, rel=2e-3)
    for edges, span in zip(paper_mesh.electrode_edges, skin.electrode_spans_mm(), strict=True):
        assert len(edges) >= 4
        ends = paper_mesh.nodes_mm[[edges[0, 0], edges[-1, 1]]]
        np.testing.assert_allclose(ends, skin.outline.points_at(span), atol=1e-9)


def test_l_shape(l_skin, l_mesh):
    _check(l_mesh, l_skin)
    assert l_mesh.areas_mm2.sum() == pytest.approx(5100, rel=1e-12)
    assert l_skin.outline.contains(l_mesh.centroids_mm()).all()


def test_rounded_rectangle_given_clockwise(rounded_skin):
    mesh = build_mesh(rounded_skin, max_size_mm=6.0)
    _check(mesh, rounded_skin)
    assert mesh.areas_mm2.sum() == pytest.approx(rounded_skin.outline.area_mm2, rel=1e-12)


def test_electrode_around_a_corner_and_ending_on_one():
    square = polygon([(0, 0), (60, 0), (60, 60), (0, 60)])
    around = Skin("around", square, Electrodes(4, 10, start_angle_deg=45))
    mesh = build_mesh(around, max_size_mm=6.0)
    _check(mesh, around)
    corner = int(np.argmin(np.hypot(*(mesh.nodes_mm - (60, 60)).T)))
    assert corner in mesh.electrode_edges[0][1:, 0]
    # Electrode 0's middle at (60, 55): it ends 2e-4 mm from the corner, onto which it is put.
    places = (25.0, 85.0, 145.0, 205.0)
    ending = Skin("ending", square, Electrodes(4, 10.0004, 0, positions_mm=places))
    mesh = build_mesh(ending, max_size_mm=6.0)
    _check(mesh, ending)
    assert mesh.nodes_mm[mesh.electrode_edges[0][-1, 1]].tolist() == [60, 60]
    assert mesh.areas_mm2.min() > 0.05


def test_electrodes_on_a_quarter_of_a_disk():
    """The bare arc is longer than half of the rim: its nodes lie on the circle all the same."""
    places = tuple(2.5 + 5.0 * k for k in range(16))
    skin = Skin("bunched", disk(100.0), Electrodes(16, 3.0, positions_mm=places), 0.02, 5.0)
    mesh = build_mesh(skin, max_size_mm=6.0)
    rim = np.hypot(*mesh.nodes_mm.T)
    assert rim.max() < 50 + 1e-6 and mesh.areas_mm2.sum() > 0.99 * skin.outline.area_mm2
    assert np.count_nonzero(rim > 50 - 1e-3) > 314 / 6


def test_sizes_are_obeyed_and_repeatable():
    skin = paper_skin()
    coarse, fine, again = (
        build_mesh(skin, max_size_mm=12.0, electrode_size_mm=size) for size in (2.0, 0.5, 0.5)
    )
    assert all(len(edges) == 2 for edges in coarse.electrode_edges)
    assert all(len(edges) == 8 for edges in fine.electrode_edges)
    assert np.array_equal(again.nodes_mm, fine.nodes_mm)
    assert np.array_equal(again.triangles, fine.triangles)
    with pytest.raises(ValueError, match="read-only"):
        fine.nodes_mm[0] = 0


@pytest.mark.parametrize(
    "skin",
    [
        paper_skin(),
        Skin("many", disk(194), Electrodes(32)),
        Skin("tank", disk(280), Electrodes(16, 25, 90, True)),
        Skin("pad", polygon([(0, 0), (200, 0), (200, 100), (0, 100)]), Electrodes(16, 5)),
    ],
    ids=lambda skin: skin.name,
)
@pytest.mark.parametrize(
    "elements", [1000, pytest.param(3000, marks=pytest.mark.long("1,000 and 10,500")), 10500]
)
def test_element_counts_in_one_go(skin, elements, monkeypatch):
    calls = Mock(side_effect=build_mesh)
    monkeypatch.setattr(mesh_module, "build_mesh", calls)
    mesh = mesh_for_elements(skin, elements)
    assert abs(mesh.n_elements - elements) <= 0.15 * elements
    assert calls.call_count == 1


def test_more_electrodes_than_elements_will_carry():
    skin = Skin("dense", disk(194), Electrodes(64, 4.0))
    mesh = mesh_for_elements(skin, 1000)
    assert abs(mesh.n_elements - 1000) < 400
    _check(mesh, skin)


@pytest.mark.parametrize("elements", [0, 199, 10**9])
def test_refused_counts(elements):
    with pytest.raises(UsageError, match="use 200 to 200000"):
        mesh_for_elements(paper_skin(), elements)


@pytest.mark.parametrize(
    ("size", "at_electrodes"),
    [(0.0, 1.0), (-1.0, 1.0), (5.0, 0.0), (1e-3, 1e-3), (float("nan"), 1.0)],
)
def test_refused_sizes(size, at_electrodes):
    with pytest.raises(UsageError, match="mesh: sizes of"):
        build_mesh(paper_skin(), max_size_mm=size, electrode_size_mm=at_electrodes)


def test_a_mesher_that_hangs_is_killed(monkeypatch):
    """Netgen never returns on a clockwise outline; ``polygon`` turns those, so the request is made
    by hand."""
    real, started = subprocess.Popen, []
    monkeypatch.setattr(
        subprocess, "Popen", lambda *a, **k: (started.append(real(*a, **k)), started[-1])[1]
    )
    clockwise = [[0, 0, None, 1.0], [0, 10, None, 1.0], [10, 10, None, 1.0], [10, 0, None, 1.0]]
    said = r"skin 'bad': meshing took longer than 1\.5 s and was stopped"
    with pytest.raises(GeometryError, match=said) as caught:
        run_mesher({"max_size": 1.0, "pieces": clockwise}, 1.5, "bad")
    assert "\n" not in str(caught.value)
    (child,) = started
    assert child.returncode is not None and child.returncode < 0
    with pytest.raises(ProcessLookupError):
        os.kill(child.pid, 0)


def test_build_mesh_passes_its_time_on():
    with pytest.raises(GeometryError, match=r"skin 'paper': meshing took longer than 0\.001 s"):
        build_mesh(paper_skin(), max_size_mm=9.0, timeout_s=0.001)


def test_a_mesher_that_fails_gives_one_line():
    with pytest.raises(GeometryError, match=r"the mesher failed .*KeyError.*simplify") as caught:
        run_mesher({"pieces": []}, 30, "bad")
    assert "\n" not in str(caught.value)


def test_the_mesher_gives_the_same_arrays_as_the_tests_do_without_a_process():
    pieces = [[0, 0, None, 1.0], [10, 0, None, 1.0], [10, 10, None, 1.0], [0, 10, None, 1.0]]
    request = {"max_size": 2.0, "pieces": pieces}
    made = made_here(request)
    assert made is not None and len(made[1]) > 50
    for one, other in zip(run_mesher(request, 30, "square"), made, strict=True):
        assert np.array_equal(one, other)


def test_the_worker_starts_light():
    code = "import sys, eitskin.fem.mesh_worker, netgen.geom2d\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"scipy", "matplotlib", "eitskin.fem.mesh", "eitskin.skin"}
    assert not heavy & set(done.stdout.split())


def test_files_in_the_working_directory_do_not_disturb(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong numpy')")
    (tmp_path / "netgen.py").write_text("raise SystemExit('the wrong netgen')")
    monkeypatch.chdir(tmp_path)
    assert build_mesh(paper_skin(), max_size_mm=20.0, electrode_size_mm=4.0).n_elements > 100
