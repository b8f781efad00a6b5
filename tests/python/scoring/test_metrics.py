"""MIoU by hand and by masks; rasters, lookups, and the perfect image of discs."""

import math

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.scoring import metrics
from eitskin.skin.outline import disk, polygon

SQUARE = polygon([(0, 0), (30, 0), (30, 30), (0, 30)])


def test_iou_of_masks_worked_by_hand():
    truth = np.array([1, 1, 1, 0, 0, 0, 0, 0, 0, 0], dtype=bool)
    estimate = np.array([0, 1, 1, 1, 0, 0, 0, 0, 0, 0], dtype=bool)
    assert metrics.iou(estimate, truth) == pytest.approx(2 / 4)
    assert metrics.iou(~estimate, ~truth) == pytest.approx(6 / 8)
    assert metrics.miou(estimate, truth) == pytest.approx((2 / 4 + 6 / 8) / 2)
    assert metrics.miou(truth, truth) == 1.0


def test_empty_masks_agree_and_a_false_touch_does_not():
    none, one = np.zeros(10, dtype=bool), np.eye(1, 10, dtype=bool)[0]
    assert metrics.miou(none, none) == 1.0
    assert metrics.miou(one, none) == pytest.approx((0 + 9 / 10) / 2)
    assert metrics.miou(none, one) == pytest.approx((0 + 9 / 10) / 2)


def test_overlap_of_two_discs_matches_the_lens_formula():
    """Two circles of radius r at distance d share 2 r^2 acos(d/2r) - d/2 sqrt(4r^2 - d^2)."""
    raster = metrics.raster_inside(disk(100.0), 0.25)
    radius, apart = 12.0, 9.0
    a = metrics.disc_mask(raster.points_mm, [[-apart / 2, 3.0]], [radius])
    b = metrics.disc_mask(raster.points_mm, [[apart / 2, 3.0]], [radius])
    lens = 2 * radius**2 * math.acos(apart / (2 * radius)) - apart / 2 * math.sqrt(
        4 * radius**2 - apart**2
    )
    union = 2 * math.pi * radius**2 - lens
    whole = math.pi * 50.0**2
    touch, rest = lens / union, (whole - union) / (whole - lens)
    assert metrics.iou(a, b) == pytest.approx(touch, abs=2e-3)
    assert metrics.miou(a, b) == pytest.approx((touch + rest) / 2, abs=2e-3)


def test_raster_has_the_area_of_the_skin_and_stays_inside():
    raster = metrics.raster_inside(disk(194.0))
    assert raster.spacing_mm == 1.5
    assert len(raster.points_mm) * 1.5**2 == pytest.approx(math.pi * 97.0**2, rel=2e-3)
    assert np.hypot(*raster.points_mm.T).max() <= 97.0
    assert len(metrics.raster_inside(SQUARE, 3.0).points_mm) == 100


@pytest.mark.parametrize(("spacing_mm", "said"), [(0.0, "above 0"), (100.0, "no cell inside")])
def test_bad_rasters_are_refused(spacing_mm, said):
    with pytest.raises(UsageError, match=said):
        metrics.raster_inside(SQUARE, spacing_mm)


def test_mask_lookup_keeps_the_lowest_row_below():
    mask = np.array([[1, 0], [0, 0]], dtype=bool)
    points = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [-1.5, -0.5]])
    found = metrics.mask_on_points(points, mask, (-1, -1, 1, 1)).tolist()
    assert found == [True, False, False, False, False]


def test_nearest_lookup_shows_the_containing_pixel_or_the_next_at_the_rim():
    grid = grid_for(disk(194.0))
    raster = metrics.raster_inside(disk(194.0))
    lookup = metrics.lookup_for(raster.points_mm, grid, "nearest")
    assert lookup.pixel.shape == (len(raster.points_mm), 1) and (lookup.weight == 1).all()
    containing = grid.locate(raster.points_mm)
    within = (raster.points_mm - grid.origin_mm) / grid.pixel_mm % 1  # of a pixel
    at_edge = np.abs(within - 0.5).max(axis=1) > 0.5 - 1e-9
    clear = (containing >= 0) & ~at_edge
    assert np.count_nonzero(clear) > 0.9 * len(clear)
    assert (lookup.pixel[clear, 0] == containing[clear]).all()
    gap = np.hypot(*(raster.points_mm - grid.centres_mm()[lookup.pixel[:, 0]]).T)
    assert gap.max() < 1.5 * grid.pixel_mm


def test_bilinear_lookup_is_exact_for_a_plane_and_for_a_constant():
    grid = grid_for(disk(194.0))
    raster = metrics.raster_inside(disk(194.0))
    lookup = metrics.lookup_for(raster.points_mm, grid, "bilinear")
    assert lookup.show(np.full(grid.n_pixels, 3.5)) == pytest.approx(3.5)
    x, y = grid.centres_mm().T
    inner = np.hypot(*raster.points_mm.T) < 85
    plane = lookup.show(2 * x - 3 * y + 1)[inner]
    assert plane == pytest.approx((raster.points_mm @ [2, -3] + 1)[inner], abs=1e-9)
    assert ((lookup.weight >= 0).all(), lookup.weight.sum(axis=1)) == (True, pytest.approx(1.0))
    both = lookup.show(np.stack([x, y]))
    assert both.shape == (2, len(raster.points_mm))


def test_unknown_lookup_is_refused():
    with pytest.raises(UsageError, match="nearest, bilinear"):
        metrics.lookup_for(np.zeros((1, 2)), grid_for(SQUARE, 4), "cubic")


def test_touch_mask_is_strict_and_signed():
    values = np.array([0.0, 0.5, 1.0, -2.0])
    assert metrics.touch_mask(values, 0.5).tolist() == [False, False, True, False]
    assert metrics.touch_mask(values, 0.49).tolist() == [False, True, True, False]
    assert metrics.touch_mask(values, 0.5, sign=-1).tolist() == [False, False, False, True]
    assert not metrics.touch_mask(np.zeros(4), 0.5).any()
    assert not metrics.touch_mask(-np.ones(4), 0.0).any()


def test_pixel_cover_is_exact_in_area():
    grid = grid_for(disk(194.0))
    part = metrics.pixel_cover(grid, [[-40, 11], [20, 30]], [9, 7])
    assert part.sum() * grid.pixel_area_mm2 == pytest.approx(math.pi * (81 + 49), rel=5e-3)
    assert part.min() == 0 and part.max() == 1
