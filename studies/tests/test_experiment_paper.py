"""The study of the paper's weights: where they are put, and its page."""

import numpy as np
import pytest

from eitskin.scene.random_touches import rim_distance_mm
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments import paper
from study_pages import coarse, fills_its_page, goes_on

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.mark.parametrize("from_rim_mm", paper.READINGS.values())
def test_weights_stand_where_the_skin_is_most_sensitive(from_rim_mm, monkeypatch):
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


def test_small(tmp_path, monkeypatch):
    monkeypatch.setattr(paper, "MODEL_ELEMENTS", 1500)
    monkeypatch.setattr(paper, "NOISES", 1)
    outcome = paper.run(coarse(tmp_path, 0.1, 1500))
    rows = outcome.tables[0].rows
    assert [row[0] for row in rows] == [str(k) for k in range(1, 13)]
    assert set(rows[0][1:]) == {"100"}  # one weight
    page = fills_its_page(outcome, "paper", tmp_path)
    assert "| 12 |" in page
    goes_on(lambda: paper.run(coarse(tmp_path, 0.1, 1500)), outcome, solves=True)
