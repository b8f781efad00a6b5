"""Skins on surfaces: from a mesh file to voltages, covers and a model."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.errors import EitskinError
from eitskin.fem.cem import ForwardModel
from eitskin.fem.mesh import mesh_for_elements
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import decode_model, encode_model
from eitskin.scene.cover import Cover
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.simulate import conductivity_with
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin, load_skin, outline_on
from eitskin.solve.reconstructor import Reconstructor
from eitskin.surface import mesh_file
from eitskin.surface.outline import surface_map
from eitskin.surface.shapes import make_shape, write_obj
from eitskin.surface.topology import rim_loop

PROTOCOL = adjacent(16)


def described(folder: Path, mesh: str, lines: str = "", electrodes: str = "count = 16") -> Path:
    path = folder / "skin.toml"
    path.write_text(f'[skin]\nsurface = "{mesh}"\n{lines}\n[electrodes]\n{electrodes}\n')
    return path


def obj(folder: Path, points, triangles, name="arm.obj") -> str:
    write_obj(folder / name, points, triangles)
    return name


@pytest.fixture(scope="module")
def ball():
    surface = surface_map(*make_shape("hemisphere", 3000))
    return Skin("ball", outline_on(surface), Electrodes(), surface=surface)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl"])
def test_a_skin_is_read_from_a_mesh(tmp_path, suffix):
    import trimesh

    points, triangles = make_shape("cylinder", 400)
    trimesh.Trimesh(points / 1000, triangles, process=False).export(tmp_path / f"arm.{suffix}")
    lines = 'surface_unit = "m"\nlink = "forearm_link"'
    skin, protocol = load_skin(described(tmp_path, f"arm.{suffix}", lines))
    assert skin.surface is not None and skin.surface.link == "forearm_link"
    assert skin.outline.diameter_mm == pytest.approx(194, rel=5e-3)
    assert len(skin.surface.triangles) == len(triangles)
    place = skin.surface.at([[0.0, 0.0]])
    np.testing.assert_allclose(place.point_m[0], [0, 0, 0.06], atol=2e-3)
    np.testing.assert_allclose(place.normal[0], [0, 0, 1], atol=0.02)
    np.testing.assert_allclose(place.tangents[0][:, 1], [0, 1, 0], atol=0.02)
    assert protocol.n_electrodes == 16


def test_electrodes_lie_at_points_or_vertices_of_the_rim(tmp_path):
    points, triangles = make_shape("saddle", 600)
    mesh = obj(tmp_path, points, triangles)
    rim = rim_loop(triangles)
    chosen = rim[:: len(rim) // 8][:8]
    by_vertex, _ = load_skin(described(tmp_path, mesh, "", f"vertices = {chosen.tolist()}"))
    near = (points[chosen] + [0.0, 0.0, 1.0]).round(6).tolist()
    by_point, _ = load_skin(described(tmp_path, mesh, "", f"points_mm = {near}"))
    for skin in (by_vertex, by_point):
        assert skin.surface is not None and skin.electrodes.count == 8
        centres = 1e3 * skin.surface.at(skin.electrode_centres_mm()).point_m
        assert (
            np.linalg.norm(centres - points[chosen], axis=1).max() < 1.0
        )  # as far as the points were moved


@pytest.mark.parametrize(
    "electrodes, what",
    [
        ("points_mm = [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]", "mm from the surface's rim"),
        ("vertices = [0, 1, 2, 3]", "mm from the surface's rim"),
        ("vertices = [100000, 1, 2, 3]", "not one of the mesh file's 0 to"),
        ("points_mm = [[0, 0], [1, 1], [2, 2], [3, 3]]", r"must be \[x, y, z\]"),
        ("vertices = []", "is empty"),
    ],
)
def test_electrodes_off_the_rim_are_refused(tmp_path, electrodes, what):
    mesh = obj(tmp_path, *make_shape("saddle", 400))
    with pytest.raises(EitskinError, match=what) as caught:
        load_skin(described(tmp_path, mesh, "", electrodes))
    assert "\n" not in str(caught.value) and str(caught.value).count("skin.toml") == 1


def test_a_wrong_unit_and_bad_files_are_named(tmp_path):
    points, triangles = make_shape("saddle", 400)
    (tmp_path / "words.obj").write_text("these are no numbers\n")
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" + "f 1 2 3\n" * 30)
    for mesh, lines, what in (
        (obj(tmp_path, points / 1000, triangles, "m.obj"), "", 'write surface_unit = "m"'),
        (obj(tmp_path, points, triangles), 'surface_unit = "m"', 'write surface_unit = "mm"'),
        (obj(tmp_path, points * 1e9, triangles, "big.obj"), "", "scale the mesh"),
        ("absent.obj", "", "no such mesh file"),
        ("skin.toml", "", "file of type"),
        ("words.obj", "", "words.obj: "),
        ("empty.stl", "", "empty.stl: "),
        ("nan.obj", "", "not finite"),
        ("m.obj", "diameter_mm = 3", "give either"),
    ):
        with pytest.raises(EitskinError, match=what) as caught:
            load_skin(described(tmp_path, mesh, lines))
        assert "\n" not in str(caught.value)


def test_a_mesh_of_too_many_triangles_is_simplified(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_file, "MAX_TRIANGLES", 600)
    points, triangles = make_shape("hemisphere", 6000)
    write_obj(tmp_path / "ball.obj", points, triangles)
    read = mesh_file.read_surface(tmp_path / "ball.obj")
    assert len(read.triangles) <= 600 and read.simplified_from == len(triangles)
    np.testing.assert_allclose(np.linalg.norm(read.points_mm, axis=1), 60.0, rtol=0.01)
    rim = read.points_mm[rim_loop(read.triangles)]
    assert np.abs(rim[:, 2]).max() < 1.0


def test_a_cylinder_gives_the_flat_skins_volts():
    surface = surface_map(*make_shape("cylinder", 4000))
    skin = Skin("arm", outline_on(surface), Electrodes(), surface=surface)
    flat = Skin("flat", skin.outline, Electrodes())
    volts = [
        ForwardModel(mesh_for_elements(one, 3000), one, PROTOCOL).voltages(0.01)
        for one in (skin, flat)
    ]
    assert np.linalg.norm(volts[0] - volts[1]) < 1.5e-3 * np.linalg.norm(volts[1])


def test_half_a_ball_conducts_as_its_flattened_copy(ball):
    """A conformal map keeps the equation of conduction."""
    flat = Skin("flat", ball.outline, Electrodes())
    volts = [
        ForwardModel(mesh_for_elements(one, 6000), one, PROTOCOL).voltages(0.01)
        for one in (ball, flat)
    ]
    assert np.linalg.norm(volts[0] - volts[1]) < 2e-3 * np.linalg.norm(volts[1])


@pytest.mark.parametrize("place", [(0.0, 0.0), (20.0, -25.0)])
def test_a_touch_covers_a_cap_of_the_ball(ball, place):
    """The cap of a ball within a distance r in space has the area pi r^2 (Archimedes)."""
    mesh = mesh_for_elements(ball, 3000)
    assert mesh.true_areas_mm2.sum() == pytest.approx(2 * np.pi * 60**2, rel=5e-3)
    elements, part = Cover(mesh).of(TrueTouch(*place, 10.0, 5.0))
    covered = float((part * mesh.true_areas_mm2[elements]).sum())
    assert covered == pytest.approx(100 * np.pi, rel=0.02)


def test_a_touch_is_found_on_the_ball(ball):
    """Nothing of the flat world is left: a model of the surface, a scene on another mesh of it, and
    a touch in metres."""
    model = build_model(ball, PROTOCOL, BuildSettings(samples=0))
    blob = encode_model(model)
    again = decode_model(blob, "ball.eitm")
    assert again.surface is not None and again.skin.surface is again.surface
    mesh = mesh_for_elements(ball, 7000)
    forward = ForwardModel(mesh, ball, PROTOCOL)
    true = TrueTouch(12.0, -18.0, 9.0, 5.0)
    frame = forward.voltages(conductivity_with(mesh, (true,), 0.01))
    finder = Reconstructor(again, blob=blob)
    finder.tare(forward.voltages(0.01)[None])
    (found,) = finder.reconstruct(frame).touches
    touch = again.surface.touch(found)
    wanted = ball.surface.at([[true.x_mm, true.y_mm]])
    assert np.linalg.norm(touch.point_m - wanted.point_m[0]) < 1e-3
    np.testing.assert_allclose(touch.normal, wanted.normal[0], atol=0.02)
    assert touch.radius_m == pytest.approx(9e-3, rel=0.1)


def test_effects_that_deform_a_flat_skin_are_refused(tmp_path):
    from eitskin.scene.compiler import prepare_scene
    from eitskin.scene.description import scene_from_table

    mesh = obj(tmp_path, *make_shape("saddle", 400))
    described(tmp_path, mesh)
    table = {"scene": {"skin": "skin.toml", "frames": 1}, "effects": {"stretch": {"strain": 0.1}}}
    scene = scene_from_table(table, "here.toml", tmp_path)
    with pytest.raises(EitskinError, match=r"effects.stretch\]: this effect is for flat skins"):
        prepare_scene(scene)
