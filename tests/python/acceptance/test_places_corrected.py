"""Touches on skins whose electrodes or outline are not where the model has them: the tare shows
this, and places are corrected."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.model.model import Model
from eitskin.oracle.engine import OracleEngine
from eitskin.oracle.places import corrected
from eitskin.scoring.matching import match
from eitskin.solve.reconstructor import Reconstructor
from other_worlds import WorldFactory, WorldScenes
from small_models import prebuilt

SCENES, SEED = 8, 5


@pytest.fixture(scope="module")
def factory() -> WorldFactory:
    model = prebuilt()[0]
    return WorldFactory(model.skin, model.protocol)


def uncorrected(model: Model) -> Model:
    """The model with shifts of 0."""
    errors = model.model_errors
    assert errors is not None and errors.places is not None and errors.rows is not None
    places = replace(errors.places, moves=np.zeros_like(errors.places.moves))
    rows = replace(errors.rows, moves=np.zeros_like(errors.rows.moves))
    return replace(model, model_errors=replace(errors, places=places, rows=rows))


def found_mm(model: Model, engine: str, scenes: WorldScenes) -> list[np.ndarray]:
    """The touches' places of each scene, (k, 2)."""
    solver, places = Reconstructor(model, engine=engine), []
    for untouched_v, frame_v in zip(scenes.untouched_v, scenes.frames_v, strict=True):
        solver.tare(untouched_v)
        solver.forget()
        touches = solver.reconstruct(frame_v).touches
        places.append(np.array([(t.x_mm, t.y_mm) for t in touches]).reshape(-1, 2))
    return places


def errors_mm(scenes: WorldScenes, places: list[np.ndarray]) -> list[float]:
    return [
        distance
        for scene, found in zip(scenes.scenes, places, strict=True)
        for distance in match(scene.centres_mm(), found.tolist()).distances_mm
    ]


@pytest.mark.parametrize(
    ("name", "most_of_before"),
    [
        ("out_of_round_2_percent", 0.6),
        pytest.param("misplaced_3_mm", 0.9, marks=pytest.mark.long("out of round")),
        ("discs_1_to_3", 1.05),
    ],
)
def test_places_are_nearer_where_the_tare_tells_that_they_were_off(factory, name, most_of_before):
    scenes = factory.scenes(name, SCENES, SEED)
    model = prebuilt()[0]
    after, before = (
        np.median(errors_mm(scenes, found_mm(one, "c", scenes)))
        for one in (model, uncorrected(model))
    )
    assert after < most_of_before * before


def test_the_core_corrects_by_the_polynomial_of_the_definition(factory):
    """Applied by the oracle to the places that are found without it."""
    scenes, model = factory.scenes("out_of_round_2_percent", 3, SEED), prebuilt()[0]
    oracle = OracleEngine(model)
    found, off = found_mm(model, "c64", scenes), found_mm(uncorrected(model), "c64", scenes)
    assert max(np.abs(a - b).max() for a, b in zip(found, off, strict=True)) > 0.3
    for untouched_v, one, other in zip(scenes.untouched_v, found, off, strict=True):
        oracle.set_reference(untouched_v)
        assert oracle.reference is not None
        expected = [corrected(model, oracle.reference.log_gain, place) for place in other]
        assert one == pytest.approx(np.array(expected).reshape(-1, 2), abs=1e-3)
