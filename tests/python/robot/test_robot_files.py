"""Robot files: their contents, the places of links, and errors in one line."""

from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.errors import ConfigError, EitskinError, UsageError
from eitskin.kinematics.pose import IDENTITY, from_quaternion, from_rpy, quaternion_xyzw
from eitskin.kinematics.urdf import load_urdf
from eitskin.robot.description import is_robot, load_robot, open_robot
from eitskin.robot.placement import Placement

URDF = """<robot name="arm">
  <link name="base"/><link name="upper"/><link name="hand"/>
  <joint name="a" type="fixed"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="hand"/>
    <origin xyz="2 0 0"/></joint>
  <eitskin reference="hand" device="sim:swipe"><origin xyz="0 0 0.1"/></eitskin>
</robot>
"""


def robot(tmp_path: Path, text: str, name: str = "arm.toml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_robot_file_names_skins_boards_links_and_poses(tmp_path):
    robot(tmp_path, URDF, "arm.urdf")
    read = load_robot(robot(tmp_path, """
        [robot]
        urdf = "arm.urdf"
        [[skin]]
        name = "left"
        device = "file:run.eits?loop=1"
        link = "hand"
        xyz_m = [0, 0, 0.1]
        rpy_rad = [0, 0, 3.141592653589793]
        model = "left.eitm"
        [[skin]]
        name = "right"
        device = "sim:two_touch"
        link = "upper"
        quaternion_xyzw = [0, 0, 0, 1]
    """))  # fmt: skip
    left, right = read.skins
    assert (read.name, left.name, left.link) == ("arm", "left", "hand")
    assert left.device == f"file:{tmp_path}/run.eits?loop=1" and right.device == "sim:two_touch"
    assert left.model == tmp_path / "left.eitm"
    assert left.pose.points([0.05, 0, 0]) == pytest.approx([-0.05, 0, 0.1])
    # upper is 1 m above the base and turned to the left; hand is 2 m before it
    assert left.base.points([0.5, 0, 0]) == pytest.approx([0, 2.5, 1])
    assert right.pose.matrix() == pytest.approx(np.eye(4))


def test_a_urdf_is_a_robot_file(tmp_path):
    (skin,) = load_robot(robot(tmp_path, URDF, "arm.urdf")).skins
    assert (skin.name, skin.link, skin.device) == ("hand", "hand", "sim:swipe")
    assert (skin.base @ skin.pose).points([0, 0, 0]) == pytest.approx([0, 2, 1.1])


def test_rotations_by_angles_and_quaternions_are_the_same():
    random = np.random.default_rng(5)
    for _ in range(50):
        pose = from_rpy([1, 2, 3], random.uniform(-3, 3, 3).tolist())
        q = quaternion_xyzw(pose.rotation)
        assert q[3] >= 0 and np.linalg.norm(q) == pytest.approx(1)
        assert from_quaternion([1, 2, 3], q).matrix() == pytest.approx(pose.matrix(), abs=1e-12)
    turn = from_rpy([0, 0, 0], [0, 0, np.pi / 2])
    assert turn.points([1, 0, 0]) == pytest.approx([0, 1, 0], abs=1e-12)
    assert quaternion_xyzw(IDENTITY.rotation) == (0, 0, 0, 1)


def test_a_touch_is_placed_with_its_covariance_and_velocity():
    class Touch:
        x_mm, y_mm = 10.0, 20.0
        x_variance_mm2, xy_covariance_mm2, y_variance_mm2 = 4.0, 0.0, 1.0
        vx_mm_per_s, vy_mm_per_s = 100.0, 0.0

    # The drawing's x points up, and its normal along the link's x.
    placed = Placement("hand", from_rpy([1, 0, 0], [0, -np.pi / 2, np.pi])).place(Touch())
    assert placed.position_m == pytest.approx([1, -0.02, 0.01])
    assert placed.normal == pytest.approx([1, 0, 0], abs=1e-12)
    assert placed.velocity_m_per_s == pytest.approx([0, 0, 0.1])
    assert placed.covariance_m2 == pytest.approx(np.diag([0, 1e-6, 4e-6]), abs=1e-18)


def test_what_names_a_robot():
    for url in ("robot:a.toml", "robot:a.urdf?speed=1", "a.toml", "/x/a.urdf?speed=1&loop=1"):
        assert is_robot(url), url
    for url in ("auto", "sim:scene.toml", "text:/dev/x?layout=l.toml", "file:a.toml", "a.eits"):
        assert not is_robot(url), url


SKIN = '[[skin]]\nname = "a"\ndevice = "sim:swipe"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "names no skin"),
        ("[robot]\nurdf = 3\n" + SKIN, "urdf must be text"),
        ('[robot]\nurdf = "no.urdf"\n' + SKIN, "no such URDF"),
        (SKIN + SKIN, "skin 'a' comes twice"),
        (SKIN.replace('"a"', '"a b"'), "name 'a b' cannot be used"),
        ('[[skin]]\nname = "a"\n', "'device' is required"),
        (SKIN + "speed = 1\n", "unknown key 'speed'"),
        (SKIN.replace("sim:", ""), "write a device's URL"),
        (SKIN.replace("swipe", "swipe?speed=1"), "one clock"),
        (SKIN.replace("swipe", "swipe?name=b"), "leave name= out"),
        (SKIN.replace("sim:swipe", "robot:b.toml"), "a robot cannot be the board of a skin"),
        (SKIN + "xyz_m = [0, 0]\n", "xyz_m must be a list of 3 numbers"),
        (SKIN + 'xyz_m = [0, 0, "a"]\n', "xyz_m must be a number"),
        (SKIN + "quaternion_xyzw = [1, 1, 0, 0]\n", "it is not a rotation"),
        (SKIN + "quaternion_xyzw = [0, 0, 0, 1]\nrpy_rad = [0, 0, 0]\n", "leave one out"),
        (SKIN + 'link = "a b"\n', "cannot be a frame"),
        (
            SKIN.replace("sim:swipe", "serial:/dev/x")
            + SKIN.replace("sim:swipe", "serial:/dev/x").replace('"a"', '"b"'),
            "skins 'a' and 'b' have the same port",
        ),
        (
            SKIN.replace("sim:swipe", "auto")
            + SKIN.replace("sim:swipe", "auto").replace('"a"', '"b"'),
            "have the same port",
        ),
        ('[robot]\nurdf = "arm.urdf"\n' + SKIN, "'link' is required"),
        ('[robot]\nurdf = "arm.urdf"\n' + SKIN + 'link = "hnd"\n', "did you mean 'hand'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_robot_file(text, message, tmp_path, capsys):
    robot(tmp_path, URDF, "arm.urdf")
    path = robot(tmp_path, text)
    with pytest.raises(EitskinError, match=message):
        load_robot(path)
    assert main(["stream", "--device", str(path)]) in (3, 4, 5)
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<robot", "<arm", "not valid XML"),
        ('"arm">', '"arm"><!DOCTYPE x>', "document type"),
        ('"arm">', '"arm"><xacro:x/>', "is a xacro file"),
        ('<link name="upper"/>', "", "'upper' is not a link"),
        ('<link name="upper"/>', '<link name="hand"/>', "comes twice"),
        ('<child link="hand"/>', '<child link="upper"/>', "has two parents"),
        ('<parent link="base"/>', '<parent link="hand"/>', "form a circle"),
        ('xyz="2 0 0"', 'xyz="2 0"', "write three numbers"),
        ('reference="hand"', "", "has no reference"),
        ('reference="hand"', 'reference="base_link"', "did you mean 'base'"),
        (' device="sim:swipe"', "", "'device' is required"),
        ('device="sim:swipe"', 'device="sim:swipe" port="1"', "unknown key 'port'"),
    ],
)
def test_what_is_wrong_with_a_urdf(old, new, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        load_robot(robot(tmp_path, URDF.replace(old, new, 1), "arm.urdf"))
    with pytest.raises(ConfigError, match="names no skin"):
        load_robot(robot(tmp_path, "<robot name='a'><link name='b'/></robot>", "b.urdf"))


def test_a_long_chain_of_links_is_read_quickly(tmp_path):
    links = "".join(f'<link name="l{k}"/>' for k in range(2000))
    joints = "".join(
        f'<joint name="j{k}"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<origin xyz="0 0 1"/></joint>'
        for k in range(1999)
    )
    read = load_urdf(robot(tmp_path, f"<robot name='a'>{links}{joints}</robot>", "a.urdf"))
    assert read.links["l1999"].translation_m[2] == 1999


def test_the_url_names_the_speed_and_no_name(tmp_path):
    path = robot(tmp_path, SKIN)
    assert open_robot(f"{path}?speed=2&loop=1")[1].speed == 2
    for url, message in ((f"{path}?name=x", "leave name= out"), ("robot:", "robot:FILE")):
        with pytest.raises(UsageError, match=message):
            open_robot(url)
