"""A surface that takes another shape: its solutions, its refusals, and that a scene without it
neither imports nor computes anything for it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from eitskin.device.open import open_device
from eitskin.errors import ConfigError, UsageError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import lifted
from eitskin.scene.compiler import MeshCache, compile_scene
from eitskin.scene.cover import Cover, with_touches
from eitskin.scene.description import load_scene, scene_from_table
from eitskin.scene.effects.flex import posed_points_mm
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.runner import simulate_frames
from eitskin.surface.shapes import make_shape, write_obj
from fresh_python import run_python

BENCH = MeshCache()  # keeps the mesh
SKIN = """
[skin]
surface = "rest.obj"
[electrodes]
count = 8
width_mm = 10.0
"""
SCENE = """
[scene]
skin = "skin.toml"
frames = 3
quiet_frames = 1
elements = 600
[[touch]]
x_mm = 10.0
y_mm = -30.0
radius_mm = 15.0
contrast = 4.0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("flex")
    for name, shape in (("rest", "forearm"), ("pose", "flexed_forearm")):
        write_obj(path / f"{name}.obj", *make_shape(shape, 400))
    write_obj(path / "other.obj", *make_shape("forearm", 300))
    (path / "skin.toml").write_text(SKIN)
    (path / "scene.toml").write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def rest(folder):
    return load_scene(folder / "scene.toml")


def frames(scene, **flex):
    named = replace(scene, effects={"flex": flex} if flex else {})
    return simulate_frames(compile_scene(named, mesh_cache=BENCH)).voltage_v


def test_the_pose_is_solved_on_its_surface_with_its_volume_kept(rest, folder):
    """An independent solution: the mesh on the flexed surface, each element as much thinner as it
    is larger."""
    flexed = frames(rest, surface="pose.obj", at_s=-1000.0)
    surface = rest.skin.surface
    pose = replace(surface, points_mm=posed_points_mm(surface, folder / "pose.obj", "mm"))
    mesh = BENCH.mesh(rest.skin, rest.elements)
    moved = lifted(mesh, pose)
    sheet = rest.skin.conductivity_s_per_m * mesh.true_areas_mm2 / moved.true_areas_mm2
    forward = ForwardModel(moved, rest.skin, rest.protocol, 0.0)
    touched = with_touches(sheet, Cover(moved).change((TrueTouch(10.0, -30.0, 15.0, 4.0),)))
    expected = np.array([forward.voltages(sheet), *3 * [forward.voltages(touched)]])
    np.testing.assert_allclose(flexed, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    at_rest = frames(rest)
    assert np.linalg.norm(flexed[0] - at_rest[0]) > 0.01 * np.linalg.norm(at_rest[0])


def test_it_rises_from_the_rest_to_the_pose(rest):
    """Frames come every 50 ms; the tare is at rest."""
    at_rest, flexed = frames(rest), frames(rest, surface="pose.obj", at_s=-1000.0)
    rising = frames(rest, surface="pose.obj", at_s=0.0, rise_s=0.1)
    np.testing.assert_array_equal(rising[:2], at_rest[:2])
    np.testing.assert_array_equal(rising[3], flexed[3])
    low, high = at_rest[2], flexed[2]
    part = (rising[2] - low) @ (high - low) / ((high - low) @ (high - low))
    assert part == pytest.approx(0.5, abs=0.1)


def test_the_same_shape_changes_nothing(rest):
    same = frames(rest, surface="rest.obj", at_s=-1000.0)
    np.testing.assert_allclose(same, frames(rest), rtol=1e-4)  # an OBJ file has 6 decimals


@pytest.mark.parametrize(
    ("flex", "message"),
    [
        ({"surface": "other.obj"}, "does not have the triangles of the skin's surface"),
        ({"surface": "none.obj"}, "there is no such mesh file"),
        ({}, "surface"),
    ],
)
def test_other_surfaces_are_refused(rest, flex, message):
    with pytest.raises(Exception, match=message) as caught:
        compile_scene(replace(rest, effects={"flex": flex}), mesh_cache=BENCH)
    assert "[effects.flex]" in str(caught.value) and "\n" not in str(caught.value)


def test_a_flat_skin_and_flat_effects_are_refused(rest, folder):
    flat = scene_from_table(
        {"scene": {}, "effects": {"flex": {"surface": "pose.obj"}}}, "s", folder
    )
    with pytest.raises(ConfigError, match="is flat; use bend or stretch"):
        compile_scene(flat, mesh_cache=BENCH)
    with pytest.raises(ConfigError, match=r"\[effects.flex\] gives it another shape"):
        compile_scene(replace(rest, effects={"bend": {}}), mesh_cache=BENCH)


PROBE = """
import json, sys
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import load_scene
from eitskin.scene.runner import simulate_frames
plan = compile_scene(load_scene(sys.argv[1]))
run = simulate_frames(plan)
used = [m for m in sys.modules if m.startswith("eitskin.scene.effects.")]
print(json.dumps([used, run.work.factorisations, len(plan.states)]))
"""


def test_a_scene_without_it_costs_nothing(folder):
    """Seen from outside: nothing of it is imported, and each state takes its one factorisation."""
    done = run_python(PROBE, str(folder / "scene.toml"))
    assert done.returncode == 0, done.stderr
    used, factorisations, states = json.loads(done.stdout)
    assert used == [] and factorisations <= states == 2


@pytest.mark.parametrize("kind", ["sim", "emu"])
def test_a_board_before_a_surface_needs_a_model_of_it(folder, kind):
    """The prebuilt model is of a flat skin, so its touches would be nonsense."""
    with pytest.raises(UsageError, match=r"covers a surface.*--model"):
        open_device(f"{kind}:{folder / 'scene.toml'}")
