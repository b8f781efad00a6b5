"""The rim's mirror of a dipole."""

from math import gamma

import numpy as np
import pytest

from eitskin.skin.mirror import rim_mirror
from eitskin.skin.outline import disk, polygon
from small_models import l_shape, rounded_rectangle


def field(place: complex, dipole: complex, a: complex, b: complex, at: np.ndarray) -> np.ndarray:
    """The field of a dipole and its mirror at ``at``, as vectors x + iy."""
    return np.asarray(np.conj(dipole / (at - place) ** 2 - np.conj(dipole) / (a - b * at) ** 2))


def test_of_a_disk():
    a, b = rim_mirror(disk(80.0), [(10.0, -20.0), (0.0, 0.0), (0.0, 39.0)])
    assert a == pytest.approx([40, 40, 40])
    assert b == pytest.approx([(10 + 20j) / 40, 0, -39j / 40])


@pytest.mark.parametrize("dipole", [1.0, 1j, 0.6 - 0.8j])
def test_no_current_crosses_the_rim_of_a_disk(dipole):
    place = 12 - 23j
    (a,), (b,) = rim_mirror(disk(80.0), [(place.real, place.imag)])
    normal = np.exp(1j * np.linspace(0, 2 * np.pi, 50))
    seen = field(place, dipole, a, b, 40 * normal)
    along = (seen * np.conj(normal)).real
    assert np.abs(along).max() < 1e-12 * np.abs(seen).max()


def test_many_corners_are_a_disk():
    turn = 2 * np.pi * np.arange(200) / 200
    circle = polygon(40 * np.column_stack([np.cos(turn), np.sin(turn)]))
    points = [(0.0, 0.0), (10.0, -20.0), (-31.0, 12.0), (0.0, 38.0)]
    ours, exact = rim_mirror(circle, points), rim_mirror(disk(80.0), points)
    assert ours[0] == pytest.approx(exact[0], abs=0.02)
    assert ours[1] == pytest.approx(exact[1], abs=1e-3)


def test_the_middle_of_a_square_has_its_conformal_radius():
    """A square of side 1 has the conformal radius 4 sqrt(pi) / Gamma(1/4)^2 at its middle (Polya
    and Szego, Isoperimetric inequalities in mathematical physics, 1951)."""
    square = polygon([(0, 0), (100, 0), (100, 100), (0, 100)])
    (a,), (b,) = rim_mirror(square, [(50.0, 50.0)])
    assert a == pytest.approx(100 * 4 * np.sqrt(np.pi) / gamma(0.25) ** 2, rel=1e-4)
    assert b == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("dipole", [1.0, 1j, 0.6 - 0.8j])
def test_no_current_crosses_a_straight_edge(dipole):
    """The upper edge of a rectangle, .2 mm away: the mirror image lies as far beyond."""
    rectangle = polygon([(0, 0), (100, 0), (100, 50), (0, 50)])
    (a,), (b,) = rim_mirror(rectangle, [(40.0, 49.8)])
    assert b == pytest.approx(-1j) and a == pytest.approx(-1j * (40 + 50.2j))
    edge = np.linspace(0, 100, 50) + 50j
    seen = field(40 + 49.8j, dipole, a, b, edge)
    assert np.abs(seen.imag).max() < 1e-12 * np.abs(seen).max()


def test_a_long_strip_has_its_conformal_radius():
    """A strip of width w has 2 w / pi sin(pi y / w) at the height y, and b is by its slope."""
    strip = polygon([(0, 0), (400, 0), (400, 50), (0, 50)])
    heights = np.array([5.0, 25.0, 43.0])
    place = 200 + 1j * heights
    a, b = rim_mirror(strip, np.column_stack([place.real, place.imag]))
    assert a - b * place == pytest.approx(100 / np.pi * np.sin(np.pi * heights / 50), rel=2e-3)
    assert b == pytest.approx(1j * np.cos(np.pi * heights / 50), abs=2e-3)


OUTLINES = {
    "l": l_shape(),
    "rounded": rounded_rectangle(),
    "clockwise": polygon([(0, 0), (0, 60), (90, 0)]),
}


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
def test_the_mirror_is_that_of_a_disk_around_the_place(outline):
    """a - b z is the conformal radius: at least the distance to the rim, and at most four times
    (Koebe). |b| is at most 1 in a convex outline, at most 2 elsewhere. On the rim, the image
    is the point itself, from within as on it and beyond."""
    low, high = np.min(outline.vertices_mm, axis=0), np.max(outline.vertices_mm, axis=0)
    points = low + (high - low) * np.random.default_rng(4).random((200, 2))
    points = points[outline.contains(points)]
    a, b = rim_mirror(outline, points)
    place = points[:, 0] + 1j * points[:, 1]
    radius = a - b * place
    corners = np.asarray(outline.vertices_mm) @ [1, 1j]
    along = np.roll(corners, -1) - corners
    share = ((place[:, None] - corners) * np.conj(along)).real / np.abs(along) ** 2
    away = np.abs(place[:, None] - corners - np.clip(share, 0, 1) * along).min(axis=1)
    assert radius.imag == pytest.approx(0, abs=1e-9)
    assert (radius.real >= 0.98 * away).all() and (radius.real <= 4 * away).all()
    assert np.abs(b).max() <= (2 if outline is OUTLINES["l"] else 1 + 1e-3)
    for edge in range(len(corners)):
        on, outward = corners[edge] + along[edge] / 2, -1j * along[edge] / abs(along[edge])
        near = [on + step * outward for step in (-1e-6, 0.0, 1e-6)]
        a, b = rim_mirror(outline, [(z.real, z.imag) for z in near])
        assert a / b == pytest.approx(np.full(3, on), abs=1e-5)
        assert b == pytest.approx(np.full(3, np.conj(outward)), abs=1e-4)
