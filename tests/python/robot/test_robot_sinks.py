"""Touches of a robot in sinks: each skin has its topics and its source, and places are in the frame
of its link."""

import csv
import json
import socket
from pathlib import Path

import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.device.known_model import KnownModel
from eitskin.kinematics.pose import from_rpy
from eitskin.robot.description import load_robot
from eitskin.robot.placement import Placement
from eitskin.session.frame import DriveReport, Frame
from eitskin.session.robot_session import RobotSession
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.sinks.outputs import attached_outputs, sinks
from eitskin.surface.flatten import flattened
from eitskin.surface.shapes import make_shape
from eitskin.surface.surface_map import SurfaceMap
from small_models import prebuilt

ARM = Path(__file__).resolve().parents[3] / "examples" / "robot" / "arm.urdf"
LINKS = {"upper_arm": "upper_arm", "forearm": "forearm", "palm": "hand"}


def datagrams(line: socket.socket) -> list[bytes]:
    came = []
    line.settimeout(0.5)
    while True:
        try:
            came.append(line.recv(65536))
        except TimeoutError:
            return came


def test_each_skin_has_its_topics_links_and_source(tmp_path, capsys):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp, socket.socket(
        socket.AF_INET, socket.SOCK_DGRAM
    ) as osc:  # fmt: skip
        for line in (udp, osc):
            line.bind(("127.0.0.1", 0))
        to = [
            f"mcap:{tmp_path}/a.mcap",
            f"csv:{tmp_path}/a.csv",
            f"udp://127.0.0.1:{udp.getsockname()[1]}",
            f"osc://127.0.0.1:{osc.getsockname()[1]}",
        ]
        command = ["stream", "--device", str(ARM), "--frames", "5"]
        assert main([*command, *(word for url in to for word in ("--to", url))]) == 0
        messages, bundles = [json.loads(one) for one in datagrams(udp)], datagrams(osc)
    frames = [one for one in messages if one["type"] == "frame"]
    assert {(one["source"], one["link"]) for one in frames} == set(LINKS.items())
    assert messages[-1]["type"] == "summary" and set(messages[-1]["summary"]["skins"]) == set(LINKS)
    for name in LINKS:
        assert sum(f"/eitskin/{name}/frame".encode() in one for one in bundles) == 5
    with (tmp_path / "a.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {(row["source"], row["link"]) for row in rows} == set(LINKS.items())
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        made = {
            (c.topic, m.header.frame_id, m.header.stamp.nanosec): m
            for _, c, _, m in reader.iter_decoded_messages()
            if hasattr(m, "header")
        }
    assert {(topic, at) for topic, at, _ in made if topic.endswith("/poses")} == {
        (f"/{name}/poses", link) for name, link in LINKS.items()
    }
    assert {at for topic, at, _ in made if topic == "/palm/touches"} == {"palm"}
    last = next(one for one in reversed(frames) if one["source"] == "forearm" and one["touches"])
    contacts = [m for (topic, *_), m in made.items() if topic == "/forearm/contacts"]
    found = [one for m in contacts for one in m.contacts]
    touch = last["touches"][0]
    (row,) = (row for row in rows if (row["frame"], row["source"], row["id"])
              == (str(last["frame"]), "forearm", str(touch["id"])))  # fmt: skip
    for name, unit in (("position", "_m"), ("normal", "")):
        cells = [float(row[f"{name}_{axis}{unit}"]) for axis in "xyz"]
        assert cells == touch[f"{name}{unit}"]
    (same,) = [one for one in found if [one.position.x, one.position.y, one.position.z]
               == touch["position_m"]]  # fmt: skip
    assert same.id == touch["id"] and same.normal.x == pytest.approx(1)
    assert np.reshape(same.covariance, (3, 3)) == pytest.approx(np.array(touch["covariance_m2"]))
    poses = [m for (topic, *_), m in made.items() if topic == "/forearm/poses"]
    pose = next(p for m in poses for p in m.poses if p.position.z == touch["position_m"][2])
    q = [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]
    assert q == pytest.approx(touch["quaternion_xyzw"]) and pose.position.x == pytest.approx(0.1)


class Noted:
    """A sink of another package, which knows nothing of robots."""

    opened: list["Noted"] = []  # noqa: RUF012

    def __init__(self, url: str, source) -> None:
        self.source, self.came, self.closed = source, [], False
        Noted.opened.append(self)

    def write(self, outgoing) -> None:
        self.came.append(outgoing.message["source"])

    def close(self) -> None:
        self.closed = True


def test_a_sink_that_knows_no_robots_is_opened_for_each_skin(monkeypatch):
    entry = type("Entry", (), {"load": lambda self: Noted})()
    monkeypatch.setattr("eitskin.sinks.outputs.sinks", lambda: {**sinks(), "noted": entry})
    with (
        RobotSession(load_robot(ARM), SessionSettings(frames=2)) as session,
        attached_outputs(session, ["noted:"]) as outputs,
    ):
        for _ in session.messages():
            pass
        (counts,) = outputs.end(session.facts())
    assert counts["sent"] == 7 and [one.source.name for one in Noted.opened] == list(LINKS)
    assert [one.source.link for one in Noted.opened] == list(LINKS.values())
    for one in Noted.opened:  # its frames, and the robot's summary
        assert one.came == [one.source.name] * 2 + [None] and one.closed


def test_a_touch_on_a_surface_is_placed_on_it_and_turned_with_its_link():
    points, faces = make_shape("hemisphere", 2000)
    ball = SurfaceMap(flattened(points, faces), points, faces, "palm")
    known = KnownModel(*prebuilt())
    settings = SessionSettings(frames=8, report="drive")
    with Session("sim:two_touch", settings) as session:
        assert session.placement is None
        object.__setattr__(known.model, "surface", ball)
        try:
            session.known = known
            messages = list(session.messages())
        finally:
            object.__setattr__(known.model, "surface", None)
    frame = next(one for one in messages if isinstance(one, Frame) and one.touches)
    report = next(one for one in messages if isinstance(one, DriveReport) and one.touches)
    assert frame.placement is not None and frame.placement.link == "palm"
    for one in (*(frame.placed or ()), *(report.placed or ())):
        assert np.linalg.norm(one.position_m) == pytest.approx(0.06, abs=2e-4)
        assert one.normal == pytest.approx(one.position_m / 0.06, abs=0.02)
    assert report.message()["touches"][0]["velocity_m_per_s"] is not None
    pose = from_rpy([0, 0, 1], [0, np.pi / 2, 0])
    turned = Placement("hand", pose, ball).place(frame.touches[0])
    here = (frame.placed or ())[0].position_m
    assert turned.position_m == pytest.approx([here[2], here[1], 1 - here[0]])
    known = ball.touch(frame.touches[0]).covariance_m2  # with what is not known of the radius
    assert turned.covariance_m2 == pytest.approx(pose.rotation @ known @ pose.rotation.T, rel=1e-6)
