"""The experiment on many touches: its scenes, its numbers, how it reports uncertainty, and
continuing an interrupted run."""

import math
from pathlib import Path

import numpy as np
import pytest

from eitskin.errors import GeometryError
from eitskin.scene.library_scenes import find_scene
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import multitouch
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.multitouch import measure
from eitskin_studies.experiments.multitouch.ambiguity import (
    FEATURES,
    ScoredFrame,
    calibration,
    features,
    fit_rule,
    nearest,
    reliability,
)
from eitskin_studies.experiments.multitouch.ceiling import STEP_MM, Truthful
from eitskin_studies.experiments.multitouch.cells import (
    MIXED,
    NARROW,
    RING,
    WIDE,
    Cell,
    draw,
    mixed_cells,
)
from eitskin_studies.experiments.multitouch.counts import auc, quantile, roc, score, share
from eitskin_studies.experiments.multitouch.variants import VARIANTS, SeenFrame
from study_pages import coarse, fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")

OUTLINE = paper_skin().outline


def _run(folder: Path) -> ExperimentOutcome:
    """All of it, on few scenes, a coarse mesh, and one cell of the ceiling."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measure, "CEILING_CELLS", ((WIDE, 6, 80.0),))
        return multitouch.run(coarse(folder, 0.01))


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> tuple[Path, ExperimentOutcome]:
    folder = tmp_path_factory.mktemp("multitouch")
    return folder, _run(folder)


def test_outcome_has_every_cell(done):
    outcome = done[1]
    tables = {table.name: table for table in outcome.tables}
    assert [row[0] for row in tables["exact-ring"].rows] == [str(k) for k in range(2, 13)]
    methods = {one["method"] for one in outcome.data["counts"]}
    assert methods >= {variant.name for variant in VARIANTS} and len(methods) == len(VARIANTS) + 3
    core = [one for one in outcome.data["counts"] if one["method"] == "default"]
    assert len(core) == 3 * (33 + 1 + 5) and all(one["kmac"] > 0 for one in core)
    single = next(one for one in core if one["places"] == "single" and one["snr_db"] == 80)
    assert single["exact"]["mean"] == 1 and single["median_mm"]["value"] < 1.5


def test_more_touches_are_harder(done):
    exact: dict[int, list[float]] = {}
    for one in done[1].data["counts"]:
        if one["method"] == "default" and one["places"] == NARROW:
            exact.setdefault(one["touches"], []).append(one["exact"]["mean"])
    assert np.mean([exact[k] for k in (2, 3)]) > np.mean([exact[k] for k in (11, 12)]) + 0.3


def test_it_goes_on_and_fills_its_page(done, tmp_path):
    goes_on(lambda: _run(done[0]), done[1])
    assert "| touches | default, 40 dB |" in fills_its_page(done[1], "multitouch", tmp_path)


def test_ring_is_that_of_the_library():
    library = find_scene("ring7").touches
    scene = draw(Cell(RING, 7, 1), OUTLINE, 1, 1).scenes[0]
    assert {(t.radius_mm, t.contrast) for t in scene.touches} == {(8.0, 9.0)} and len(library) == 7
    centres = scene.centres_mm()
    assert np.allclose(np.hypot(*centres.T), 60.0)
    steps = np.hypot(*(centres - np.roll(centres, 1, axis=0)).T)
    assert np.allclose(steps, 120 * math.sin(math.pi / 7))


@pytest.mark.parametrize(("geometry", "least_mm"), [(WIDE, 36.0), (NARROW, 22.5)])
def test_random_places_keep_their_distance(geometry, least_mm):
    for scene in draw(Cell(geometry, 12, 3), OUTLINE, 5, 3).scenes:
        centres = scene.centres_mm()
        apart = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
        apart = apart[np.triu_indices(12, 1)]
        assert apart.min() >= least_mm


def test_mixed_scenes_depend_on_seed_and_number_only():
    cell = mixed_cells()[1]
    draws = ((1, 26), (1, 5), (2, 5))
    many, few, other = (draw(cell, OUTLINE, seed, count) for seed, count in draws)
    assert many.scenes[:5] == few.scenes and many.scenes[0] != other.scenes[0]
    assert [len(scene.touches) for scene in many.scenes] == [k % 12 + 1 for k in range(26)]
    assert draw(mixed_cells()[0], OUTLINE, 1, 1).scenes[0].touches != many.scenes[0].touches
    assert cell.geometry == MIXED and len({t.radius_mm for t in many.scenes[23].touches}) == 12


def test_too_many_are_refused():
    with pytest.raises(GeometryError, match="do not fit"):
        draw(Cell(WIDE, 40, 1), OUTLINE, 1, 1)


def test_what_does_not_fit_is_said(tmp_path, monkeypatch):
    from eitskin_studies.experiments.multitouch.tables import exact_table
    from eitskin_studies.experiments.multitouch.test_data import TouchData

    monkeypatch.setattr(measure, "counting_cells", lambda: (Cell(WIDE, 40, 1),))
    monkeypatch.setattr(measure, "single_cell", lambda: Cell(WIDE, 41, 1))
    monkeypatch.setattr(measure, "uneven_cells", tuple)
    shop = workspace(tmp_path)
    counted = measure.count_all(TouchData(shop), shop)
    assert set(counted.unfit) == {(WIDE, 40), (WIDE, 41)} and not counted.scores
    twelve = measure.CountedScenes({}, {(WIDE, k): "full" for k in range(2, 13)})
    assert all("do not fit" in row[1] for row in exact_table(twelve, WIDE, "x").rows)


def test_wilson_interval():
    eight = share(8, 10)  # R: binom::binom.wilson(8, 10)
    assert eight.low == pytest.approx(0.4901625, abs=1e-6)
    assert eight.high == pytest.approx(0.9433178, abs=1e-6)
    assert share(0, 5).low == 0 and share(5, 5).high == 1 and math.isnan(share(0, 0).mean)


def test_score_of_places():
    truth = [np.array([[0.0, 0.0], [40.0, 0.0]]), np.array([[0.0, 0.0]])]
    found = [np.array([[1.0, 0.0], [40.0, 3.0]]), np.array([[30.0, 0.0]])]
    one = score(truth, found, [1000, 3000])
    assert (one.exact.hits, one.right.hits, one.recall.hits, one.recall.count) == (1, 2, 2, 3)
    assert one.false_a_scene == 0.5 and one.median_mm.value == 2.0
    assert (one.kmac, one.most_kmac) == (2.0, 3.0)
    assert math.isnan(quantile([], 0.5).value)


def test_area_under_roc():
    assert auc([0.1, 0.4, 0.35, 0.8], [False, False, True, True]) == 0.75
    assert auc([1, 1, 1], [True, False, False]) == 0.5 and math.isnan(auc([1.0], [True]))
    false, true = roc([0.1, 0.4, 0.35, 0.8], [False, False, True, True])
    assert float(np.trapezoid(true, false)) == pytest.approx(0.75)
    assert (false[-1], true[-1]) == (1, 1)


def _seen(places: list[tuple[float, float]], explained: list[float]) -> SeenFrame:
    x, y = ([place[axis] for place in places] for axis in (0, 1))
    strength = [2.0, 1.0][: len(x)]
    return SeenFrame(x, y, [9.0] * len(x), strength, explained, False, 0.04, 100.0, 1, 1)


def test_features_of_a_frame():
    two = _seen([(0.0, 0.0), (27.0, 0.0)], [0.5, 0.01])
    assert nearest(two) == pytest.approx(1.5)
    assert features(two, nearest(two), 9.0) == pytest.approx((2, 1.5, 1, 0.2, 10, 0.5))
    assert len(FEATURES) == 6
    sure = _seen([(0.0, 0.0)], [0.9])
    assert features(sure, nearest(sure), 9.0) == pytest.approx((1, 2, 1, 0.2, 10, 3))
    assert features(_seen([], []), math.inf, 9.0) == (0, 2, 1, 0, 10, 3)


def _frames(count: int, seed: int) -> list[ScoredFrame]:
    """Frames that are exact the more surely, the less is unexplained; other features are noise."""
    draws = np.random.default_rng(seed).uniform(size=(count, 8))
    made = []
    for row in draws:
        exact = bool(row[7] < 1 / (1 + math.exp(20 * (row[3] - 0.4))))
        made.append(ScoredFrame(60.0, 3, 3, exact, exact, False, 2.0, tuple(map(float, row[:6]))))
    return made


def test_rule_learns_what_matters():
    rule, test = fit_rule(_frames(1500, 1)), _frames(1500, 2)
    weights = np.abs(rule.weights)
    assert rule.weights[3] < 0 and weights.argmax() == 3
    assert weights[3] > 5 * np.delete(weights, 3).max()
    shown = calibration(test, rule.says(test))
    assert 0.93 < shown.exact_not_said.mean < 0.99 and shown.exact_said.mean < 0.6
    exact = np.array([one.exact for one in test])
    assert reliability(rule.chances(test), exact).error < 0.05
    none = (0.0, 2.0, 1.0, 9.0, 10.0, 3.0)
    nothing = ScoredFrame(60.0, 1, 0, False, False, False, math.inf, none)
    assert not rule.says([nothing])[0]


def test_reliability_of_known_chances():
    exact = np.arange(1000) % 10 < 7
    shown = reliability(np.full(1000, 0.7), exact)
    assert shown.error == pytest.approx(0) and shown.brier == pytest.approx(0.21)
    assert shown.truth[7].mean == 0.7 and math.isnan(shown.chance[0])


def test_nonlinear_fit_knows_its_slope():
    skin = paper_skin()
    fits = Truthful(skin, adjacent(skin.electrodes.count))
    # weak: an element's answer is linear
    at, contrasts = np.array([20.0, 30.0, 9.0, -40.0, 5.0, 8.0]), [1.2, 1.4]
    slope = fits._answer(at, contrasts)[1]
    for k in range(len(at)):
        step = STEP_MM * np.eye(len(at))[k]
        high, low = (fits._answer(at + side * step, contrasts)[0] for side in (1, -1))
        seen = (high - low) / (2 * STEP_MM)
        assert np.linalg.norm(slope[:, k] - seen) < 0.02 * np.linalg.norm(seen)
