"""The image grid: which pixels are kept, in what order, and images there and back."""

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.skin.outline import disk, polygon


@pytest.mark.parametrize(("across", "kept"), [(20, 316), (27, 577), (32, 812), (40, 1264)])
def test_disk_counts(across, kept):
    grid = grid_for(disk(194.0), across)
    assert (grid.nx, grid.ny, grid.n_pixels) == (across, across, kept)
    assert grid.pixel_mm == pytest.approx(194 / across)
    assert grid.origin_mm == pytest.approx((-97, -97))
    assert (np.hypot(*grid.centres_mm().T) <= 97).all()


def test_order_is_row_by_row_from_below():
    grid = grid_for(disk(194.0))
    flat = grid.index[:, 1] * grid.nx + grid.index[:, 0]
    assert (np.diff(flat) > 0).all()
    centres = grid.centres_mm()
    assert centres[0, 1] == pytest.approx(-97 + 97 / 32)
    image = grid.image(centres[:, 1])
    assert image[0, 16] < 0 < image[-1, 16]
    assert np.isnan(image[0, 0])
    assert np.isnan(image).sum() == 32 * 32 - 812


def test_image_there_and_back():
    grid = grid_for(disk(100.0), 16)
    values = np.random.default_rng(1).normal(size=grid.n_pixels)
    assert np.array_equal(grid.values(grid.image(values)), values)
    with pytest.raises(UsageError, match="one value per pixel"):
        grid.image(values[:-1])
    with pytest.raises(UsageError, match="image of shape"):
        grid.values(np.zeros((3, 3)))


def test_a_place_is_in_the_pixel_around_it():
    grid = grid_for(disk(100.0), 16)
    centres, kept = grid.centres_mm(), set(map(tuple, grid.index.tolist()))
    for step in [(-1, 0), (1, 0), (0, -1), (0, 1)]:
        moved = centres + np.array(step) * grid.pixel_mm
        at = grid.locate(moved)
        np.testing.assert_allclose(centres[at[at >= 0]], moved[at >= 0], atol=1e-9)
        assert [k >= 0 for k in at] == [tuple(one) in kept for one in (grid.index + step).tolist()]
    assert np.array_equal(grid.locate(centres), np.arange(grid.n_pixels))
    assert grid.locate([(1e6, 0), (-50.1, 0), (0, 50.1)]).tolist() == [-1, -1, -1]


def test_oblong_and_concave(l_skin):
    grid = grid_for(polygon([(0, 0), (100, 0), (100, 33), (0, 33)]), 10)
    assert (grid.nx, grid.ny, grid.pixel_mm) == (10, 4, 10.0)
    assert grid.origin_mm == pytest.approx((0, -3.5))
    assert grid.n_pixels == 40
    arms = grid_for(l_skin.outline, 20)
    assert arms.n_pixels == 400 - 14 * 14
    assert l_skin.outline.contains(arms.centres_mm()).all()


@pytest.mark.parametrize("across", [0, 3, 513, -1])
def test_refused(across):
    with pytest.raises(UsageError, match="use 4 to 512"):
        grid_for(disk(10.0), across)
