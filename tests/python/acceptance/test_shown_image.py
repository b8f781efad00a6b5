"""The image that shows a frame: drawn of the touches where they explain it, else the solver's."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eitskin.core.drawing import TouchDrawing
from eitskin.core.results import Reconstruction
from eitskin.fem.mesh import mesh_for_elements
from eitskin.frames.frames import Frames
from eitskin.oracle.discs import drawn
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch, random_touches
from eitskin.scene.simulate import Measurement, simulate
from eitskin.scoring.score import FrameScore, scorer_for
from eitskin.solve.reconstructor import Reconstructor
from small_models import prebuilt

SCENES = 10


def exact(touches: TouchSet, snr_db: float = 60.0) -> Frames:
    """Frames of touches on the paper's skin without finite elements, with noise."""
    model = prebuilt()[0]
    skin, rng = RoundSkin(model.skin, model.protocol), np.random.default_rng(touches.seed)
    untouched = skin.voltages(())
    sigma = float(np.sqrt(np.mean(untouched**2))) * 10 ** (-snr_db / 20)
    volts = np.array([skin.voltages(scene.touches) for scene in touches.scenes])
    mesh = mesh_for_elements(model.skin, 900)  # for the truth that the frames carry
    frames = simulate(model.skin, model.protocol, touches, mesh=mesh).as_frames()
    return replace(
        frames,
        voltage_v=volts + sigma * rng.normal(size=volts.shape),
        reference_voltage_v=untouched + sigma * rng.normal(size=(64, len(untouched))),
    )


def made(frames: Frames, **options: Any) -> tuple[list[Reconstruction], list[FrameScore]]:
    """Results of the float32 core, and their scores; without options each frame by itself."""
    model, blob = prebuilt()
    core = Reconstructor(model, blob=blob)
    core.set_options(**options)
    core.tare(frames.reference_voltage_v)
    scorer, results, scores = scorer_for(model), [], []
    for number, frame in enumerate(frames.voltage_v):
        if not options:
            core.forget()
        results.append(core.reconstruct(frame))
        score = scorer.score(frames, number, results[-1], "increase")
        assert score is not None
        scores.append(score)
    return results, scores


@pytest.fixture(scope="module")
def discs() -> tuple[list[Reconstruction], list[FrameScore]]:
    return made(exact(random_touches(prebuilt()[0].skin.outline, 31, SCENES)))


def test_the_drawn_image_of_discs_is_far_better_than_the_solvers(discs):
    results, scores = discs
    assert [one.image_is for one in results].count("touches") >= SCENES - 1
    shown = np.mean([score.miou_image for score in scores])
    solved = np.mean([score.miou_solver for score in scores])
    assert shown >= 0.93
    assert shown >= solved + 0.07


def test_a_drawn_image_has_the_expected_change_and_the_area_of_its_touches(discs):
    model = prebuilt()[0]
    for one in discs[0]:
        if one.image_is == "solver":
            assert one.image is one.solver_image
            continue
        assert one.image is one.touch_image
        assert one.image.max() == pytest.approx(model.defaults.touch_change_s_per_m)
        assert one.image.min() == 0
        covered = one.image.sum() / one.image.max() * model.grid.pixel_area_mm2
        soft = model.grid.pixel_mm**2 / 12
        area = sum(np.pi * (touch.radius_mm**2 + soft) for touch in one.touches)
        assert covered == pytest.approx(area, rel=0.05)


def test_a_host_draws_the_bits_of_the_core_from_touches_and_the_oracle_the_same(discs):
    model, blob = prebuilt()
    drawing = TouchDrawing(blob)
    for one in discs[0]:
        image = drawing.image(one.touches)
        if one.touch_image is not None:
            assert image.tobytes() == one.touch_image.tobytes()
        assert image == pytest.approx(drawn(model, one.touches), abs=1e-5 * float(image.max()))
    held = [replace(touch, explained=0.0) for touch in discs[0][0].touches]
    assert not drawing.image(held).any()
    assert not drawing.image([]).any()


def row_of_discs(count: int) -> TouchSet:
    """A long bar of small discs that overlap."""
    at = np.linspace(-45, 45, count)
    touches = tuple(TrueTouch(float(x), 0.4 * float(x) + 15, 7.0, 5.0) for x in at)
    return TouchSet("bar", 0, (TouchScene("bar", touches),))


def test_a_bar_that_no_ellipse_explains_is_shown_by_the_solver():
    model = prebuilt()[0]
    simulated = simulate(
        model.skin, model.protocol, row_of_discs(13), measurement=Measurement(snr_db=60.0)
    )
    (one,), (score,) = made(simulated.as_frames())
    assert one.touches and one.image_is == "solver"
    assert one.image is one.solver_image and one.touch_image is None
    assert score.miou_image == score.miou_solver


def test_without_touches_the_image_is_the_solvers():
    model, blob = prebuilt()
    core = Reconstructor(model, blob=blob)
    core.tare(model.golden.reference_v)
    asked_for_none = core.reconstruct(model.golden.frame_v, touches=False)
    assert asked_for_none.image_is == "solver"
    assert (asked_for_none.image == model.golden.image).all()
    untouched = core.reconstruct(model.golden.reference_v)
    assert untouched.touches == () and untouched.image_is == "solver"
    assert not untouched.image.any()


def test_a_touch_that_tracking_holds_back_leaves_the_solvers_image():
    strong, faint = TrueTouch(-40.0, 0.0, 10.0, 8.0), TrueTouch(30.0, 20.0, 8.0, 1.6)
    scene = TouchScene("faint", (strong, faint))
    frames = exact(TouchSet("faint", 0, (scene, scene)))
    model, blob = prebuilt()
    core = Reconstructor(model, blob=blob)
    core.tare(frames.reference_voltage_v)
    first, second = core.stream(frames.voltage_v)
    assert len(first.touches) == 1 and first.image_is == "solver"
    assert len(second.touches) == 2 and second.image_is == "touches"
