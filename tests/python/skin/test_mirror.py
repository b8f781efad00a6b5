"""The rim's mirror of a dipole."""

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


@pytest.mark.parametrize("dipole", [1.0, 1j, 0.6 - 0.8j])
def test_no_current_crosses_a_straight_edge(dipole):
    """The upper edge of a rectangle, 7 mm away: the mirror image lies as far beyond."""
    rectangle = polygon([(0, 0), (100, 0), (100, 50), (0, 50)])
    (a,), (b,) = rim_mirror(rectangle, [(40.0, 43.0)])
    assert b == pytest.approx(-1j) and a == pytest.approx(-1j * (40 + 57j))
    edge = np.linspace(0, 100, 50) + 50j
    seen = field(40 + 43j, dipole, a, b, edge)
    assert np.abs(seen.imag).max() < 1e-12 * np.abs(seen).max()


OUTLINES = {
    "l": l_shape(),
    "rounded": rounded_rectangle(),
    "clockwise": polygon([(0, 0), (0, 60), (90, 0)]),
}


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
def test_a_straight_mirror_is_the_image_beyond_the_nearest_edge(outline):
    """a / b is the image point, |b| = 1; on the rim it is the point itself, from within as on it
    and beyond."""
    low, high = np.min(outline.vertices_mm, axis=0), np.max(outline.vertices_mm, axis=0)
    points = low + (high - low) * np.random.default_rng(4).random((200, 2))
    points = points[outline.contains(points)]
    a, b = rim_mirror(outline, points)
    place, image = points[:, 0] + 1j * points[:, 1], a / b
    assert np.abs(b) == pytest.approx(1)
    middle = (place + image) / 2
    corners = np.asarray(outline.vertices_mm) @ [1, 1j]
    along = np.roll(corners, -1) - corners
    share = np.clip(((middle[:, None] - corners) * np.conj(along)).real / np.abs(along) ** 2, 0, 1)
    assert np.abs(middle[:, None] - corners - share * along).min(axis=1) == pytest.approx(
        0, abs=1e-9
    )  # halfway lies the rim
    assert (image - place) * b == pytest.approx(np.abs(image - place))  # straight outward
    for edge in range(len(corners)):
        on, outward = corners[edge] + along[edge] / 2, -1j * along[edge] / abs(along[edge])
        near = [on + step * outward for step in (-1e-6, 0.0, 1e-6)]
        a, b = rim_mirror(outline, [(z.real, z.imag) for z in near])
        assert a / b == pytest.approx(np.full(3, on), abs=1e-5)
        assert b == pytest.approx(np.full(3, np.conj(outward)), abs=1e-4)
