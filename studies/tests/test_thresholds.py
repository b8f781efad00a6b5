"""Thresholds that are chosen on training scenes: the curve of MIoU and its best value, the best
threshold of touches; equal discs at a distance."""

import numpy as np
import pytest

from eitskin.errors import GeometryError, UsageError
from eitskin.fem.grid import grid_for
from eitskin.scoring import metrics
from eitskin.skin.outline import disk, polygon
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.thresholds import (
    THRESHOLDS,
    best_threshold,
    best_touch_threshold,
    miou_curves,
)

PAPER = disk(194.0)
SQUARE = polygon([(0, 0), (30, 0), (30, 30), (0, 30)])


@pytest.mark.parametrize("lookup", metrics.LOOKUPS)
def test_curves_equal_masks_on_the_raster(lookup):
    outline = disk(60.0)
    grid = grid_for(outline, 12)
    image_scorer = metrics.judge_for(outline, grid, 1.0, lookup)
    generator = np.random.default_rng(5)
    images = generator.normal(size=(7, grid.n_pixels))
    images[5] = -np.abs(images[5])
    images[6] = 0.0
    centres = generator.uniform(-20, 20, size=(7, 2))
    points = image_scorer.raster.points_mm
    truths = np.stack([metrics.disc_mask(points, [c], [6.0]) for c in centres])
    truths[4] = False
    thresholds = [0.0, 0.3, 0.8, 1.0]
    for sign in (1, -1):
        curves = miou_curves(image_scorer, images, truths, thresholds, sign)
        for k in range(7):
            top = (sign * images[k]).max()
            for j, t in enumerate(thresholds):
                shown = (sign * image_scorer.lookup.show(images[k]) > t * top) & (top > 0)
                assert curves[k, j] == pytest.approx(metrics.miou(shown, truths[k]), abs=1e-12)


def test_nearest_curve_is_the_pixel_mask_spread_over_cells():
    grid = grid_for(SQUARE, 6)
    image_scorer = metrics.judge_for(SQUARE, grid, 1.0, "nearest")
    image = np.random.default_rng(2).uniform(size=36)
    truth = metrics.disc_mask(image_scorer.raster.points_mm, [[12, 17]], [6])
    mask = metrics.touch_mask(image, 0.6)[image_scorer.lookup.pixel[:, 0]]
    found = miou_curves(image_scorer, image[None], truth[None], [0.6])[0, 0]
    assert found == pytest.approx(metrics.miou(mask, truth))


def test_a_perfect_image_is_limited_by_its_pixels_only():
    """A perfect image of 32 pixels has an MIoU below 1; if pixels are cells of the raster, it has
    1."""
    outline = disk(194.0)
    grid = grid_for(outline)
    raster = metrics.raster_inside(outline)
    discs = [([[x, y]], [9.0]) for x in (-40.0, 3.0, 33.0) for y in (-21.0, 11.0)]
    truths = np.stack([metrics.disc_mask(raster.points_mm, *d) for d in discs])
    perfect = np.stack([metrics.pixel_cover(grid, *d) for d in discs])
    score = {}
    for kind in metrics.LOOKUPS:
        curves = miou_curves(metrics.judge_for(outline, grid, lookup=kind), perfect, truths)
        score[kind] = curves.mean(axis=0).max()
    assert 0.83 < score["nearest"] < 0.90
    assert 0.95 < score["bilinear"] < 0.99
    fine = grid_for(SQUARE, 20)
    image_scorer = metrics.judge_for(SQUARE, fine, lookup="nearest")
    truth = metrics.disc_mask(image_scorer.raster.points_mm, [[12, 17]], [6])[None]
    assert miou_curves(image_scorer, truth.astype(float), truth, [0.5])[0, 0] == 1.0


def test_curves_refuse_what_they_cannot_judge():
    image_scorer = metrics.judge_for(SQUARE, grid_for(SQUARE, 6))
    truths = np.zeros((2, len(image_scorer.raster.points_mm)), dtype=bool)
    broken = np.zeros((2, 36))
    broken[1, 3] = np.nan
    for images, thresholds, said in (
        (np.zeros((2, 35)), [0.5], r"\(2, 36\)"),
        (np.zeros((2, 36)), [0.5, 0.4], "ascend"),
        (broken, [0.5], "image 1"),
    ):
        with pytest.raises(UsageError, match=said):
            miou_curves(image_scorer, images, truths, thresholds)


def test_best_threshold_is_the_best_mean_and_the_lowest_of_equals():
    curves = np.array([[0.2, 0.9, 0.5, 0.5], [0.2, 0.1, 0.6, 0.6]])
    assert best_threshold(curves, [0.1, 0.2, 0.3, 0.4]) == 0.3
    assert (THRESHOLDS[0], THRESHOLDS[-1], len(THRESHOLDS)) == (0.02, 0.98, 49)


def test_best_threshold_counts_most_scenes_exactly():
    grid = grid_for(polygon([(0, 0), (80, 0), (80, 80), (0, 80)]), 8)

    def image(*pixels: tuple[int, int, float]) -> np.ndarray:
        values = np.zeros(64)
        for ix, iy, value in pixels:
            values[iy * 8 + ix] = value
        return values

    images = np.stack([image((1, 1, 1.0), (5, 5, 0.5)), image((2, 2, 1.0), (6, 6, 0.2))])
    truths = [np.array([[15.0, 15.0], [55.0, 55.0]]), np.array([[25.0, 25.0]])]
    steps = (0.1, 0.3, 0.4, 0.6)
    assert best_touch_threshold(images, truths, grid.index, grid.centres_mm(), steps) == 0.3


def test_spaced_touches_have_the_count_and_the_spacing():
    drawn = spaced_touches(PAPER, 3, 8, touches=7, spacing_radii=4.0)
    assert drawn.name == "7 at 4 radii-s3-n8"
    for scene in drawn.scenes:
        xy = scene.centres_mm()
        gaps = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))[np.triu_indices(7, 1)]
        assert len(xy) == 7 and gaps.min() >= 36.0
        assert {(t.radius_mm, t.contrast) for t in scene.touches} == {(9.0, 5.0)}


def test_discs_that_overlap_or_do_not_fit_are_refused():
    with pytest.raises(GeometryError, match="do not fit"):
        spaced_touches(disk(40.0), 0, 1, touches=5)
    with pytest.raises(UsageError, match="overlap"):
        spaced_touches(PAPER, 0, 1, touches=2, spacing_radii=1.5)
