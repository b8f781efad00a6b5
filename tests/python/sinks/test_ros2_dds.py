"""The sink ``ros2:``. Bytes are read by the definitions of rosbags, and, in the long run, received
by Fast DDS; both know nothing of this project."""

import math
import os
import subprocess
import sys
import time
from collections import defaultdict
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eitskin.errors import UsageError
from eitskin.session.message import summary_message
from eitskin.sinks.ros2_dds import dds_name, dds_type, filled, open_sink
from eitskin.sinks.ros2_topics import CONTACTS, MARKERS, POSES, RosTopics, definitions
from eitskin.sinks.sink import OutgoingMessage

ROOT = Path(__file__).resolve().parents[3]
LOOPBACK = (  # and no multicast, which a container may lack
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    "</ParticipantIndex><SPDPInterval>1s</SPDPInterval><Peers><Peer address='localhost'/></Peers>"
    "</Discovery></Domain></CycloneDDS>"
)
FASTDDS = {  # the same for Fast DDS
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("fastdds_local.xml"))
}


@pytest.fixture(scope="module")
def store() -> Any:
    """The message types of ROS 2 Humble as rosbags has them, and ours."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = get_typestore(Stores.ROS2_HUMBLE)
    for path in (ROOT / "python" / "eitskin" / "sinks" / "msg").glob("*.msg"):
        name = f"eitskin_msgs/msg/{path.stem}"
        known.register(get_types_from_msg(path.read_text(), name))
    return known


def encoded(kind: str, table: dict[str, Any]) -> bytes:
    made: bytes = filled(dds_type(kind, definitions()[kind]), table).serialize()
    return made


def test_each_message_is_read_by_other_definitions(store, swipe, drives):
    frame = next(one for one in swipe.frames if one.touches)
    seen = set()
    for item, source in ((frame, swipe.source), (drives.reports[-1], drives.source)):
        for _, kind, table in RosTopics(source).of(OutgoingMessage(item)):
            read = store.deserialize_cdr(encoded(kind, table), kind)
            header = (read.markers[0] if kind == MARKERS else read).header
            assert header.frame_id == "skin"
            seen.add(kind)
    assert seen == set(definitions())


def test_the_summary_at_the_end_has_no_topic(swipe):
    last = OutgoingMessage(summary_message({"frames": 3}, swipe.source.name))
    assert list(RosTopics(swipe.source).of(last)) == []


def test_places_are_metres_in_the_skins_frame(store, swipe):
    frame = next(one for one in swipe.frames if one.touches)
    (touch,) = frame.touches
    made = {kind: table for _, kind, table in RosTopics(swipe.source).of(OutgoingMessage(frame))}
    read = {kind: store.deserialize_cdr(encoded(kind, table), kind) for kind, table in made.items()}
    (contact,) = read[CONTACTS].contacts
    assert contact.id == touch.id and math.isnan(contact.force)
    at = contact.position
    assert (at.x, at.y, at.z) == (touch.x_mm / 1e3, touch.y_mm / 1e3, 0)
    assert contact.covariance[0] == pytest.approx(touch.x_variance_mm2 * 1e-6)
    (pose,) = read[POSES].poses
    assert (pose.position.x, pose.position.z, pose.orientation.w) == (at.x, 0, 1)
    clear, marker = read[MARKERS].markers
    assert (clear.action, marker.action, marker.type) == (3, 0, 3)
    assert marker.scale.x * marker.scale.y == pytest.approx(4 * contact.radius**2)


def test_an_ellipse_has_its_long_axis_along_the_markers_x(swipe):
    frame = next(one for one in swipe.frames if one.touches)
    message = frame.message()
    touch = {**message["touches"][0], "radius_mm": 6.0, "long_x_mm": 0.0, "long_y_mm": 9.0}
    outgoing = OutgoingMessage(frame)
    outgoing.__dict__["message"] = {**message, "touches": [touch]}
    made = {kind: table for _, kind, table in RosTopics(swipe.source).of(outgoing)}
    marker = made[MARKERS]["markers"][1]
    assert (marker["scale"]["x"], marker["scale"]["y"]) == pytest.approx((0.018, 0.008))
    assert 2 * math.asin(marker["pose"]["orientation"]["z"]) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("url", ["ros2:left", "ros2:?domain=233", "ros2:?domain=x", "ros2:?name=1"])
def test_addresses_that_cannot_be(url, swipe):
    with pytest.raises(UsageError):
        open_sink(url, swipe.source)


PROGRAM = """
import sys
from eitskin.cli.main import main
sys.exit(main())
"""


def streamed(domain: int, folder: Path, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", PROGRAM, "stream", "--device", "sim:swipe?speed=1&loop=1"]
    return subprocess.Popen(
        [*command, "--to", f"ros2:?domain={domain}", *more],
        env={**os.environ, "CYCLONEDDS_URI": LOOPBACK},
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def reader(tmp_path_factory) -> Path:
    program = tmp_path_factory.mktemp("reader") / "dds_reader"
    source = ROOT / "tests" / "tools" / "dds_reader.cpp"
    command = ["g++", "-w", source, "-lfastrtps", "-lfastcdr", "-o", program]
    subprocess.run(command, check=True)
    return program


def read_by_fast_dds(
    reader: Path, domain: int, seconds: int, *words: str
) -> dict[str, list[bytes]]:
    """The messages on each topic; ``words`` are topics and types in turn."""
    done = subprocess.run(
        [reader, str(domain), str(seconds), *words],
        env={**os.environ, **FASTDDS}, capture_output=True, text=True, timeout=150, check=True,
    )  # fmt: skip
    found = defaultdict(list)
    for line in done.stdout.splitlines():
        topic, _, text = line.strip().partition(" ")
        if text:
            found[topic].append(bytes.fromhex(text))
    return found


@pytest.mark.long("test_each_message_is_read_by_other_definitions")
def test_fast_dds_receives_what_is_streamed(reader, store, tmp_path):
    domain = 100 + os.getpid() % 100
    process = streamed(domain, tmp_path, "--name", "left", "--mode", "touches,image")
    kinds = {"markers": MARKERS, "contacts": CONTACTS, "poses": POSES,
             "image": "sensor_msgs/msg/Image"}  # fmt: skip
    words = [one for name, kind in kinds.items() for one in (f"rt/left/{name}", dds_name(kind))]
    try:
        found = read_by_fast_dds(reader, domain, 100, *words)
    finally:
        process.terminate()
        said, _ = process.communicate(timeout=20)
    for name, kind in kinds.items():
        read = [store.deserialize_cdr(one, kind) for one in found[f"rt/left/{name}"]]
        assert len(read) > 20, (name, said)
    contacts = [store.deserialize_cdr(one, CONTACTS) for one in found["rt/left/contacts"]]
    assert all(one.header.frame_id == "left" for one in contacts)
    assert any(one.contacts and abs(one.contacts[0].position.x) < 0.1 for one in contacts)


class Tares:
    """Counts the references that are asked for."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self) -> "Future[None]":
        self.count += 1
        answer: Future[None] = Future()
        answer.set_result(None)
        return answer


@pytest.mark.long("test_each_message_is_read_by_other_definitions")
def test_fast_dds_asks_for_a_tare(reader, swipe, monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    tares, domain = Tares(), 100 + os.getpid() % 100
    sink = open_sink(f"ros2:?domain={domain}", replace(swipe.source, tare=tares))
    try:
        read_by_fast_dds(reader, domain, 10, "publish:rt/tare", dds_name("std_msgs/msg/Empty"))
    finally:
        sink.close()
    assert tares.count >= 1


@pytest.mark.long("test_each_message_is_read_by_other_definitions")
def test_the_service_takes_the_reference(swipe, monkeypatch):
    """As a client on rmw_cyclonedds asks it."""
    from cyclonedds import domain, pub, sub, topic

    from eitskin.sinks.ros2_dds import REPLY, REQUEST

    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    tares = Tares()
    number = 1 + os.getpid() % 90
    sink = open_sink(f"ros2:?domain={number}", replace(swipe.source, tare=tares))
    try:
        client = domain.DomainParticipant(number)
        request = dds_type("std_srvs/srv/Trigger_Request", REQUEST)
        reply = dds_type("std_srvs/srv/Trigger_Response", REPLY)
        out = pub.DataWriter(client, topic.Topic(client, "rq/tareRequest", request))
        back = sub.DataReader(client, topic.Topic(client, "rr/tareReply", reply))
        end = time.monotonic() + 20
        while not tares.count and time.monotonic() < end:
            out.write(request(77, 5, 0))
            time.sleep(0.3)
        (answer, *_) = back.take(10) or [None]
        assert (answer.client, answer.sequence, answer.success) == (77, 5, True)
    finally:
        sink.close()
