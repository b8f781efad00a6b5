"""The library's hydrogel scene: its front end misleads the model from physics, not a taught one."""

from dataclasses import replace

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.model.eitm import load_model
from eitskin.model.model import Model
from eitskin.scene.laws import Insulating
from eitskin.scene.library_scenes import find_scene, scene_path
from eitskin.scene.runner import run_scene
from eitskin.scene.touch_path import Keyframe, TouchTrack
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.practice import plan_of_scene
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import solve_presses, teach

TAUGHT, JUDGED, WIDTH_MM = 50, 24, 171.0


def pressed(place_mm: np.ndarray) -> Presses:
    """The scene's skin and front end, untouched and pressed in turn."""
    touches = []
    for k, (x, y) in enumerate(place_mm.tolist()):
        first = Keyframe(2.0 * k + 0.5, x, y, 8.0, 0.85)
        touches.append(TouchTrack((first, replace(first, t_s=first.t_s + 1)), Insulating(0.15)))
    scene = replace(
        find_scene("hydrogel"), touches=tuple(touches), frames=2 * len(place_mm), rate_hz=1.0,
        quiet_frames=1, frozen=True, elements=2500,
    )  # fmt: skip
    frames = run_scene(scene)
    return Presses(frames.protocol, frames.voltage_v[0::2], frames.voltage_v[1::2], place_mm)


def by_physics(model: Model, judged: Presses, sign: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n,) mm of the strongest touch, and numbers of touches (n,)."""
    core, found = Reconstructor(model), []
    core.set_options(sign=sign)
    for i in range(len(judged)):
        core.forget()
        core.tare(judged.untouched[i])
        touches = core.reconstruct(judged.pressed[i]).touches
        at = [(one.x_mm, one.y_mm) for one in touches[:1]] or [(WIDTH_MM, WIDTH_MM)]
        found.append((np.linalg.norm(np.array(at[0]) - judged.place_mm[i]), len(touches)))
    error, count = np.array(found).T
    return error, count


@pytest.mark.long("scene/test_library.py runs the scene, test_teach.py teaches")
def test_physics_fails_and_teaching_works(tmp_path):
    plan, text = plan_of_scene("hydrogel")
    assert len(plan) == TAUGHT and "start_angle_deg" in text
    draw = np.random.default_rng(9)
    radius, angle = 70 * np.sqrt(draw.uniform(size=JUDGED)), draw.uniform(0, 2 * np.pi, JUDGED)
    place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    every = pressed(np.concatenate([plan.place_mm, place]))
    known, judged = every.take(np.arange(TAUGHT)), every.take(np.arange(TAUGHT, TAUGHT + JUDGED))
    skin = scene_path("hydrogel").parent / "skins" / "hydrogel.toml"
    physics = str(tmp_path / "physics.eitm")
    assert main(["model", "build", str(skin), "--samples", "0", "-o", physics]) == 0
    for sign in ("increase", "decrease"):
        error, count = by_physics(load_model(physics)[0], judged, sign)
        assert np.median(error) > 0.1 * WIDTH_MM and np.median(count) > 3
    scene = find_scene("hydrogel")
    unknown = replace(scene.skin, electrodes=replace(scene.skin.electrodes, start_angle_deg=0.0))
    error, count, *_ = solve_presses(teach(known, unknown).model, judged)
    assert np.median(error) < 2 and np.quantile(error, 0.95) < 5 and np.mean(count == 1) > 0.9
