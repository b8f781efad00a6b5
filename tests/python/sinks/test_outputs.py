"""Sinks that are slow, stuck or dying hold up nobody; what cannot be opened is refused."""

import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from eitskin.cli.main import main
from eitskin.errors import EitskinError
from eitskin.sinks import outputs as module
from eitskin.sinks.mqtt import open_sink as open_mqtt
from eitskin.sinks.outputs import DRIVES, Outputs
from eitskin.sinks.sink import Dropped, OutgoingMessage, TouchSource

ROOM = 8


class Heard:
    """A sink that keeps what is written to it."""

    def __init__(self) -> None:
        self.reported: list[OutgoingMessage] = []
        self.closed = threading.Event()

    def write(self, reported: OutgoingMessage) -> None:
        self.reported.append(reported)

    def close(self) -> None:
        self.closed.set()


class Stuck(Heard):
    """Never comes back from its first."""

    def __init__(self) -> None:
        super().__init__()
        self.free = threading.Event()

    def write(self, reported: OutgoingMessage) -> None:
        self.free.wait()


class Dying(Heard):
    """Fails from the third on."""

    def write(self, reported: OutgoingMessage) -> None:
        super().write(reported)
        if len(self.reported) > 2:
            raise OSError("the cable\nis out")


class Leaving(Heard):
    """Wants to end the program with its second."""

    def write(self, reported: OutgoingMessage) -> None:
        super().write(reported)
        if len(self.reported) == 2:
            raise SystemExit("this sink has seen enough")


class Away(Heard):
    def write(self, reported: OutgoingMessage) -> None:
        raise Dropped


class Entry:
    def __init__(self, sink: Heard) -> None:
        self._sink = sink

    def load(self) -> Any:
        return lambda url, source: self._sink


@pytest.fixture
def made(monkeypatch) -> Iterator[dict[str, Any]]:
    sinks: dict[str, Any] = {"good": Heard(), "stuck": Stuck(), "dying": Dying(), "away": Away()}
    sinks["leaving"] = Leaving()
    monkeypatch.setattr(module, "sinks", lambda: {name: Entry(s) for name, s in sinks.items()})
    monkeypatch.setattr(module, "ENDING_S", 0.1)
    yield sinks
    sinks["stuck"].free.set()


def test_a_sink_that_raises_systemexit_has_failed_and_goes_on(swipe, made):
    said: list[str] = []
    with Outputs(["leaving:", "good:"], swipe.source, patient=True, say=said.append) as outputs:
        for frame in swipe.frames[:4]:
            outputs.put(frame)
        leaving, good = outputs.end({})
    assert (leaving["sent"], leaving["failed"]) == (4, 1)
    assert leaving["error"] == "this sink has seen enough"
    assert said == ["to leaving: this sink has seen enough"]
    assert (good["sent"], good["failed"]) == (5, 0)


def await_taken(outputs: Outputs, count: int) -> None:
    """Return when each sink but the last, which is stuck, has done something with ``count``
    items."""
    end_s = time.monotonic() + 30
    while any(one["sent"] + one["dropped"] + one["failed"] < count for one in outputs.counts[:-1]):
        assert time.monotonic() < end_s, outputs.counts
        time.sleep(0.001)


@pytest.mark.parametrize("patient", [False, True])
def test_a_stuck_and_a_dying_sink_disturb_no_other(swipe, made, patient, monkeypatch):
    """Each frame comes when the others have taken the one before, so that a busy computer drops
    nothing; at the end the stuck one is waited for last."""
    monkeypatch.setattr(module, "PATIENCE_S", 0.05)
    monkeypatch.setattr(module, "ENDING_S", 1.0)
    said: list[str] = []
    urls = ["good:", "dying:", "away:", "stuck:"]
    with Outputs(urls, swipe.source, patient=patient, say=said.append, room=ROOM) as outputs:
        for count, frame in enumerate(swipe.frames, 1):
            outputs.put(frame)
            await_taken(outputs, count)
        good, dying, away, stuck = outputs.end({})
    whole = len(swipe.frames) + 1
    assert [reported.frame for reported in made["good"].reported[:-1]] == swipe.frames
    assert (good["sent"], good["dropped"], good["failed"]) == (whole, 0, 0)
    assert (dying["sent"], dying["failed"], dying["error"]) == (2, whole - 2, "the cable is out")
    assert (away["sent"], away["dropped"], away["failed"]) == (0, whole, 0)
    assert (stuck["sent"], stuck["dropped"]) == (0, whole - 1)
    assert said == ["to dying: the cable is out"]
    assert made["good"].closed.is_set() and not made["stuck"].closed.is_set()


def test_an_impatient_session_never_waits(swipe, drives, made):
    """Reports and frames take no room from each other; the first is in the sink, or still waits."""
    many = [drives.reports[0]] * (DRIVES * ROOM + 9)
    for first, second in ((swipe.frames, many), (many, swipe.frames)):
        with Outputs(["stuck:"], swipe.source, room=ROOM) as outputs:
            for item in (*first, *second):
                outputs.put(item)
            (counts,) = outputs.counts
            dropped = len(swipe.frames) - ROOM + 9
            assert counts["dropped"] in (dropped - 1, dropped)


def test_a_message_is_made_once_for_all(swipe):
    reported = OutgoingMessage(swipe.frames[20])
    assert reported.message is reported.message and reported.text is reported.text


def test_a_sink_without_an_address_is_named_with_one_colon(swipe, monkeypatch):
    counts = [{"url": "ros2:", "sent": 3, "dropped": 0, "failed": 0, "error": None}]
    monkeypatch.setattr(Outputs, "counts", property(lambda outputs: counts))
    with Outputs([], swipe.source) as outputs:
        assert outputs.lines == ["to ros2: 3 sent"]


REFUSED = [
    ("nonsense", 2, "known are: csv"),
    ("tui://x", 2, "did you mean 'tuio'? As in udp://"),
    ("http://127.0.0.1:9000", 2, "programs and pages connect to  ws://127.0.0.1:9000"),
    ("udp://localhost", 2, "udp://HOST:PORT"),
    ("udp://127.0.0.1:9/path", 2, "nothing may follow the port"),
    ("udp://127.0.0.1:0", 2, "udp://HOST:PORT"),
    ("ws://127.0.0.1:99999", 2, "write  ws://"),
    ("ws://127.0.0.1:{taken}", 13, "name another port"),
    ("foxglove://127.0.0.1:{taken}", 13, "name another port"),
    ("mqtt://127.0.0.1:{closed}", 13, "no broker answers there"),
    ("lsl:?touches=0", 2, "touches=N"),
    ("csv:", 2, "name a file"),
    ("csv:{folder}/there/is/none.csv", 3, "make it first"),
    ("mcap:{folder}/here.mcap", 3, "--overwrite"),
]


@pytest.mark.parametrize(("url", "code", "part"), REFUSED)
def test_what_cannot_be_opened_is_refused_in_a_line(url, code, part, swipe, tmp_path):
    (tmp_path / "here.mcap").touch()
    with socket.socket() as taken, socket.socket() as closed:
        for one in (taken, closed):
            one.bind(("127.0.0.1", 0))
        taken.listen()
        ports = {"taken": taken.getsockname()[1], "closed": closed.getsockname()[1]}
        with pytest.raises(EitskinError) as error:
            Outputs(["udp://127.0.0.1:9", url.format(folder=tmp_path, **ports)], swipe.source)
    assert error.value.exit_code == code and part in str(error.value)
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_one_writes_to_a_file(swipe, kind, tmp_path):
    """An old file stays whole until the new one has begun, and a second writer is refused."""
    path, source = tmp_path / "touches", replace(swipe.source, overwrite=True)
    path.write_bytes(b"old")
    with path.open("rb") as old, Outputs([f"{kind}:{path}"], source):
        with pytest.raises(EitskinError, match="another process records to it"):
            Outputs([f"{kind}:{path}"], source)
        assert old.read() == b"old"


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_a_full_disk_is_said(swipe, kind):
    """A full disk is reported when the file is opened, or later by the counts."""
    source, said = replace(swipe.source, overwrite=True), list[str]()
    try:
        with Outputs([f"{kind}:/dev/full"], source, say=said.append) as outputs:
            for frame in swipe.frames:
                outputs.put(frame)
            (counts,) = outputs.end({})
            assert counts["failed"] > 0 and "No space left" in counts["error"] and len(said) == 1
    except EitskinError as error:
        assert error.exit_code == 3 and "No space left" in str(error)


def test_passwords_are_not_shown(swipe, made):
    made["mqtt"] = Heard()
    with Outputs(["mqtt://me:secret@host/topic"], swipe.source) as outputs:
        assert outputs.end({})[0]["url"] == "mqtt://me:...@host/topic"
    with pytest.raises(EitskinError) as error:
        open_mqtt("mqtt://me:secret@127.0.0.1:99999", swipe.source)
    assert "secret" not in str(error.value) and "me:...@127.0.0.1" in str(error.value)


def test_tuio_needs_the_skin(swipe):
    with pytest.raises(EitskinError, match="bounding box"):
        Outputs(["tuio://127.0.0.1"], TouchSource("serial:x"))


@pytest.mark.parametrize("name", ["osc", "tuio", "ws", "mqtt", "lsl", "mcap", "foxglove"])
def test_a_missing_extra_is_named(name, swipe, monkeypatch, tmp_path):
    for package in ("pythonosc", "websockets", "paho", "pylsl", "mcap_ros2", "foxglove"):
        for loaded in [one for one in sys.modules if one.startswith(package)]:
            monkeypatch.delitem(sys.modules, loaded)
        monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr("eitskin.sinks.osc.find_spec", lambda package: None)
    where = {"lsl": "lsl:", "mcap": f"mcap:{tmp_path}/x.mcap", "foxglove": "foxglove:"}
    url = where.get(name, f"{name}://127.0.0.1:9")
    with pytest.raises(EitskinError, match=rf"eitskin\[{name}\]") as error:
        Outputs([url], swipe.source)
    assert error.value.exit_code == 9 and not list(tmp_path.iterdir())


def test_the_command_line_counts_what_was_sent(capsys, tmp_path):
    path = tmp_path / "t.csv"
    to = ("--to", f"csv:{path}", "--to", "udp://127.0.0.1:9")
    assert main(["stream", "--device", "sim:swipe", "--frames", "5", *to]) == 0
    said = capsys.readouterr().out
    assert f"to csv:{path}: 6 sent" in said and len(path.read_text().splitlines()) >= 6
    assert main(["stream", "--device", "sim:swipe", "--frames", "5", *to]) == 3
    assert "--overwrite" in capsys.readouterr().err
    assert main(["stream", "--device", "sim:swipe", "--frames", "5", "--overwrite", *to]) == 0


def test_sinks_are_found_by_entry_point():
    assert set(module.sinks()) >= {
        "udp", "ws", "osc", "tuio", "mqtt", "lsl", "csv", "mcap", "foxglove",
    }  # fmt: skip
