"""Touches out of images: components, centroids."""

import numpy as np
import pytest

from eitskin.fem.grid import grid_for
from eitskin.skin.outline import polygon
from eitskin.solve.image_touches import touches_in_image

GRID = grid_for(polygon([(0, 0), (80, 0), (80, 80), (0, 80)]), 8)
XY = GRID.centres_mm()


def image(*pixels: tuple[int, int, float]) -> np.ndarray:
    values = np.zeros(64)
    for ix, iy, value in pixels:
        values[iy * 8 + ix] = value
    return values


def test_centroid_is_weighted_and_the_strongest_comes_first():
    found = touches_in_image(image((1, 1, 2.0), (6, 6, 3.0), (6, 7, 1.0)), GRID.index, XY, 0.2)
    assert found == pytest.approx(np.array([[65.0, 67.5], [15.0, 15.0]]))


def test_pixels_that_share_a_corner_are_one_touch():
    assert len(touches_in_image(image((1, 1, 1.0), (2, 2, 1.0)), GRID.index, XY, 0.5)) == 1
    assert len(touches_in_image(image((1, 1, 1.0), (3, 3, 1.0)), GRID.index, XY, 0.5)) == 2


def test_threshold_drops_the_weak_and_the_sign_is_obeyed():
    values = image((1, 1, 1.0), (5, 5, 0.4), (3, 7, -5.0))
    assert len(touches_in_image(values, GRID.index, XY, 0.5)) == 1
    assert len(touches_in_image(values, GRID.index, XY, 0.3)) == 2
    assert touches_in_image(values, GRID.index, XY, 0.5, sign=-1) == pytest.approx(
        np.array([[35.0, 75.0]])
    )
    assert touches_in_image(np.zeros(64), GRID.index, XY, 0.5).shape == (0, 2)
