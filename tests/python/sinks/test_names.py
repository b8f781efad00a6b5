"""The name of the skin is in every message and sink."""

import json
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

import eitskin
from eitskin.cli.main import main
from eitskin.device.open import open_device, open_with_files
from eitskin.device.timing import Timing, split_name, split_timing
from eitskin.device.wire.link_table import Setting
from eitskin.errors import UsageError
from eitskin.session.message import schema
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.sinks.mqtt import open_sink as open_mqtt
from eitskin.sinks.outputs import Outputs, open_sink
from eitskin.sinks.sink import TouchSource

VALID = jsonschema.Draft202012Validator(schema())


def printed(capsys, *arguments: str) -> list[dict]:
    assert main(["stream", "--frames", "2", "--json", *arguments]) == 0
    messages = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for message in messages:
        VALID.validate(message)
    return messages


@pytest.mark.parametrize(
    "arguments",
    [
        ["--device", "sim:swipe", "--name", "left"],
        ["--device", "sim:swipe?name=left"],
        ["--device", "sim:swipe?speed=max&name=left&loop=1"],
        ["--device", "sim:swipe?name=right", "--name", "left"],
    ],
)
def test_every_message_has_the_name(arguments, capsys):
    messages = printed(capsys, *arguments, "--report", "drive")
    assert {message["source"] for message in messages} == {"left"}
    assert {"frame", "report", "summary"} <= {message["type"] for message in messages}


def test_without_a_name_it_is_the_serial_number(capsys):
    with open_device("sim:swipe") as board:
        serial = board.board.serial
    assert {message["source"] for message in printed(capsys, "--device", "sim:swipe")} == {serial}
    (frame,) = eitskin.stream("sim:swipe", frames=1, name="arm")
    assert frame.source == "arm" and frame.message()["source"] == "arm"


def mcap_messages(path: Path) -> list[tuple[str, str]]:
    """The topic and the frame of reference of each message."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        heads = (
            (c.topic, m.markers[0].header if hasattr(m, "markers") else m.header)
            for _, c, _, m in reader.iter_decoded_messages()
        )
        return [(topic, head.frame_id) for topic, head in heads]


@pytest.fixture
def named_board(monkeypatch):
    """Every board that a session opens has the name that its owner gave it: elbow."""

    def opened(*url, **how):
        device = open_with_files(*url, **how)
        if not device.replays:
            device.settings(Setting(0), name="elbow")
        return device

    monkeypatch.setattr("eitskin.session.session.open_with_files", opened)


def test_the_name_in_the_boards_settings_is_used_where_none_is_given(named_board, tmp_path, capsys):
    for options, name in (
        ([], "elbow"),
        (["--name", "left"], "left"),
        (["--device", "sim:swipe?name=right"], "right"),
        (["--device", "sim:swipe?name=right", "--name", "left"], "left"),
    ):
        came = printed(capsys, "--device", "sim:swipe", *options)
        assert {message["source"] for message in came} == {name}
    assert main(["stream", "--device", "sim:swipe", "--frames", "3", "--to",
                 f"mcap:{tmp_path}/a.mcap"]) == 0  # fmt: skip
    assert {frame for _, frame in mcap_messages(tmp_path / "a.mcap")} == {"elbow"}
    capsys.readouterr()
    path = tmp_path / "run.eits"
    for options, name in (([], "elbow"), (["--name", "left"], "left")):
        assert main(["record", "--device", "sim:swipe", "-o", str(path), "--frames", "2",
                     "--overwrite", *options]) == 0  # fmt: skip
        capsys.readouterr()
        assert {m["source"] for m in printed(capsys, "--device", f"file:{path}")} == {name}


def test_a_boards_name_that_cannot_be_is_not_used(monkeypatch):
    def opened(*url, **how):
        device = open_with_files(*url, **how)
        device.board = replace(device.board, name="a/b\x1b[2J")
        return device

    monkeypatch.setattr("eitskin.session.session.open_with_files", opened)
    with Session("sim:swipe") as session:
        assert session.given_name is None
        assert session.source == session.device.board.serial


def test_a_recording_is_made_under_a_name(tmp_path, capsys):
    path = tmp_path / "run.eits"
    record = ["record", "--device", "sim:swipe", "-o", str(path), "--frames", "2", "--json"]
    assert main([*record, "--name", "left"]) == 0
    assert json.loads(capsys.readouterr().out)["source"] == "left"
    assert main([*record, "--name", "a b", "--overwrite"]) == 2
    assert "name 'a b' cannot be used" in capsys.readouterr().err


def test_names_stand_in_the_urls_of_all_kinds():
    assert split_name("serial:/dev/x?baud=9600&name=a") == ("serial:/dev/x?baud=9600", "a")
    assert split_name("text:p?layout=l.toml") == ("text:p?layout=l.toml", None)
    assert split_name("auto?name=a-1") == ("auto", "a-1")
    assert split_timing("sim:swipe?name=a&speed=2") == ("sim:swipe", Timing(2.0))


@pytest.mark.parametrize("name", ["", "a b", "a/b", "ä", "#", "a+", "x" * 33, "-a"])
def test_names_that_cannot_be(name, capsys):
    with pytest.raises(UsageError, match="cannot be used; use 1 to 32 letters"):
        Session(f"sim:swipe?name={name}")
    assert main(["stream", "--device", "sim:swipe", f"--name={name}"]) == 2
    with pytest.raises(UsageError, match="two names"):
        split_name("sim:swipe?name=a&name=b")


def sources(datagrams: list[bytes]) -> set[str]:
    from pythonosc.osc_bundle import OscBundle

    found = set()
    for one in datagrams:
        first = next(iter(OscBundle(one)))
        found.add(first.params[1])
    return found


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """Frames for programs: a simulated skin would be meshed and solved in each of them."""
    path: Path = tmp_path_factory.mktemp("recorded") / "swipe.eits"
    with Session("sim:swipe", SessionSettings(frames=3, record=path)) as session:
        for _ in session.messages():
            pass
    return path


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["--name=left", "--name=right"], ["left@", "right@"]),
        (["--to=/left", "--to=/right"], ["left@", "right@"]),
        (["", ""], ["eitskin-", "eitskin-"]),
    ],
)
def test_two_skins_on_one_tuio_port_are_two_sources(names, expected, recorded):
    """Two processes, with the same recording."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        line.settimeout(0.2)
        to = f"tuio://127.0.0.1:{line.getsockname()[1]}"
        command = [sys.executable, "-m", "eitskin", "stream", "--device", f"file:{recorded}"]
        programs = []
        for one in names:
            path = one.removeprefix("--to=") if one.startswith("--to") else ""
            more = [one] if one.startswith("--name") else []
            programs.append([*command, "--frames", "3", *more, "--to", to + path])
        running = [subprocess.Popen(one, stdout=subprocess.DEVNULL) for one in programs]
        came = []
        while any(one.poll() is None for one in running):
            try:
                came.append(line.recv(9000))
            except TimeoutError:
                continue
    found = sorted(sources(came))
    assert len(found) == 2 and all(map(str.startswith, found, expected)), found


def test_topics_and_frames_have_the_name(swipe, tmp_path, monkeypatch):
    source = replace(swipe.source, name="left", source="left")
    with Outputs([f"mcap:{tmp_path}/a.mcap"], source) as outputs:
        for frame in swipe.frames[:3]:
            outputs.put(frame)
        outputs.end({})
    came = mcap_messages(tmp_path / "a.mcap")
    assert ("/left/touches", "left") in came and all(t.startswith("/left/") for t, _ in came)
    assert {frame for _, frame in came} == {"left"}


@pytest.mark.parametrize(
    ("url", "name", "topic"),
    [("", None, "eitskin"), ("", "left", "eitskin/left"), ("/own", "left", "own")],
)
def test_mqtt_topics(url, name, topic, monkeypatch):
    from paho.mqtt import client as module

    class Client:
        def __init__(self, version) -> None:
            self.on_connect = None

        def connect(self, host, port, keepalive) -> None:
            reason = type("Reason", (), {"is_failure": False})()
            self.on_connect(self, None, None, reason, None)  # type: ignore[misc]

        def __getattr__(self, name):
            return lambda *more, **named: None

    monkeypatch.setattr(module, "Client", Client)
    sink = open_mqtt(f"mqtt://host{url}", TouchSource("x", name=name))
    assert sink._topic == topic  # type: ignore[attr-defined]


def test_a_path_of_tuio_is_a_name(swipe):
    with pytest.raises(UsageError, match="cannot be used"):
        open_sink("tuio://127.0.0.1/a b", swipe.source)
