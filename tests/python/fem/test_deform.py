"""Moved meshes: electrodes and rim go where they are wanted, elements stay whole."""

import numpy as np
import pytest

from eitskin.fem.deform import MeshDeformation
from eitskin.fem.mesh import Mesh, mesh_for_elements
from eitskin.fem.shaped_touch import PROFILES, ShapedTouch, TouchCover
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import Outline, disk, polygon
from eitskin.skin.skin import Skin

ELL = polygon([(0, 0), (100, 0), (100, 40), (40, 40), (40, 100), (0, 100)])
COMB = polygon([(0, 0), (90, 0), (90, 80), (70, 80), (70, 20), (55, 20), (55, 80), (0, 80)])


def mesh_of(outline: Outline, count: int = 8, elements: int = 900) -> Mesh:
    return mesh_for_elements(Skin("x", outline, Electrodes(count, 4.0)), elements)


def ends_mm(mesh: Mesh, electrode: int) -> np.ndarray:
    edges = mesh.electrode_edges[electrode]
    return mesh.nodes_mm[[edges[0, 0], edges[-1, 1]]]


def test_nothing_moves_by_nothing():
    mesh = mesh_of(ELL)
    d = MeshDeformation(mesh)
    assert d.rim.length_mm == pytest.approx(ELL.perimeter_mm)
    still = d.moved(np.zeros(8), np.ones(8), np.zeros(len(d.rim.nodes)))
    assert still.nodes_mm == pytest.approx(mesh.nodes_mm, abs=1e-9)


def test_electrodes_of_a_disk_turn_along_the_rim():
    mesh = mesh_of(disk(100.0))
    d = MeshDeformation(mesh)
    shift, widths = np.linspace(-1, 1, 8), np.linspace(0.8, 1.2, 8)
    moved = d.moved(shift, widths, np.zeros(len(d.rim.nodes)))
    for k in range(8):
        before, after = (np.angle(ends_mm(m, k) @ [1, 1j]) for m in (mesh, moved))
        turned = 50 * np.angle(np.exp(1j * (after - before)))
        assert turned.mean() == pytest.approx(shift[k], abs=0.02)
        assert np.diff(turned)[0] == pytest.approx(4 * (widths[k] - 1), abs=0.02)
    assert np.hypot(*moved.nodes_mm[d.rim.nodes].T) == pytest.approx(50, abs=0.05)


def test_a_disk_grows_with_its_rim():
    """The movement inside is linear where the rim's is."""
    mesh = mesh_of(disk(100.0))
    d = MeshDeformation(mesh)
    moved = d.moved(np.zeros(8), np.ones(8), np.full(len(d.rim.nodes), 1.0))
    assert moved.nodes_mm == pytest.approx(1.02 * mesh.nodes_mm, abs=0.05)


@pytest.mark.parametrize("outline", [ELL, COMB], ids=["ell", "comb"])
def test_corners_and_fingers_stay_whole(outline):
    mesh = mesh_of(outline, 16)
    d, draw = MeshDeformation(mesh), np.random.default_rng(3)
    for _ in range(5):
        waves = np.cos(2 * np.pi * 3 * d.rim.arc_mm / d.rim.length_mm + draw.uniform(0, 6))
        moved = d.moved(0.5 * draw.standard_normal(16), np.ones(16), 0.9 * waves)
        assert (moved.areas_mm2 > 0.4 * mesh.areas_mm2).all()
        step = np.linalg.norm((moved.nodes_mm - mesh.nodes_mm)[d.rim.nodes], axis=1)
        assert 0.3 < np.sqrt(np.mean(step**2)) < 1.2


def test_electrodes_never_meet():
    mesh = mesh_of(disk(100.0))
    d = MeshDeformation(mesh)
    shift = np.where(np.arange(8) % 2, 60.0, -60.0)
    moved = d.moved(shift, np.ones(8), np.zeros(len(d.rim.nodes)))
    angles = np.concatenate([np.angle(ends_mm(moved, k) @ [1, 1j]) for k in range(8)])
    assert (np.diff(np.unwrap(angles)) > 0).all() and (moved.areas_mm2 > 0).all()


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("aspect", [1.0, 2.2])
def test_shapes_change_as_much_as_their_disc(profile, aspect):
    mesh = mesh_of(disk(100.0), elements=4000)
    cover = TouchCover(mesh)
    touch = ShapedTouch(8.0, -5.0, 12.0, 4.0, aspect, 0.7, profile)
    for one in (touch, touch.disc()):
        change = (cover.factors((one,)) - 1) * mesh.areas_mm2
        assert change.sum() == pytest.approx(3 * np.pi * 144, rel=0.02)
        middle = change @ mesh.centroids_mm() / change.sum()
        assert middle == pytest.approx([8.0, -5.0], abs=0.1)
    spread = np.cov(mesh.centroids_mm().T, aweights=(cover.factors((touch,)) - 1) * mesh.areas_mm2)
    low, high = np.linalg.eigvalsh(spread)
    assert np.sqrt(high / low) == pytest.approx(aspect, rel=0.1)
