"""GREIT's figures on images that are known; which methods are chosen; what a method keeps."""

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin.fem.grid import grid_for
from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene.simulate import Simulated
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare.baselines import LinearMethod
from eitskin_studies.compare.cost import cost, kept_bytes
from eitskin_studies.compare.families import Family
from eitskin_studies.compare.figures import TARGETS, figures, small_targets
from eitskin_studies.compare.run import named

SKIN = paper_skin()
GRID = grid_for(SKIN.outline, 64)


@pytest.fixture(scope="module")
def targets() -> Simulated:
    return small_targets(SKIN, adjacent(16), mesh_for_elements(SKIN, 1500))


def discs(targets: Simulated, shift: float = 1.0, radius_mm: float = 12.0) -> np.ndarray:
    places = [shift * scene.centres_mm() for scene in targets.touches.scenes]
    return np.array([pixel_cover(GRID, xy, np.array([radius_mm])) for xy in places])


def test_targets_are_small_and_spread_over_the_skin(targets):
    places = np.array([scene.centres_mm()[0] for scene in targets.touches.scenes])
    assert TARGETS <= len(places) <= 2 * TARGETS
    away = np.hypot(*places.T)
    assert away.max() < 97 - 9 and (away < 44).sum() == pytest.approx(len(places) / 4, abs=4)
    assert np.isfinite(targets.differences_v()).all()


def test_even_discs_at_the_right_places_are_perfect(targets):
    got = figures(GRID, discs(targets), targets)
    assert got.position_error_mm == pytest.approx(0, abs=0.3)
    assert got.resolution == pytest.approx(12 / 97, abs=0.02)
    assert got.shape_deformation < 0.06 and got.ringing == 0
    assert got.amplitude_spread < 0.1  # discs that leave the skin lose some


def test_what_is_shown_too_near_to_the_middle_has_a_positive_error(targets):
    near, far = (figures(GRID, discs(targets, shift), targets) for shift in (0.8, 1.1))
    assert near.position_error_mm > 5 and far.position_error_mm < -2


def test_negative_pixels_around_a_target_are_ringing(targets):
    rings = discs(targets) - 0.1 * (discs(targets, radius_mm=25.0) - discs(targets))
    wide = figures(GRID, rings, targets)
    assert 0.2 < wide.ringing < 0.5


def test_an_empty_image_gives_no_number(targets):
    got = figures(GRID, np.zeros((len(targets.frames_v), GRID.n_pixels)), targets)
    assert got.amplitude_spread == 0 and np.isnan(got.position_error_mm)


def families() -> list[Family]:
    return [
        Family("", (0.0,), lambda _, name=name: LinearMethod(name, np.eye(3)))
        for name in ("Tikhonov", "plain FISTA 30", "eitskin 60, image shown")
    ]


def test_methods_are_chosen_by_words_of_their_names():
    assert len(named(families(), [])) == 3
    chosen = named(families(), ["fista", "EITSKIN"])
    assert [one.make(0.0).name for one in chosen] == ["plain FISTA 30", "eitskin 60, image shown"]
    with pytest.raises(UsageError, match=r"--methods gpu: .*Tikhonov, plain FISTA 30"):
        named(families(), ["gpu"])


def test_what_a_method_keeps_and_takes():
    method = LinearMethod("one", np.ones((5, 3)))
    assert kept_bytes(method) == 5 * 3 * 8
    spent = cost(method, np.ones((4, 3)))
    assert spent.frame_ms > 0 and spent.kept_kb == 0.12
