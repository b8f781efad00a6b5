"""No still library scene on a healthy skin of 8, 16, 24 or 32 electrodes raises a diagnostic. Still
is a frame in which nothing moves while it is scanned."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from eitskin.model.build import BuildSettings, build_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.description import Scene
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.runner import run_scene
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin, paper_skin
from eitskin.solve.reconstructor import Reconstructor

STILL = {"demo": 3, "two_touch": 2, "ring7": 7, "single_press": 1, "hold": 1, "tap": 1}
COUNTS = (8, 16, 24, 32)


def skin_of(electrodes: int) -> Skin:
    return replace(paper_skin(), electrodes=Electrodes(count=electrodes, width_mm=4.0))


@cache
def model_of(electrodes: int, samples: int) -> Model:
    if electrodes == 16 and samples:
        return load_prebuilt()[0]
    settings = BuildSettings(samples=samples)
    return build_model(skin_of(electrodes), adjacent(electrodes), settings)


def still(name: str, electrodes: int, *, frozen: bool = True) -> Scene:
    skin, protocol = skin_of(electrodes), adjacent(electrodes)
    return replace(find_scene(name), skin=skin, protocol=protocol, frozen=frozen)


def check(name: str, electrodes: int, samples: int) -> None:
    frames = run_scene(still(name, electrodes))
    solver = Reconstructor(model_of(electrodes, samples))
    solver.tare(frames.reference_voltage_v)
    results = list(solver.stream(frames.voltage_v))
    assert max(len(result.touches) for result in results) == STILL[name]
    assert {word for result in results for word in result.info.found} == set()


# Seven touches have 21 numbers, and 8 electrodes give 20 data.
SOLVABLE = [(name, n) for name in STILL for n in COUNTS if (name, n) != ("ring7", 8)]


@pytest.mark.parametrize(("name", "electrodes"), [pair for pair in SOLVABLE if pair[1] <= 16])
def test_still_scenes_raise_no_diagnostic(name, electrodes):
    check(name, electrodes, 0 if electrodes == 8 else 1)


@pytest.mark.long("test_still_scenes_raise_no_diagnostic, with 8 and 16 electrodes")
@pytest.mark.parametrize(("name", "electrodes"), SOLVABLE)
def test_still_scenes_raise_no_diagnostic_with_model_errors(name, electrodes):
    check(name, electrodes, 256)


def test_more_touches_than_data_are_crowded_and_nothing_else():
    """Without a touch in its reference the frame is not called stale: the touches explain it."""
    frames = run_scene(still("ring7", 8))
    solver = Reconstructor(model_of(8, 0))
    solver.tare(frames.reference_voltage_v)
    found = {word for result in solver.stream(frames.voltage_v) for word in result.info.found}
    assert found == {"crowded: more touches than can be separated"}


def test_a_touch_in_the_reference_is_named():
    frames = run_scene(still("two_touch", 16))
    solver = Reconstructor(model_of(16, 1))
    untouched = frames.reference_voltage_v
    solver.tare(untouched - untouched.mean(0) + frames.voltage_v[0])
    info = solver.reconstruct(untouched[0]).info
    assert any(word.startswith("stale reference") for word in info.found)


@pytest.mark.parametrize("name", ["single_press", "hold"])
def test_a_finger_that_barely_presses_is_no_crowd(name):
    """It lands while a frame is scanned, and is lost in noise."""
    frames = run_scene(still(name, 16, frozen=False))
    solver = Reconstructor(model_of(16, 1))
    solver.tare(frames.reference_voltage_v)
    for result in solver.stream(frames.voltage_v):
        faint = result.info.lambda_max < 3 * result.info.lambda_noise
        assert not (faint and any(word.startswith("crowded") for word in result.info.found))
    assert np.isfinite(result.info.unexplained)
