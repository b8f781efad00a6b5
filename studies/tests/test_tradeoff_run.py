"""The measurement of the trade-off on tiny sets: its numbers, continuing after a kill, and frames
that have the stated properties."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import EitskinError, UsageError
from eitskin.fem.mesh import mesh_for_elements
from eitskin.model.build import with_model_errors
from eitskin.progress import silent
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.skin.uncertainty import DEFAULT_UNCERTAINTY
from eitskin.tuning.configuration import Configuration
from eitskin.tuning.front import Conditions, Front, front_from
from eitskin_studies.harness.sessions import FrameSession, copied
from eitskin_studies.tradeoff.engines import ModelShop
from eitskin_studies.tradeoff.fronts import as_dict, to_json
from eitskin_studies.tradeoff.run import RESULTS, RunSettings, run
from eitskin_studies.tradeoff.scene_sets import SETS, SceneFactory
from eitskin_studies.tradeoff.table import best_points, to_csv, to_text

pytestmark = pytest.mark.long(
    "test_tradeoff_front.py, test_the_recommended_model_is_the_measured_one"
)

SKIN, ELEMENTS = paper_skin(), 1200
TINY = RunSettings(6, 4, 2, ("pairs", "drift"), (40.0, 60.0), 5, ELEMENTS, 0, 2, 1, 2, False)
WARM = {"warm_start": True, "scan": "reciprocal", "storage": "i8"}
PAIR = (
    Configuration("cheap", rank=24, pixels=14, iterations=8),
    Configuration("expensive", rank=48, pixels=24, iterations=60, lambda_rel=0.01),
    Configuration("warm", rank=48, pixels=24, iterations=15, **WARM),
)


def test_models_get_the_errors_that_each_alone_would_get():
    shop = ModelShop(SKIN, adjacent(16))
    uncertainty = replace(DEFAULT_UNCERTAINTY, samples=2)
    alone = [
        with_model_errors(shop.build(one).model, SKIN, uncertainty).model_errors for one in PAIR[:2]
    ]
    shop.draw_errors(PAIR[:2], 2, silent)
    for one, expected in zip(PAIR, alone, strict=False):
        found = shop.build(one).model.model_errors
        for name in ("error", "drift"):
            want = getattr(expected, name)
            assert np.abs(getattr(found, name) - want).max() < 1e-5 * np.abs(want).max()
        assert found.rms_error == expected.rms_error


def comparable(front: Front) -> Any:
    """Everything but the times of this host."""
    values = json.loads(to_json(as_dict(front)))
    for point in values["points"]:
        point["host_us"] = None
    return values["points"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("tradeoff")


@pytest.fixture(scope="module")
def front(folder) -> Front:
    return run(PAIR, TINY, folder, silent)


def test_every_configuration_is_measured_on_every_set(front):
    assert [one.name for one in front.points] == ["cheap", "expensive", "warm"]
    for one in front.points:
        of = {name: set(cells) for name, cells in one.scores.items()}
        assert of == {"random": {"40", "60"}, "pairs": {"60"}, "drift": {"60"}}
        score = one.score(Conditions())
        assert score is not None and score["scenes"] == 6
        assert 0.4 < score["image"]["worst_tenth"] <= score["image"]["mean"] < 1
        assert score["image"]["low"] <= score["image"]["mean"] <= score["image"]["high"]
        assert one.instructions is None or one.instructions["kind"] == "estimated"
        assert one.host_us is not None and 0 < one.host_us["p50"] <= one.host_us["p99"]
    cheap, expensive, warm = front.points
    where = Conditions()
    assert (cheap.accuracy(where) or 1) < (expensive.accuracy(where) or 0)
    assert (cheap.macs(where) or (9e9,))[0] < (expensive.macs(where) or (0,))[0]
    assert cheap.costs["flash_bytes"] < expensive.costs["flash_bytes"]
    assert warm.costs["flash_bytes"] < expensive.costs["flash_bytes"]
    assert (expensive.costs["acquisition_us"], warm.costs["acquisition_us"]) == (20_800, 10_400)
    assert expensive.score(where)["iterations"] == 60
    assert best_points(front.points, where) == [cheap, expensive]


def test_tables_hold_a_row_a_cell(front):
    lines = to_csv(front).splitlines()
    assert len(lines) == 1 + 3 * (2 + 1 + 1)
    named = "image_mean discs_worst_tenth force_error_median host_p50_us threshold"
    assert set(named.split()) <= set(lines[0].split(","))
    assert all(line.count(",") == lines[0].count(",") for line in lines)
    again = front_from(json.loads(to_json(as_dict(front))), "file")
    assert comparable(again) == comparable(front)
    assert "* expensive" in to_text(front, Conditions())


def test_a_second_run_measures_nothing(front, folder):
    before = (folder / RESULTS).read_bytes()
    again = run(PAIR, TINY, folder, silent)
    assert to_json(as_dict(again)) == to_json(as_dict(front))
    assert (folder / RESULTS).read_bytes() == before


@pytest.mark.parametrize("cut", [0.3, 0.7, 0.95])
def test_a_run_that_was_cut_goes_on_to_the_same_table(front, folder, tmp_path, cut):
    """Cut anywhere, also within a line."""
    whole = (folder / RESULTS).read_bytes()
    (tmp_path / RESULTS).write_bytes(whole[: int(cut * len(whole))])
    assert comparable(run(PAIR, TINY, tmp_path, silent)) == comparable(front)
    kept = {json.loads(line)["key"] for line in whole.splitlines()}
    good, torn = [], 0
    for line in (tmp_path / RESULTS).read_bytes().splitlines():
        try:
            good.append(json.loads(line)["key"])
        except ValueError:
            torn += 1
    assert sorted(good) == sorted(kept) and torn <= 1


def session(name: str) -> FrameSession:
    return SceneFactory(SKIN, adjacent(16), 5, ELEMENTS).session(name, 3, silent)


def test_random_scenes_are_those_of_compare():
    touches, mesh = random_touches(SKIN.outline, 5, 3, "test"), mesh_for_elements(SKIN, ELEMENTS)
    theirs = simulate(SKIN, adjacent(16), touches, mesh=mesh)
    ours = session("random").measured(60.0, 80, "full", 1)
    assert np.array_equal(ours.untouched_v, theirs.untouched_v)
    assert np.array_equal(ours.frames_v[:, 0], theirs.frames_v)
    held = session("random").measured(60.0, 80, "full", 4)
    assert np.array_equal(held.frames_v[:, -1], theirs.frames_v)
    assert not np.array_equal(held.frames_v[:, 0], held.frames_v[:, -1])


def test_noise_falls_with_the_root_of_the_samples_and_stays_the_same_noise():
    one = session("random")
    noise = {
        s: one.measured(40.0, s, "full", 1).frames_v[:, 0] - one.exact_v for s in (20, 80, 320)
    }
    assert noise[20].std() / noise[80].std() == pytest.approx(2, rel=0.02)
    # the converter's steps stay
    assert noise[80].std() / noise[320].std() == pytest.approx(2, rel=0.1)
    assert np.corrcoef(noise[20].ravel(), noise[80].ravel())[0, 1] > 0.99
    fine = one.measured(80.0, 80, "full", 1).frames_v[:, 0] - one.exact_v
    expected = np.sqrt((one.exact_untouched_v**2).mean()) * 1e-4
    assert fine.std() == pytest.approx(expected, rel=0.15)


def test_a_reciprocal_scan_copies_what_it_does_not_measure():
    one = session("random")
    fold = one.protocol.reciprocal_pairs()
    full, half = (one.measured(60.0, 80, scan, 1) for scan in ("full", "reciprocal"))
    assert np.array_equal(half.frames_v[..., fold.first], full.frames_v[..., fold.first])
    copies = fold.sign * full.frames_v[..., fold.first]
    assert np.array_equal(half.frames_v[..., fold.second], copies)
    assert np.array_equal(half.untouched_v, copied(full.untouched_v, one.protocol))


@pytest.mark.parametrize("name", [name for name in SETS if name != "train"])
def test_sets_hold_what_they_say(name):
    outline = SKIN.outline
    drawn = SETS[name].draw(outline, 3, 4)
    assert len(drawn.scenes) == 4 and drawn.scenes[:2] == SETS[name].draw(outline, 3, 2).scenes
    numbers = {"single": 1, "pairs": 2, "three": 3, "six apart": 6, "six close": 6}
    wanted = {numbers[name]} if name in numbers else {1, 2} if name == "light" else {1, 2, 3}
    assert {len(scene.touches) for scene in drawn.scenes} <= wanted
    for scene in drawn.scenes:
        centres = scene.centres_mm()
        assert (np.hypot(*centres.T) + scene.radii_mm() <= 97).all()
        if len(centres) > 1:
            apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
            apart = apart[np.triu_indices(len(centres), 1)].min()
            least = {"pairs": 27.0, "six close": 27.0, "six apart": 45.0}.get(name, 12.0)
            assert apart >= least - 1e-9
            assert name not in ("pairs", "six close") or apart == pytest.approx(27.0)
    assert len({SETS[one].draw(outline, 3, 1).role for one in SETS}) == len(SETS)


def test_drift_is_in_the_frames_and_not_in_the_reference():
    drifting = session("drift")
    steady = replace(drifting, exact_v=drifting.exact_v)
    assert np.array_equal(steady.exact_untouched_v, drifting.exact_untouched_v)
    untouched_v = drifting.exact_untouched_v
    assert np.ptp(drifting.exact_v @ untouched_v / (untouched_v @ untouched_v)) > 0.002


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scenes": 0}, "scenes"),
        ({"sets": ("quads",)}, "quads"),
        ({"sets": ("random",)}, "random"),
        ({"snrs_db": (40.0,)}, "60 among them"),
        ({"snrs_db": (60.0, float("nan"))}, "SNRs"),
    ],
)
def test_bad_settings_are_refused(changes, said):
    with pytest.raises(UsageError, match=said):
        replace(TINY, **changes)


def test_a_rank_that_cannot_be_is_refused_before_the_work(tmp_path):
    with pytest.raises(EitskinError, match="'big': rank = 105 is out of range; use 1 to 104"):
        run([Configuration("big", rank=105)], TINY, tmp_path / "none", silent)
    assert not (tmp_path / "none").exists()
