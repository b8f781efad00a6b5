"""The study of the constants: a build of the core in which they are variables, which gives the
product's bits, and what a changed constant does."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from eitskin.errors import UsageError
from eitskin_studies.experiments import constants
from eitskin_studies.experiments.constants import protected
from eitskin_studies.experiments.constants.judged import FrameScene, Score
from eitskin_studies.experiments.constants.models import of_other_models
from eitskin_studies.experiments.constants.scenes import SceneMaker
from eitskin_studies.experiments.constants.sweep import (
    Effect,
    baselines,
    effects_of,
    judges_of,
    numbers_of,
)
from eitskin_studies.experiments.constants.tables import any_change, harm, tables_of, words_of
from eitskin_studies.experiments.constants.variant import (
    WRITTEN_OUT,
    Constant,
    Variant,
    build_variant,
    constants_of,
)
from eitskin_studies.experiments.experiment import ExperimentOutcome
from study_pages import fills_its_page, workspace

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def variant(tmp_path_factory) -> Variant:
    return build_variant(tmp_path_factory.mktemp("variant"), ROOT)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> list[FrameScene]:
    """Three kinds that need no forward model beyond one set, and a calibrated model."""
    maker = SceneMaker.of(workspace(tmp_path_factory.mktemp("constants"), 0.1))
    rest = maker.model.golden.reference_v.astype(np.float64)
    touched = maker.model.golden.frame_v.astype(np.float64)
    noise = 1e-4 * np.abs(rest).max() * np.random.default_rng(1).standard_normal((17, len(rest)))
    made = FrameScene(
        "discs_1_to_3", "golden", maker.blob, rest + noise[:16], (touched + noise[16])[None],
        (None,),
    )  # fmt: skip
    streamed = replace(made, kind="stream", stream=True, track=True)
    return [made, streamed, *of_other_models(maker, [made])]


def named(variant: Variant, name: str) -> Constant:
    return next(one for one in variant.constants if one.name == name)


@pytest.mark.long("the tables and the list of the constants, below")
def test_the_variant_has_the_products_bits_and_knows_what_is_used(variant, scenes):
    known = baselines(variant, scenes)
    used = set().union(*(one.used for one in known))
    for name in ("MAX_ROW_GAIN", "TOUCH_EVIDENCE", "TRACK_DETECTION", "MAX_GAIN"):
        assert named(variant, name).place in used, name
    assert named(variant, "SWIPE_MM").place not in used
    assert named(variant, "TRACK_DETECTION").place not in known[0].used


@pytest.mark.long("the tables and the list of the constants, below")
def test_a_changed_constant_changes_the_scenes_that_it_decides(variant, scenes):
    known = baselines(variant, scenes)
    force = effects_of(named(variant, "MAX_GAIN"), variant, scenes, known)
    assert [one.value for one in force] == [2.0, 8.0]
    assert all(set(one.kinds) <= {"forces"} for one in force)
    unused = effects_of(named(variant, "SWIPE_MM"), variant, scenes, known)
    assert not any_change({"SWIPE_MM": unused}, named(variant, "SWIPE_MM"))
    assert unused[0].used == 0
    assert baselines(variant, scenes[:1])[0].digest == known[0].digest  # the table's values again


def test_every_constant_of_the_core_is_in_the_study():
    listed = constants_of(ROOT)
    assert {one.name for one in listed} >= {"MAX_ROW_GAIN", "LOST_US", *WRITTEN_OUT}
    assert not any(one.module == "firmware" for one in listed)
    zero = replace(listed[0], value=0.0)
    odd = replace(listed[0], value=5.0, whole=True)
    assert zero.changed() == (-1.0, 1.0) and odd.changed() == (2.0, 10.0)


def test_the_tables_rank_by_harm_and_fill_the_page(tmp_path):
    constants = constants_of(ROOT)
    before = dict.fromkeys(numbers_of(Score()), 100.0)
    bad = Effect(1.0, 5, 5, {"crowds": 5}, before, {**before, "exact": 90.0})
    assert harm(bad) == pytest.approx(10.0) and harm(Effect(1.0, 0)) == 0.0
    effects = {one.name: [Effect(value, 3) for value in one.changed()] for one in constants}
    effects["LOST_US"] = [bad, bad]
    tables = tables_of(constants, effects, {"MAX_GAIN": ["force_f32"]}, "abc")
    most = next(one for one in tables if one.name == "most")
    assert most.rows[0][0] == "`LOST_US`" and len(most.rows) == 20
    facts = {"commit": "abc", "seconds": 60}
    outcome = ExperimentOutcome(tables, {}, {}, words_of(constants, effects, [], facts))
    text = fills_its_page(outcome, "constants", tmp_path)
    assert "| force |" in text and "Commit abc" in text and "`MAX_ROW_GAIN`" in text


def test_scores_add_up():
    one = Score(frames=1, exact=1, errors_mm=[0.5], macs=10)
    one.add(Score(frames=1, errors_mm=[1.5], macs=5))
    assert one == Score(frames=2, exact=1, errors_mm=[0.5, 1.5], macs=15)


def test_a_run_without_the_c_tests_is_refused_before_anything_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr(protected, "checkout_root", lambda: tmp_path)
    with pytest.raises(UsageError, match="cmake --preset host"):
        constants.run(workspace(tmp_path / "out"))
    assert not (tmp_path / "out" / "variant").exists()


def test_the_tracker_and_its_search_are_judged_by_scenes_drive_by_drive_alone():
    scenes = [SimpleNamespace(module=module) for module in (None, "fast", "gesture")]
    for module, places in (("search", [1]), ("fast", [1]), ("gesture", [0, 2]), ("solve", [0])):
        constant = next(one for one in constants_of(ROOT) if one.module == module)
        assert judges_of(constant, scenes) == places
