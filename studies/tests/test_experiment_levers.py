"""The levers: the gain of each search and each image, on few scenes; and continuing an interrupted
run."""

from pathlib import Path

import pytest

from eitskin_studies.experiments import levers
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.levers.configurations import IMAGES, SEARCHES
from eitskin_studies.experiments.levers.measure import COUNTED, IMAGE_SNRS_DB, RANDOM
from study_pages import coarse, fills_its_page, goes_on

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> tuple[Path, ExperimentOutcome]:
    folder = tmp_path_factory.mktemp("levers")
    return folder, levers.run(coarse(folder, 0.05))


def test_every_lever_is_on_every_set(done):
    searches, images = done[1].data["searches"], done[1].data["images"]
    assert set(searches) == {one.name for one in SEARCHES}
    assert set(images) == {one.name for one in IMAGES}
    assert all(set(found) == {RANDOM, *COUNTED} for found in searches.values())
    kept = {"threshold", *(f"{snr:g}" for snr in IMAGE_SNRS_DB)}
    assert all(set(found) == kept for found in images.values())


def test_what_coupling_explains_and_refining_costs(done):
    searches, images = done[1].data["searches"], done[1].data["images"]
    eight = "8 at 4 radii, 80 dB"
    alone, whole = searches["peaks alone"][eight], searches["all (the default)"][eight]
    assert whole["unexplained"] < 0.5 * alone["unexplained"]
    assert sum(whole["exact"]) >= sum(alone["exact"]) and whole["touch_macs"] > alone["touch_macs"]
    for one in IMAGES:
        if one.options.get("second_pass"):
            base = images[one.name.removesuffix(", refined")]["60"]
            assert base["macs"] < images[one.name]["60"]["macs"] < 2.2 * base["macs"]


def test_it_goes_on_and_fills_its_page(done, tmp_path):
    goes_on(lambda: levers.run(coarse(done[0], 0.05)), done[1])
    fills_its_page(done[1], "levers", tmp_path)
