"""The study of stretched and bent skins: a fresh tare helps, and its page is filled."""

from eitskin_studies.experiments import deformation
from study_pages import fills_its_page, workspace


def test_it_fills_its_page_and_a_stretch_costs_touches(tmp_path, monkeypatch):
    monkeypatch.setattr(deformation, "SIMULATED_ELEMENTS", 2000)
    monkeypatch.setattr(deformation, "UNTOUCHED", 5)
    outcome = deformation.run(workspace(tmp_path, 0.04))
    scores = {(one["name"], one["tare"]): one for one in outcome.data["scores"]}
    assert len(scores) == 14 and scores["flat", "flat"]["exact"] == 4
    assert scores["flat", "flat"]["exact"] > scores["stretched by 20 %", "flat"]["exact"]
    assert scores["stretched by 10 %", "flat"]["changed"] > 0.05
    assert scores["bent to 100 mm, base", "flat"]["changed"] > 0.05
    assert scores["bent to 100 mm, free", "flat"]["changed"] < 0.01
    assert all(one["untouched"] == 0 for (_, tare), one in scores.items() if tare == "fresh")
    fills_its_page(outcome, "deformation", tmp_path)
