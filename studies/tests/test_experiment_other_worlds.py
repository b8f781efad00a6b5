"""The study of other worlds: every set is scored, the worst come first, and an interrupted run
continues."""

from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from eitskin.scene.random_touches import TouchScene, TrueTouch
from eitskin.scene.touch_shape import named_shape
from eitskin_studies.experiments import other_worlds
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.other_worlds.ellipses import ellipses_of
from eitskin_studies.experiments.other_worlds.tables import HEADLINES
from eitskin_studies.experiments.registry import load
from eitskin_studies.worlds.simulate import WorldFactory, WorldScenes
from eitskin_studies.worlds.worlds import WORLDS
from study_pages import fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


def _run(folder: Path) -> ExperimentOutcome:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(other_worlds, "WorldFactory", partial(WorldFactory, elements=2000))
        return other_worlds.run(workspace(folder, 0.01))


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> tuple[Path, ExperimentOutcome]:
    folder = tmp_path_factory.mktemp("worlds")
    return folder, _run(folder)


def test_every_set_is_scored_and_the_worst_come_first(done):
    assert load("other-worlds") is other_worlds
    outcome = done[1]
    assert [one["name"] for one in outcome.data["scores"]] == list(WORLDS)
    images, fails, ellipses, holds, headline = outcome.tables
    with_touches = [one for one in outcome.data["scores"] if one["images"] is not None]
    assert [row[0] for row in images.rows] == [f"`{one['name']}`" for one in with_touches]
    assert len(with_touches) == sum(not name.startswith("no_touch") for name in WORLDS)
    assert all(0 < one["images"]["solver"]["mean"] <= 1 for one in with_touches)
    assert [row[0] for row in ellipses.rows[:2]] == ["`ellipses`", "`fingers`"]
    shares = [float(row[1].split(" %")[0]) for row in fails.rows]
    assert shares == sorted(shares) and max(shares) < 90
    assert len(fails.rows) + len(holds.rows) == len(WORLDS)
    assert [row[0] for row in headline.rows] == [what for what, *_ in HEADLINES]
    assert outcome.words["summary"].startswith(f"In {len(fails.rows)} of {len(WORLDS)} sets")


def test_a_finished_run_is_read_again_and_fills_its_page(done, tmp_path):
    folder, outcome = done
    goes_on(lambda: _run(folder), outcome)
    page = fills_its_page(outcome, "other-worlds", tmp_path)
    assert page.index("## What fails") < page.index("## What holds")


def test_an_ellipse_is_off_by_its_angle_and_aspect_from_the_true_one():
    radians = np.radians(170.0)
    one = WORLDS["ellipses"]
    true = TrueTouch(5.0, -8.0, 9.0, 4.0, named_shape("ellipse", 2.0, -20.0))
    long_mm = 9.0 * np.sqrt(1.8)  # aspect 1.8, turned by ten degrees more
    found = SimpleNamespace(x_mm=5.0, y_mm=-8.0, radius_mm=9.0)
    found.long_x_mm, found.long_y_mm = long_mm * np.cos(radians), long_mm * np.sin(radians)
    disc = SimpleNamespace(x_mm=5.0, y_mm=-8.0, radius_mm=9.0, long_x_mm=0.0, long_y_mm=None)
    frame = np.zeros((2, 1))
    scenes = (TouchScene("a", (true,)),) * 2
    of = WorldScenes("made", one, scenes, frame[:, None], frame, frame[:, 0])
    answers = iter([[found], [disc]])
    seen = ellipses_of(lambda *_: next(answers), of)
    assert seen["matched"] == 2 and len(seen["said"]) == 1
    angle, aspect, as_disc, as_ellipse = seen["said"][0]
    assert (angle, aspect) == pytest.approx((10.0, 0.1), abs=1e-3)
    # a disc and an ellipse of aspect a, of one area, share 4/pi atan(a^-1/2) of it
    both = 4 / np.pi * np.arctan(2.0**-0.5)
    assert as_disc == pytest.approx(both / (2 - both), abs=0.01) and as_disc < as_ellipse < 1
