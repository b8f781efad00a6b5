"""A skin on the mesh of a URDF's link: in the link's frame, and what is wrong with it in a line."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.errors import EitskinError
from eitskin.kinematics.link_mesh import link_mesh
from eitskin.skin.skin import Skin, load_skin
from eitskin.surface.shapes import make_shape, write_obj

SADDLE = make_shape("saddle", 400)
MESH = '<visual><geometry><mesh filename="arm.obj" scale="0.001 0.001 0.001"/></geometry></visual>'


def urdf(folder: Path, inside: str = MESH) -> None:
    """An arm whose link ``forearm`` has the elements ``inside``, and a saddle's mesh, in mm."""
    write_obj(folder / "arm.obj", *SADDLE)
    (folder / "arm.urdf").write_text(
        f'<robot name="arm"><link name="base"/><link name="forearm">{inside}</link></robot>'
    )


def read(folder: Path, surface: str = "arm.urdf#forearm", lines: str = "") -> Skin:
    path = folder / "skin.toml"
    path.write_text(f'[skin]\nsurface = "{surface}"\n{lines}\n[electrodes]\ncount = 8\n')
    return load_skin(path)[0]


def points_m(skin: Skin) -> np.ndarray:
    assert skin.surface is not None and skin.surface.link == "forearm"
    return skin.surface.points_m()


def test_a_mesh_comes_into_the_links_frame(tmp_path):
    origin = '<origin xyz="0 0 0.1" rpy="0 0 1.5707963267948966"/>'
    urdf(tmp_path, MESH.replace("<geometry>", origin + "<geometry>"))
    x, y, z = SADDLE[0].T / 1000
    wanted = np.column_stack([-y, x, z + 0.1])
    found = points_m(read(tmp_path))
    np.testing.assert_allclose(np.sort(found, axis=0), np.sort(wanted, axis=0), atol=1e-6)


@pytest.mark.parametrize(
    ("primitive", "area_mm2"),
    [
        ('<cylinder radius="0.04" length="0.2"/>', 40 * np.radians(300) * 200),
        ('<sphere radius="0.05"/>', 2 * np.pi * 50**2),
    ],
)
def test_the_message_about_a_primitive_says_what_makes_a_skin_of_it(
    tmp_path, monkeypatch, primitive, area_mm2
):
    """Its command is run, and its <visual> written, word by word. The mesh is where the primitive
    is."""
    monkeypatch.chdir(tmp_path)
    origin = '<origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/>'
    body = f"<visual>{origin}<geometry>{primitive}</geometry></visual>"
    urdf(tmp_path, body)
    with pytest.raises(EitskinError, match="which has no rim") as caught:
        read(tmp_path)
    command = re.search(r"eitskin (surface make .*? -o skin.obj)", str(caught.value))
    mesh = re.search(r"<mesh .*?/>", str(caught.value))
    assert command is not None and mesh is not None
    assert main(shlex.split(command[1])) == 0
    skin = f'<visual name="skin">{origin}<geometry>{mesh[0]}</geometry></visual>'
    urdf(tmp_path, body + skin)
    surface = read(tmp_path).surface
    assert surface is not None and surface.area_mm2 == pytest.approx(area_mm2, rel=5e-3)
    local_m = surface.points_m() - [0, 0, 0.1]  # its axis z lies along x of the link
    radius_m = float(re.findall(r'radius="(.*?)"', primitive)[0])
    from_axis = local_m[:, 1:] if "cylinder" in primitive else local_m
    np.testing.assert_allclose(np.linalg.norm(from_axis, axis=1), radius_m, rtol=1e-5)
    assert surface.scale_range[1] < (1.01 if "cylinder" in primitive else 2.01)


def test_a_mirrored_mesh_faces_the_same_side(tmp_path):
    """The saddle's normal at its middle is z, in the file and mirrored by x."""
    urdf(tmp_path, MESH.replace('"0.001 ', '"-0.001 '))
    skin = read(tmp_path)
    assert skin.surface is not None
    np.testing.assert_allclose(skin.surface.at([[0.0, 0.0]]).normal[0], [0, 0, 1], atol=0.02)
    np.testing.assert_allclose(points_m(skin)[:, 0].min(), -SADDLE[0][:, 0].max() / 1e3, atol=1e-6)


@pytest.mark.parametrize("name", ["forearm/skin", "forearm/collision"])
def test_one_of_several_meshes_is_named(tmp_path, name):
    visuals = (
        '<visual name="body"><geometry><mesh filename="body.dae"/></geometry></visual>'
        + MESH.replace("<visual>", '<visual name="skin">')
        + MESH.replace("visual", "collision")
    )
    urdf(tmp_path, visuals)
    assert len(points_m(read(tmp_path, f"arm.urdf#{name}"))) == len(SADDLE[0])


def test_visuals_go_before_collisions(tmp_path):
    collision = '<collision><geometry><mesh filename="hull.stl"/></geometry></collision>'
    urdf(tmp_path, collision + MESH)
    assert link_mesh(tmp_path / "arm.urdf", "forearm").file == tmp_path / "arm.obj"
    urdf(tmp_path, '<visual><geometry><sphere radius="1"/></geometry></visual>' + collision)
    assert link_mesh(tmp_path / "arm.urdf", "forearm").file == tmp_path / "hull.stl"


def test_packages_are_searched_around_the_urdf_and_where_ros_looks(tmp_path, monkeypatch):
    def found() -> Path:
        return link_mesh(tmp_path / "arm_urdf" / "urdf" / "arm.urdf", "forearm").file

    for name in ("arm_urdf/urdf", "arm_meshes", "two/share/far", "one/far1", "arm_urdf/far1"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "one" / "far1" / "a.stl").touch()  # and none in the nearer arm_urdf/far1
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "two"))
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}/nowhere:{tmp_path / 'one'}")
    for name, wanted in (
        ("package://arm_urdf/meshes/a.stl", "arm_urdf/meshes/a.stl"),
        ("package://arm_meshes/a.stl", "arm_meshes/a.stl"),
        ("package://far/a.stl", "two/share/far/a.stl"),
        ("package://far1/a.stl", "one/far1/a.stl"),
        (f"file://{tmp_path}/a%20b.stl", "a b.stl"),
        ("../a.stl", "arm_urdf/urdf/../a.stl"),
    ):
        urdf(tmp_path / "arm_urdf" / "urdf", MESH.replace("arm.obj", name))
        assert found() == tmp_path / wanted


@pytest.mark.parametrize(
    ("surface", "inside", "message"),
    [
        ("arm.urdf", MESH, r'name the skin\'s:  surface = "arm.urdf#LINK"'),
        ("arm.urdf#forarm", MESH, "no link 'forarm'; did you mean 'forearm'"),
        ("no.urdf#forearm", MESH, "no such URDF"),
        ("arm.urdf#base", MESH, "link 'base': it has no mesh"),
        ("arm.urdf#forearm/skn", MESH.replace("l>", 'l name="skin">', 1), "did you mean 'skin'"),
        ("arm.urdf#forearm", MESH + MESH, "2 meshes can be meant .a visual without a name, a"),
        (
            "arm.urdf#forearm",
            '<visual><geometry><box size="1 1 1"/></geometry></visual>',
            "is a box, whose faces are flat: describe a flat skin",
        ),
        (
            "arm.urdf#forearm",
            '<visual><geometry><capsule radius="1"/></geometry></visual>',
            "is a capsule, not a mesh",
        ),
        (
            "arm.urdf#forearm",
            '<visual><geometry><sphere radius="1 m"/></geometry></visual>',
            "its sphere has radius='1 m'; write a number",
        ),
        ("arm.urdf#forearm", MESH.replace("filename", "file"), "<mesh> has no filename"),
        ("arm.urdf#forearm", MESH.replace("arm.obj", "no.obj"), "forearm.*no such mesh file"),
        ("arm.urdf#forearm", MESH.replace("arm.obj", "arm.dae"), "of type .obj, .ply, .stl"),
        (
            "arm.urdf#forearm",
            MESH.replace("arm.obj", "package://no_such_robot/a.stl"),
            "package 'no_such_robot' of its mesh was not found",
        ),
        ("arm.urdf#forearm", MESH.replace("arm.obj", "package:///a.stl"), "found by this name"),
        ("arm.urdf#forearm", MESH.replace("arm.obj", "http://x/a.stl"), "found by this name"),
        ("arm.urdf#forearm", MESH.replace("0.001 ", "", 1), "three numbers"),
        ("arm.urdf#forearm", MESH.replace("0.001 ", "nan ", 1), "three numbers"),
        ("arm.urdf#forearm", MESH.replace("0.001 ", "0 ", 1), "with a 0"),
        (
            "arm.urdf#forearm",
            MESH.replace("<geometry>", '<origin xyz="0 0"/><geometry>'),
            "its origin has xyz='0 0'",
        ),
        ("arm.urdf#forearm", MESH.replace("0.001", "1"), 'in mm: write scale="0.001 0.001 0.001"'),
        ("arm.urdf#forearm", MESH.replace("0.001", "1e-6"), "in m already: leave the scale"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_links_mesh(tmp_path, monkeypatch, surface, inside, message):
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)
    urdf(tmp_path, inside)
    with pytest.raises(EitskinError, match=message) as caught:
        read(tmp_path, surface)
    assert "\n" not in str(caught.value) and str(tmp_path) in str(caught.value)


@pytest.mark.parametrize("line", ['link = "forearm"', 'surface_unit = "m"'])
def test_the_urdf_says_link_and_unit(tmp_path, line):
    urdf(tmp_path)
    with pytest.raises(EitskinError, match="a URDF says it"):
        read(tmp_path, lines=line)
