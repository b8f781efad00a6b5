"""The experiment on shapes: its pictures, measurements that are made once, and a finger with one
electrode, which shows nothing."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.fem.grid import grid_for
from eitskin.model.build import linearise
from eitskin.skin.protocol import adjacent
from eitskin_studies.experiments import shapes
from eitskin_studies.experiments.experiment import ExperimentOutcome
from eitskin_studies.experiments.scored import share_text
from eitskin_studies.experiments.shapes import measuring
from eitskin_studies.experiments.shapes.example_drawings import (
    FINGERS,
    forearm_corners,
    hand_corners,
    hand_region,
    rectangle_corners,
)
from eitskin_studies.experiments.shapes.rounded import as_outline
from eitskin_studies.experiments.shapes.variants import ShapeVariant, variants
from study_pages import coarse, fills_its_page, goes_on, workspace

pytestmark = pytest.mark.long("test_experiments.py, and the experiments belief and deformation")


@pytest.fixture(scope="module")
def known(tmp_path_factory) -> dict[str, ShapeVariant]:
    return {one.name: one for one in variants(tmp_path_factory.mktemp("drawings"))}


def _small(
    monkeypatch: pytest.MonkeyPatch, known: dict[str, ShapeVariant], folder: Path
) -> ExperimentOutcome:
    monkeypatch.setattr(shapes, "variants", lambda _: [known["disk, 16"], known["hand, 16 placed"]])
    monkeypatch.setattr(measuring, "MODEL_ELEMENTS", 1500)
    return shapes.run(coarse(folder, 0.03, 2000))


def test_a_run_and_one_that_goes_on(monkeypatch, known, tmp_path):
    first = _small(monkeypatch, known, tmp_path)
    assert [table.name for table in first.tables] == ["skins", "found", "lost"]
    for result in first.data["shapes"].values():
        assert 0.5 < np.mean(result["scores"]["image"]) <= 1
        assert len(result["scores"]["place_mm"]) == len(result["scores"]["error_mm"])
        assert 0.8 < result["about"]["ceiling"] < 1
    goes_on(lambda: _small(monkeypatch, known, tmp_path), first)
    fills_its_page(first, "shapes", tmp_path)


def test_sets_depend_on_the_seed_only(known, tmp_path):
    def drawn(seed: int) -> Any:
        maker = measuring.Maker(workspace(tmp_path, 0.02, seed=seed), known["forearm, 16"])
        return maker.test.scenes, maker.tuning.scenes

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)
    assert drawn(1)[0][0].touches != drawn(1)[1][0].touches


def test_sizes_are_those_that_the_page_says(known):
    rectangle = as_outline(rectangle_corners())
    assert rectangle.bounding_box_mm == pytest.approx((-100, -70, 100, 70))
    assert rectangle.area_mm2 == pytest.approx(200 * 140 - (4 - math.pi) * 400, rel=1e-3)
    x0, _, x1, _ = as_outline(forearm_corners()).bounding_box_mm
    assert x1 - x0 == pytest.approx(220)
    _, y0, _, y1 = as_outline(hand_corners()).bounding_box_mm
    assert y1 - y0 == pytest.approx(178, abs=0.1)
    assert known["disk, 16"].scale == 1
    assert known["hand, 32 evenly"].skin.electrodes.count == 32
    assert known["hand, 16 placed"].skin.outline == known["hand, 16 in pairs"].skin.outline


def test_regions(known):
    assert hand_region([tip for _, tip, _ in FINGERS.values()]) == list(FINGERS)
    assert hand_region([(85, 60)]) == ["palm"]
    disk = known["disk, 16"]
    found = disk.regions([(0, 0), (50, 0), (90, 0)], 97)
    assert found == ["innermost third", "middle third", "rim third"]


def test_a_finger_with_one_electrode_is_blind(known):
    """All current through a finger passes its only electrode, and so would all that is measured
    there: no row has both."""
    seen = {}
    for name in ("hand, 16 placed", "hand, 16 in pairs"):
        skin = known[name].skin
        linear = linearise(skin, adjacent(16), elements=2500)
        norm = np.linalg.norm(linear.jacobian, axis=0)
        place = grid_for(skin.outline).locate([FINGERS["middle"][1]])[0]
        seen[name] = norm[place] / np.median(norm)
    assert seen["hand, 16 placed"] < 0.05
    assert seen["hand, 16 in pairs"] > 10 * seen["hand, 16 placed"]


def test_shares_have_a_width_where_all_agree():
    assert share_text([1] * 20) == "100 % (84 to 100)"
    assert share_text([0, 1] * 50) == "50 % (40 to 60)"
