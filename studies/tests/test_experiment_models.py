"""The experiment on models of other kinds: a small run, and one that goes on."""

import pytest

from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import models
from eitskin_studies.experiments.experiment import ExperimentOutcome
from study_pages import fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py")


def test_a_run_and_one_that_goes_on(monkeypatch, tmp_path):
    few = [
        models.Variant("disk", paper_skin()),
        models.Variant("i8", paper_skin(), "i8"),
        models.Variant("taught", paper_skin(), taught=True),
    ]
    monkeypatch.setattr(models, "variants", lambda: few)
    monkeypatch.setattr(models, "ELEMENTS", 2000)
    monkeypatch.setattr(models, "SAMPLES", 4)
    monkeypatch.setattr(models, "PRESSES", 30)

    def run() -> ExperimentOutcome:
        return models.run(workspace(tmp_path, 0.1))

    first = run()
    (table,) = first.tables
    assert [row[0] for row in table.rows] == ["disk", "i8", "taught"]
    built, coarse, taught = (first.data["models"][one.name] for one in few)
    assert min(built["miou_image"]) > 0.8 and min(coarse["miou_image"]) > 0.8
    assert built["shown_touches"] == 1
    assert len(taught["error_mm"]) > 0
    goes_on(run, first)
    fills_its_page(first, "models", tmp_path)
