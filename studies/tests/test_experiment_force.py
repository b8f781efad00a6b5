"""The force study on few scenes: kept results are not computed again, each seed has results of its
own, and its physics is right."""

import json
from pathlib import Path

import numpy as np
import pytest

from eitskin_studies.experiments import force
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.force import anywhere, detection, scenes, sheet
from eitskin_studies.experiments.force.law import (
    GEL_LIMIT_KPA,
    NOMINAL,
    SHEET,
    WEIGHTS_G,
    drawn_laws,
)
from eitskin_studies.experiments.force.readouts import (
    PEAK,
    READOUTS,
    TOUCH,
    Readout,
    as_lists,
    from_lists,
)
from eitskin_studies.experiments.write import to_json
from study_pages import coarse, fills_its_page, goes_on

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> tuple[Path, ExperimentOutcome]:
    folder = tmp_path_factory.mktemp("force")
    return folder, force.run(coarse(folder, 0.01, 1500, seed=2))


def test_a_run_that_goes_on_computes_nothing_again(done):
    goes_on(lambda: force.run(coarse(done[0], 0.01, 1500, seed=2)), done[1], solves=True)


def test_every_table_has_its_place_on_the_page(done, tmp_path):
    outcome = done[1]
    names = "slopes anywhere by-load over-snr detection sheet-slopes smallest reach"
    assert [table.name for table in outcome.tables] == names.split()
    assert set(outcome.pictures) == {"curves.svg", "skin.svg", "detection.svg"}
    fills_its_page(outcome, "force", tmp_path)
    assert "Infinity" not in to_json(outcome) and "NaN" not in to_json(outcome)


def test_the_peak_falls_towards_the_centre_and_the_strength_does_not(done):
    slopes = {name: one["a_gram"] for name, one in json.loads(to_json(done[1]))["slopes"].items()}
    assert slopes[PEAK][0] < 0.3 * slopes[PEAK][-1]
    assert slopes[PEAK][0] < slopes[PEAK][1] < slopes[PEAK][2] < slopes[PEAK][3]
    assert slopes[TOUCH][0] == pytest.approx(slopes[TOUCH][-1], rel=0.35)  # on a coarse mesh


def test_calibrated_touches_read_one_load_alike(done):
    errors = {
        (one["reading"], one["snr_db"]): anywhere.Anywhere.from_dict(one)
        for one in done[1].data["anywhere"]
    }
    assert set(errors) == {(name, snr) for name in READOUTS for snr in force.SNRS_DB}
    touch, peak = errors[TOUCH, 72.0], errors[PEAK, 72.0]
    assert touch.found == 1 and touch.calibrated.shape == (8, len(WEIGHTS_G)) and touch.macs > 1e5
    assert anywhere.scatter(touch.calibrated) < 0.1 < 0.2 < anywhere.scatter(peak.raw)


def test_less_noise_shows_less_load(done):
    found = [detection.Detection.from_dict(one) for one in done[1].data["detection"]]
    thresholds = np.array([[one.threshold(radius)[0] for radius in range(4)] for one in found])
    assert (thresholds[0] > thresholds[-1]).all() and (thresholds[-1] < 20).all()
    assert thresholds[-1, 0] > thresholds[-1, 3]  # the centre needs more
    for one in found:
        share, upper = one.false_share()
        assert share < upper <= 1 and one.untouched == 80


def test_under_the_sheet_the_peak_rises_outwards_and_means_see_less(done):
    slopes, smallest, reach = done[1].tables[5:]
    rising = {row[0]: row[-2] for row in slopes.rows}
    assert rising[PEAK] == "yes" and len(smallest.rows) == 6
    least = {}
    for one in done[1].data["sheet"]["least"]:
        of, own = one["contact"], {k: v for k, v in one.items() if k not in ("contact", "mean_of")}
        least[of, one["snr_db"], one["mean_of"]] = detection.Detection.from_dict(own)
    for contact in ("sheet", "tip"):
        single, second = (least[contact, 50.0, n].threshold(0)[0] for n in (1, sheet.SECOND))
        assert second < 0.6 * single
    assert len(reach.rows) == len(sheet.MEANS)


# ---- pieces ----


def test_the_sheet_presses_with_what_the_papers_gel_stands():
    assert SHEET.pressure_kpa(200) == pytest.approx(5.16, abs=0.01)
    assert SHEET.pressure_kpa(scenes.SHEET_G[1]) < GEL_LIMIT_KPA < NOMINAL.pressure_kpa(50)
    same = 50 * NOMINAL.pressure_kpa(50) / SHEET.pressure_kpa(50)
    assert SHEET.contrast(same) == pytest.approx(NOMINAL.contrast(50))
    assert SHEET.radius_mm(50) == SHEET.radius_mm(200) and "1.3 to 5.2 kPa" in sheet.pressures()


def test_the_law_is_what_the_page_says():
    for grams, radius_mm, contrast in ((50, 4.8, 1.9), (200, 7.6, 4.2)):
        assert NOMINAL.radius_mm(grams) == pytest.approx(radius_mm, abs=0.05)
        assert NOMINAL.contrast(grams) == pytest.approx(contrast, abs=0.05)
    assert drawn_laws(3, 5)[:2] == drawn_laws(3, 2) != drawn_laws(4, 2)
    spread = np.std(np.log([law.sensitivity_per_gram for law in drawn_laws(1, 400)]))
    assert spread == pytest.approx(0.2, rel=0.1)


def test_tuning_and_reported_places_differ():
    tuned, reported = scenes.spiral(100_001, 24, 97.0), scenes.spiral(1, 36, 97.0)
    assert np.hypot(*reported.T).max() < 97 * scenes.OUTERMOST
    assert np.hypot(*(tuned[:, None] - reported[None]).transpose(2, 0, 1)).min() > 0.1


def test_the_least_load_lies_between_two():
    loads = np.array([1.0, 4.0, 16.0])
    assert detection.least_weight(loads, np.array([0.0, 0.8, 1.0])) == pytest.approx(8.0)
    assert detection.least_weight(loads, np.array([0.95, 1.0, 1.0])) == 1.0
    assert detection.least_weight(loads, np.array([0.95, 1.0, 0.5])) == float("inf")
    # once seen is not always seen
    assert detection.least_weight(loads, np.array([0.95, 0.5, 1.0])) > 4.0


def test_false_alarms_have_the_exact_bound():
    one = detection.Detection(60.0, np.array([1.0]), np.ones((4, 1)), np.ones((4, 1)), 0, 299)
    assert one.false_share() == (0.0, pytest.approx(0.00997, abs=1e-5))  # 3 / n
    found = detection.Detection(60.0, one.loads_g, one.hits, one.tries, 5, 5).false_share()
    assert found == (1.0, 1.0)


def test_readings_survive_the_store():
    one = {"a": Readout(np.array([1.0, np.nan]), np.array([(1.0, 2.0), (np.nan, np.nan)]), 3.0)}
    again = from_lists(json.loads(json.dumps(as_lists(one))))
    np.testing.assert_array_equal(again["a"].value, one["a"].value)
    np.testing.assert_array_equal(again["a"].place_mm, one["a"].place_mm)


def test_scatter_is_around_each_loads_own_mean():
    errors = np.array([[0.1, -0.3], [0.1, -0.3], [0.1, -0.3]])
    assert anywhere.scatter(errors) == pytest.approx(0)
    assert anywhere.scatter(np.array([[0.01], [-0.01]])) == pytest.approx(0.01 * np.sqrt(2))
