"""Random scenes: seeds, independence, and the rules they keep."""

import numpy as np
import pytest

from eitskin.errors import GeometryError, UsageError
from eitskin.scene.random_touches import TouchRules, TouchScene, random_touches, rim_distance_mm
from eitskin.scene.streams import stream
from eitskin.skin.outline import disk, polygon

PAPER = disk(194.0)
FIVE = TouchRules((5, 5), (9.0, 9.0))
ELL = polygon([(0, 0), (120, 0), (120, 50), (50, 50), (50, 120), (0, 120)])


def test_streams_are_keyed_by_seed_name_and_index():
    draws = {
        key: tuple(stream(*key).integers(0, 2**62, 4))
        for key in [(1, "noise", 0), (1, "noise", 1), (1, "contact", 0), (2, "noise", 0)]
    }
    assert len(set(draws.values())) == 4
    assert draws[1, "noise", 0] == tuple(stream(1, "noise").integers(0, 2**62, 4))
    with pytest.raises(UsageError, match="0 or above"):
        stream(-1, "noise")


def test_stream_values_never_change():
    """A pinned draw: published numbers rest on it."""
    assert stream(7, "noise", 3).integers(0, 10**9, 3).tolist() == [737924335, 781653816, 288842614]


@pytest.mark.parametrize("outline", [PAPER, ELL])
def test_touches_keep_the_rules(outline):
    rules = TouchRules()
    scenes = random_touches(outline, 4, 60).scenes
    assert {len(s.touches) for s in scenes} == {1, 2, 3}
    for scene in scenes:
        xy, radii = scene.centres_mm(), scene.radii_mm()
        assert ((radii >= 6) & (radii <= 12)).all()
        assert all(3 <= t.contrast <= 10 for t in scene.touches)
        assert (rim_distance_mm(outline, xy) - radii >= rules.rim_margin_mm - 1e-9).all()
        for i in range(len(xy)):
            for j in range(i):
                assert np.hypot(*(xy[i] - xy[j])) >= radii[i] + radii[j] + rules.gap_mm - 1e-9


def test_the_same_seed_gives_the_same_set_and_a_shorter_one_is_its_start():
    one = random_touches(PAPER, 9, 30)
    assert one == random_touches(PAPER, 9, 30)
    assert random_touches(PAPER, 9, 10).scenes == one.scenes[:10]
    assert one.name == "test-s9-n30"


def test_seeds_and_roles_are_independent():
    sets = [random_touches(PAPER, s, 20, r) for s in (9, 10) for r in ("train", "test")]
    touches = [t for one in sets for scene in one.scenes for t in scene.touches]
    assert len(set(touches)) == len(touches)


def test_places_are_uniform_over_the_skin():
    """Half of the single small touches lie within radius R / sqrt(2), which is half of the area."""
    rules = TouchRules(count=(1, 1), radius_mm=(1.0, 1.0), rim_margin_mm=0.0)
    xy = np.concatenate([s.centres_mm() for s in random_touches(PAPER, 0, 600, rules=rules).scenes])
    inside = np.count_nonzero(np.hypot(*xy.T) < 96 / np.sqrt(2)) / 600
    assert inside == pytest.approx(0.5, abs=0.06)
    assert np.abs(xy.mean(axis=0)).max() < 6


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: random_touches(disk(40.0), 0, 1, rules=FIVE), GeometryError, "do not fit"),
        (lambda: random_touches(PAPER, 0, 0), UsageError, "at least 1 scene"),
        (lambda: TouchRules(radius_mm=(12.0, 6.0)), UsageError, "radius_mm"),
        (lambda: TouchRules(shape="fist"), UsageError, "shape 'fist'"),
        (lambda: TouchRules(aspect=(1.0, 2.0)), UsageError, "a disc has no aspect"),
        (lambda: TouchRules(shape="finger", aspect=(0.5, 2.0)), UsageError, "from 1 on"),
    ],
)
def test_what_cannot_be_is_refused(make, error, said):
    with pytest.raises(error, match=said):
        make()


def test_rim_distance_of_an_ell():
    points = [[10, 10], [60, 45], [60, 60], [25, 100], [50, 50.1]]
    assert rim_distance_mm(ELL, points) == pytest.approx([10, 5, -10, 20, 0], abs=0.11)
    assert rim_distance_mm(PAPER, [[90, 0], [0, 0]]) == pytest.approx([7, 97])


def test_shapes_are_drawn_apart_so_that_sizes_stay():
    discs = random_touches(disk(194), 3, 5)
    fingers = random_touches(disk(194), 3, 5, rules=TouchRules(shape="finger", aspect=(1.4, 2.2)))
    for disc_scene, finger_scene in zip(discs.scenes, fingers.scenes, strict=True):
        assert np.array_equal(disc_scene.radii_mm(), finger_scene.radii_mm())
        for touch in finger_scene.touches:
            assert touch.shape is not None and 1.4 <= touch.shape.aspect <= 2.2
            edge = touch.shape.rim_mm(touch.radius_mm) + np.array([touch.x_mm, touch.y_mm])
            assert np.hypot(*edge.T).max() <= 97 - 4 + 1e-9
    points = np.random.default_rng(1).uniform(-97, 97, (500, 2))
    touch = fingers.scenes[0].touches[0]
    inside = TouchScene("one", (touch,)).mask(points)
    offsets = points - (touch.x_mm, touch.y_mm)
    within = touch.shape.rho2(offsets[:, 0], offsets[:, 1], touch.radius_mm) <= 1
    assert np.array_equal(inside, within)
