"""The study of the paper's weights: where they are put, and its page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from study_pages import fills_its_page

from eitskin.scene.random_touches import rim_distance_mm
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import paper
from eitskin_studies.experiments.experiment import (
    ExperimentSettings,
    Workspace,
    plain,
    workspace_in,
)
from eitskin_studies.harness.sessions import SceneSolver


@pytest.mark.parametrize("from_rim_mm", paper.READINGS.values())
def test_weights_stand_where_the_skin_is_most_sensitive(
    from_rim_mm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paper, "MODEL_ELEMENTS", 1500)
    skin = paper_skin()
    places = np.array(paper._places(skin, adjacent(16), from_rim_mm))
    away = rim_distance_mm(skin.outline, places)
    assert len(places) == 12 and away.min() >= from_rim_mm and away.max() < from_rim_mm + 5
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 1e3 * np.eye(12)
    assert apart.min() >= paper.APART_MM
    electrodes = skin.electrode_centres_mm()
    nearest = np.linalg.norm(places[:, None] - electrodes, axis=2).min(axis=1)
    middle = np.linalg.norm(electrodes[0] - electrodes[1]) / 2
    assert nearest[:4].max() < middle + from_rim_mm


class CoarseWorkspace(Workspace):
    def scenes(self, skin, protocol, elements=1500):  # type: ignore[no-untyped-def]
        return SceneSolver(skin, protocol, 1500, self.folder / "frames")


def test_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "MODEL_ELEMENTS", 1500)
    monkeypatch.setattr(paper, "NOISES", 1)
    usual = workspace_in(tmp_path, ExperimentSettings(share=0.1), plain)
    one = CoarseWorkspace(usual.settings, usual.folder, usual.progress, usual.store)
    outcome = paper.run(one)
    rows = outcome.tables[0].rows
    assert [row[0] for row in rows] == [str(k) for k in range(1, 13)]
    assert set(rows[0][1:]) == {"100"}  # one weight
    page = fills_its_page(outcome, "paper", tmp_path)
    assert "| 12 |" in page
    assert paper.run(one).tables == outcome.tables
