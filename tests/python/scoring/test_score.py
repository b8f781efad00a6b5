"""Scores of one frame: perfect, empty and wrong results get what the metrics' definition gives
them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Info, Reconstruction
from eitskin.errors import ConfigError
from eitskin.frames.frames import Frames
from eitskin.scoring.metrics import pixel_cover
from eitskin.scoring.score import FrameScore, Scorer, scorer_for
from eitskin.skin.protocol import adjacent
from small_models import prebuilt, small_model

INFO = Info(60, "iterations", 0, 0, 0, 0, 0, 0, *[0.0] * 7)
PLACES = np.array([[-30.0, 20.0], [40.0, -10.0], [0.0, 60.0]])
RADII = np.array([12.0, 9.0, 10.0])
SIGNS = np.array([1, 1, -1])


def frames(**changes: object) -> Frames:
    """Three frames: two touches (and a resistive one), nothing known, one touch."""
    fields = {
        "touch_frame": np.array([0, 0, 0]),
        "touch_xy_mm": PLACES,
        "touch_radius_mm": RADII,
        "touch_sign": SIGNS,
    }
    return Frames(adjacent(16), np.ones((2, 208)), np.ones((1, 208)), **(fields | changes))


def result(
    touches: list[tuple[float, float, float]], discs: list[int], polarity: float = 1.0
) -> Reconstruction:
    """An image of how much the discs numbered ``discs`` cover of each pixel, and ``touches`` (x, y,
    radius)."""
    grid = prebuilt()[0].grid
    cover = pixel_cover(grid, PLACES[discs], RADII[discs])
    found = tuple(Touch(k, x, y, r, polarity, 1.0) for k, (x, y, r) in enumerate(touches))
    return Reconstruction(polarity * cover, cover, found, INFO)


def put(*numbers: int, off: float = 0.0) -> list[tuple[float, float, float]]:
    return [(PLACES[k, 0] + off, PLACES[k, 1], RADII[k]) for k in numbers]


@cache
def scorer() -> Scorer:
    return scorer_for(prebuilt()[0])


def scored(one: Reconstruction, sign: str = "increase", **changes: object) -> FrameScore | None:
    return scorer().score(frames(**changes), 0, one, sign)


def test_a_perfect_result():
    score = scored(result(put(0, 1), [0, 1]))
    assert score.miou_touches == 1
    assert score.miou_image > 0.85
    assert score.matching.exact and score.matching.distances_mm == (0, 0)


def test_found_touches_are_paired_whatever_their_order():
    score = scored(result(put(1, 0, off=3.0), [0, 1]))
    assert score.matching.pairs == ((0, 1), (1, 0))
    assert score.matching.distances_mm == pytest.approx((3, 3))
    assert 0.7 < score.miou_touches < 0.95


def test_the_gate_and_what_lies_beyond():
    assert scorer().gate_mm == pytest.approx(10)
    for off, hits in ((9.9, 2), (10.1, 0)):
        found = scored(result(put(0, 1, off=off), [0, 1])).matching
        assert (found.hits, found.misses, found.false_touches) == (hits, 2 - hits, 2 - hits)


def test_an_empty_result_has_half_the_background():
    """Nothing shown: IoU of the touch is 0, of the background the share of it."""
    score = scored(Reconstruction(np.zeros(812), np.zeros(812), (), INFO))
    share = np.pi * (RADII[:2] ** 2).sum() / (np.pi * 97**2)
    assert score.miou_image == score.miou_touches == pytest.approx((1 - share) / 2, rel=0.01)
    assert (score.matching.hits, score.matching.misses) == (0, 2)


def test_only_the_wanted_sign_counts():
    score = scored(result(put(2), [2], -1.0), "decrease")
    assert score.miou_touches == 1 and score.matching.exact and score.miou_image > 0.85
    both = scored(result(put(0, 1, 2), [0, 1, 2]), "both")
    assert both.matching.hits == 3 and both.miou_touches == 1 and both.miou_image > 0.85
    increases = frames(touch_sign=np.array([1, 1, 1]))
    assert scorer().score(increases, 0, result([], []), "decrease") is None


def test_unknown_signs_are_touches():
    score = scored(result(put(0, 1, 2), [0, 1, 2]), touch_sign=np.zeros(3))
    assert score.matching.hits == 3


def test_frames_of_which_nothing_is_known():
    assert scorer().score(frames(), 1, result([], []), "increase") is None
    nothing = dict.fromkeys(("touch_frame", "touch_xy_mm", "touch_radius_mm", "touch_sign"))
    assert scorer().score(frames(**nothing), 0, result([], []), "increase") is None


def test_a_mask_is_the_truth_where_there_is_one():
    """A mask of the left half over the whole skin, row 0 lowest."""
    mask = np.zeros((2, 64, 64), dtype=np.int8)
    mask[0, :, :32] = 1
    mask[1, :32] = -1
    given = frames(truth_mask=mask, truth_mask_extent_mm=(-97.0, -97.0, 97.0, 97.0))
    centres = prebuilt()[0].grid.centres_mm()
    left = Reconstruction((centres[:, 0] < 0).astype(float), np.zeros(812), (), INFO)
    low = Reconstruction(-(centres[:, 1] < 0).astype(float), np.zeros(812), (), INFO)
    for number, image, sign in ((0, left, "increase"), (1, low, "decrease")):
        score = scorer().score(given, number, image, sign)
        assert score.miou_image > 0.95
    assert scorer().score(given, 1, left, "increase") is None


def test_lengths_scale_with_the_skin():
    smaller = scorer_for(small_model())
    assert smaller.gate_mm == pytest.approx(10 * 100 / 194)
    assert smaller.image_scorer.raster.spacing_mm == pytest.approx(1.5 * 100 / 194)


def test_a_model_that_says_nothing_of_its_skin():
    with pytest.raises(ConfigError):
        scorer_for(replace(prebuilt()[0], meta={}))
