"""The scenes that come with the package: each is found by name, described, and runs."""

from dataclasses import replace

import numpy as np
import pytest
from scene_helpers import ELEMENTS

from eitskin.errors import FileError
from eitskin.scene.compiler import compile_scene
from eitskin.scene.library_scenes import descriptions, find_scene, library
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache

EXPECTED = {
    "single_press", "light_press", "two_touch", "pinch", "swipe", "ring7", "roll", "rotate", "grip",
    "drying_gel", "resting_hand", "loose_electrode", "bridged", "mains_hum", "drift", "real_board",
    "random_touches", "demo", "two_fingers", "play",
    "tap", "double_tap", "hold", "swipe_right", "swipe_up", "swipe_left", "swipe_down", "spread",
    "drum_beat", "ring_turn", "page_turns", "hydrogel",
}  # fmt: skip
BENCH = MeshCache()


def test_the_library_has_its_scenes_each_with_a_line():
    assert set(library()) == EXPECTED
    for name, line in descriptions().items():
        assert find_scene(name).name == name
        assert 20 < len(line) <= 110 and line.endswith("."), name


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_every_library_scene_runs(name):
    scene = replace(find_scene(name), elements=ELEMENTS)
    compiled = compile_scene(scene, mesh_cache=BENCH)
    frames = simulate_frames(compiled).voltage_v
    assert frames.shape == (scene.n_frames, scene.protocol.n_rows)
    untouched_v, touched_v = frames[: scene.quiet_frames], frames[scene.quiet_frames :]
    change, noise_v = (
        np.abs(touched_v - untouched_v.mean(axis=0)).max(),
        untouched_v.std(axis=0).max(),
    )
    assert change > 10 * noise_v or name == "random_touches"
    assert compiled.states[0].touches == ()


def test_seven_on_the_ring_are_seven_on_a_ring():
    away = [float(np.hypot(s.x_mm[0], s.y_mm[0])) for s in find_scene("ring7").samples()]
    assert away == pytest.approx([60.0] * 7, abs=1e-3)


def test_an_unknown_scene_names_the_nearest():
    said = "swip: no such scene file, nor a scene of the library; did you mean 'swipe'"
    with pytest.raises(FileError, match=said):
        find_scene("swip")
    with pytest.raises(FileError, match="no such scene"):
        find_scene("swip.toml")
