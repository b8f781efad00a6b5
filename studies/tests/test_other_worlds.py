"""Sets of other worlds: scenes are drawn as their names say, families share no scenes, and scores
are right."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.errors import FrameError, UsageError
from eitskin.scoring.metrics import raster_inside
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.benchmarks import worlds as bench_worlds
from eitskin_studies.harness.numbers import file_of, stored_filling
from eitskin_studies.tradeoff.run import RunSettings
from eitskin_studies.tradeoff.scene_sets import SceneFactory
from eitskin_studies.worlds.score import as_text, score_set
from eitskin_studies.worlds.simulate import WorldFactory, draw_touches
from eitskin_studies.worlds.worlds import WORLDS
from study_pages import page_copy


@pytest.fixture(scope="module")
def factory():
    return WorldFactory(paper_skin(), adjacent(16), elements=1500)


def one_aspect(touch):
    return 1.0 if touch.shape is None else touch.shape.aspect


def test_scenes_depend_on_family_seed_and_number_alone(factory):
    few, more = (factory.scenes("fingers_mild_errors", count, 3) for count in (1, 2))
    other = factory.scenes("fingers_mild_errors", 1, 3, family="judging")
    assert np.array_equal(few.frames_v[0], more.frames_v[0]) and few.scenes[0] == more.scenes[0]
    assert few.scenes[0].touches[0] != other.scenes[0].touches[0]
    assert not np.array_equal(few.untouched_v, other.untouched_v)


def test_kept_frames_are_those_that_were_simulated(factory, tmp_path):
    first, again = (
        WorldFactory(factory.skin, factory.protocol, tmp_path, 1500).scenes("ellipses", 1, 5)
        for _ in range(2)
    )
    assert len(list(tmp_path.iterdir())) == 1
    assert np.array_equal(first.frames_v, again.frames_v)


@pytest.mark.parametrize("name", [n for n, w in WORLDS.items() if w.touches.count[1]])
def test_drawn_touches_are_within_the_ranges_of_their_set(name):
    kinds, skin = WORLDS[name].touches, paper_skin()
    for seed in range(5):
        touches = draw_touches(skin, kinds, np.random.default_rng(seed))
        assert kinds.count[0] <= len(touches) <= kinds.count[1]
        for one in touches:
            assert kinds.radius_mm[0] <= one.radius_mm <= kinds.radius_mm[1]
            assert kinds.aspect[0] <= one_aspect(one) <= kinds.aspect[1]
            flat_reach_mm = one.radius_mm * math.sqrt(one_aspect(one))
            assert math.hypot(one.x_mm, one.y_mm) + flat_reach_mm <= 97 - 4 + 1e-9
    if kinds.pair_mm is not None:
        apart = math.dist(*((one.x_mm, one.y_mm) for one in touches))
        assert kinds.pair_mm[0] <= apart <= kinds.pair_mm[1]


def test_each_error_changes_the_frames_that_it_should(factory):
    even = factory.scenes("no_touch_amplitude_drift_1_percent", 1, 2)
    ratio = even.frames_v[0] / even.untouched_v[0].mean(axis=0)
    large = np.abs(even.frames_v[0]) > 0.1 * np.abs(even.frames_v[0]).max()
    assert 1e-4 < abs(np.median(ratio[large]) - 1) < 0.04
    bare = factory.scenes("no_touch_noiseless", 1, 2)
    assert np.ptp(bare.untouched_v[0], axis=0).max() == 0
    assert 1e-9 < np.abs(bare.frames_v[0] / bare.untouched_v[0][0] - 1).max() < 1e-4


def test_scores_count_exact_false_missed_and_refused_scenes(factory):
    of = factory.scenes("eight_at_4_radii", 4, 1)
    answers = iter(range(4))

    def find(untouched_v, frame_v, step_v):
        k = next(answers)
        if k == 3:
            raise FrameError("rejected")
        true = [SimpleNamespace(**vars(t)) for t in of.scenes[k].touches]
        return [true, true[1:], [*true, SimpleNamespace(x_mm=500.0, y_mm=0.0, radius_mm=1.0)]][k]

    score = score_set(find, of)
    assert (score.exact.hits, score.scenes, score.refused) == (1, 4, 1)
    assert (score.false_per_scene, score.missed_per_scene) == (0.25, 9 / 4)
    assert (score.median_mm, score.radius_ratio) == (0.0, 1.0)
    assert score.exact.low < 0.25 < score.exact.high
    assert "eight_at_4_radii" in as_text([score])


def test_the_command_scores_the_core_on_the_sets_that_are_named(capsys):
    given = ["bench", "worlds", "--scenes", "2", "--sets", "no_touch", "--json"]
    assert main([*given, "--option", "lambda_rel=0.02", "--option", "second_pass=true"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["name"] == "no_touch" and row["scenes"] == 2
    assert row["exact"][0] >= 0.5


def test_fewer_columns_of_the_touch_test_cost_less(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_worlds, "LIMITED_SETS", ("drift_2_percent_light",))
    page = page_copy(tmp_path, "board-cost")
    assert main(["bench", "columns", "--scenes", "3", "--page", str(page)]) == 0
    _, (texts, tables) = stored_filling(file_of(page))
    assert "`eitskin bench columns --scenes 3 --seed 1`: 3 scenes" in texts["columns-run"]
    head, rows = tables["columns"]
    assert head[-1] == "`drift_2_percent_light`"
    assert [row[0] for row in rows] == ["0 (no limit)", "200", "30"]
    means = [float(row[1]) for row in rows]
    assert means[0] >= means[1] > means[2] > 0
    assert all(float(row[2]) >= float(row[1]) for row in rows)


@pytest.mark.parametrize(
    "given", [["--sets", "nowhere"], ["--option", "lambda=1"], ["--option", "iterations=many"]]
)
def test_the_command_refuses_unknown_sets_and_options(given, capsys):
    assert main(["bench", "worlds", *given]) == UsageError.exit_code
    assert "eitskin:" in capsys.readouterr().err


def test_tradeoff_has_sets_of_other_shapes_where_they_are_named(factory, tmp_path):
    assert not {"ellipses", "fingers", "gauss"} & set(RunSettings().sets)
    makes = SceneFactory(factory.skin, factory.protocol, 1, 1500, tmp_path)
    session = makes.session("fingers", 2, lambda items, what: items)
    raster = raster_inside(factory.skin.outline, 3.0)
    assert session.touches.scenes[0].touches[0].shape is not None
    assert session.truths(raster).any(axis=1).all()
    assert len(list(tmp_path.iterdir())) == 1
