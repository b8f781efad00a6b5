"""Every sink, heard by a receiver that is not ours."""

import contextlib
import csv
import json
import queue
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import astuple, fields
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from ports import free_port
from swipe_frames import Swipe

import eitskin
from eitskin.device.wire.link_table import DriveTouch
from eitskin.session.frame import Frame
from eitskin.session.message import schema
from eitskin.sinks import websocket
from eitskin.sinks.outputs import Outputs

SUMMARY = {
    "frames": 40, "refused": 0, "faults": 0, "frames_a_second": 20.0, "solve_us_p50": None,
    "solve_us_p99": None, "link": {}, "board": None, "truth": None,
}  # fmt: skip
WAIT_S = 20.0
VALID = Draft202012Validator(schema())


def send(swipe: Swipe, url: str) -> None:
    """The whole swipe, and that all of it was sent."""
    with Outputs([url], swipe.source) as outputs:
        for item in swipe.items:
            outputs.put(item)
        (counts,) = outputs.end(SUMMARY)
    expected = {"url": url, "sent": len(swipe.items) + 1, "dropped": 0, "failed": 0, "error": None}
    assert counts == expected


def with_reports(swipe: Swipe, drives: Swipe) -> Swipe:
    """The whole swipe, and after it the reports of its beginning."""
    return Swipe([*swipe.items, *drives.reports], swipe.source)


def check(messages: list[dict[str, Any]], swipe: Swipe) -> None:
    """Check that the messages are valid, and contain the whole swipe in order."""
    for message in messages:
        VALID.validate(message)
    frames = [message for message in messages if message["type"] == "frame"]
    assert [m["frame"] for m in frames] == [frame.number for frame in swipe.frames]
    seen = [[(t["id"], t["x_mm"], t["y_mm"]) for t in m["touches"]] for m in frames]
    assert seen == [[(t.id, t.x_mm, t.y_mm) for t in touches] for touches in swipe.touches]
    assert sum(map(len, seen)) > 30 and messages[-1]["type"] == "summary"
    assert all(t["force_n"] is None for m in frames for t in m["touches"])


def test_a_plain_socket_gets_a_datagram_a_frame(swipe):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(WAIT_S)
        send(swipe, f"udp://127.0.0.1:{receiver.getsockname()[1]}")
        check([json.loads(receiver.recv(65536)) for _ in range(len(swipe.frames) + 1)], swipe)


@pytest.fixture
def osc() -> Iterator[tuple[int, queue.Queue[Any]]]:
    """pythonosc's server: its port, and what it heard."""
    from pythonosc.dispatcher import Dispatcher
    from pythonosc.osc_server import ThreadingOSCUDPServer

    heard: queue.Queue[Any] = queue.Queue()
    dispatcher = Dispatcher()
    dispatcher.set_default_handler(lambda path, *values: heard.put((path, *values)))

    class InOrder(ThreadingOSCUDPServer):
        def process_request(self, request: Any, address: Any) -> None:
            self.finish_request(request, address)

    with InOrder(("127.0.0.1", 0), dispatcher) as server:
        server.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server.server_address[1], heard
        server.shutdown()
        thread.join()


def test_gestures_go_out(osc):
    """A double tap of the library, as OSC and as valid messages."""
    port, heard = osc
    kinds = []
    for frame in eitskin.stream("sim:double_tap", to=[f"osc://127.0.0.1:{port}"]):
        message = frame.message()
        VALID.validate(message)
        kinds += [(one["kind"], one["x_mm"]) for one in message["events"] if one["kind"] != "move"]
    assert [kind for kind, _ in kinds][:6] == ["down", "up", "tap", "down", "up", "double-tap"]
    came: list[Any] = []
    while len(came) < len(kinds):
        path, *values = heard.get(timeout=WAIT_S)
        came += [values] if path == "/eitskin/event" and values[0] != "move" else []
    assert [values[0] for values in came] == [kind for kind, _ in kinds]
    assert [values[1] for values in came] == pytest.approx([x for _, x in kinds], abs=1e-4)


def test_osc(swipe, osc):
    port, heard = osc
    send(swipe, f"osc://127.0.0.1:{port}/table")
    for frame in swipe.frames:
        path, number, time_s, count = heard.get(timeout=WAIT_S)
        assert (path, number, count) == ("/table/frame", frame.number, len(frame.touches))
        assert time_s == pytest.approx(frame.time_s, abs=1e-5)
        for touch in frame.touches:
            path, one, x, y, _, _, force, confidence, sure, *covariance = heard.get(timeout=WAIT_S)
            assert (path, one, force, sure) == ("/table/touch", touch.id, None, touch.confirmed)
            assert (x, y) == pytest.approx((touch.x_mm, touch.y_mm), rel=1e-6)
            assert confidence == (touch.confidence and pytest.approx(touch.confidence, rel=1e-6))
            known = (touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2)
            assert covariance == pytest.approx(known, rel=1e-6)
        for event in frame.events:
            path, kind, x, y, _, _, zone, one = heard.get(timeout=WAIT_S)
            assert (path, kind, zone, one) == ("/table/event", event.name, None, event.first_id)
            assert (x, y) == pytest.approx((event.x_mm, event.y_mm), rel=1e-6)


def test_tuio(swipe, osc):
    port, heard = osc
    send(swipe, f"tuio://127.0.0.1:{port}")
    x0, y0, x1, y1 = swipe.source.model.skin.outline.bounding_box_mm
    last: dict[int, tuple[float, float]] = {}
    for number, touches in enumerate([*swipe.touches, []], 1):
        bundle: dict[str, list[Any]] = {"set": []}
        while "fseq" not in bundle:
            path, kind, *values = heard.get(timeout=WAIT_S)
            assert path == "/tuio/2Dcur"
            if kind == "set":
                bundle["set"].append(values)
            else:
                bundle[kind] = values
        assert bundle["fseq"] == [number] and bundle["source"][0].startswith("eitskin-simulated-")
        assert bundle["alive"] == [t.id for t in touches] == [one[0] for one in bundle["set"]]
        for touch, (_, x, y, speed_x, *_) in zip(touches, bundle["set"], strict=True):
            place = (x0 + x * (x1 - x0), y1 - y * (y1 - y0))
            assert place == pytest.approx((touch.x_mm, touch.y_mm), abs=1e-3)
            if touch.id in last:
                moved = (x - last[touch.id][0]) * 20  # frames a second
                assert speed_x == pytest.approx(moved, abs=1e-4)
        last = {one[0]: (one[1], one[2]) for one in bundle["set"]}


def test_tuio_of_drives(drives, osc):
    """A bundle a report, with its speeds; of frames only of those without, and with no touch."""
    port, heard = osc
    send(drives, f"tuio://127.0.0.1:{port}")
    x0, y0, x1, y1 = drives.source.model.skin.outline.bounding_box_mm
    expected, reported = list[list[Any]](), 0
    for item in drives.items:
        if isinstance(item, Frame):
            expected += [[]] if item.number > reported else []
            continue
        reported = item.frame
        expected.append([
            pytest.approx((
                one.id, (one.x_mm - x0) / (x1 - x0), (y1 - one.y_mm) / (y1 - y0),
                one.vx_mm_per_s / (x1 - x0), -one.vy_mm_per_s / (y1 - y0),
            ), rel=1e-5)
            for one in item.touches
        ])  # fmt: skip
    assert len(expected) > len(drives.reports)
    seen = list[list[Any]]()
    while len(seen) < len(expected) + 1:
        _, kind, *values = heard.get(timeout=WAIT_S)
        seen += [[]] if kind == "source" else []
        seen[-1] += [tuple(values[:5])] if kind == "set" else []
    assert seen == [*expected, []]


def test_tuio_lifts_its_fingers_where_the_stream_is_cut(swipe, osc):
    port, heard = osc
    touched = next(frame for frame in swipe.frames if frame.touches)
    with Outputs([f"tuio://127.0.0.1:{port}"], swipe.source) as outputs:
        outputs.put(touched)
    alive: list[Any] = []
    while len(alive) < 2:
        _, kind, *values = heard.get(timeout=WAIT_S)
        alive += [values] if kind == "alive" else []
    assert alive == [[t.id for t in touched.touches], []]


UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def test_websocket_clients(swipe):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    url = f"ws://127.0.0.1:{free_port()}"
    with Outputs([url], swipe.source) as outputs:
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, origin="http://elsewhere.example")
        with connect(url, max_size=None) as one, connect(url, origin="http://localhost:80") as two:
            for frame in swipe.frames:
                outputs.put(frame)
            (counts,) = outputs.end(SUMMARY)
            assert (counts["sent"], counts["dropped"]) == (len(swipe.frames) + 1, 0)
            for client in (one, two):
                check([json.loads(text) for text in client], swipe)


def test_a_websocket_client_that_never_reads_is_left_out(swipe):
    from websockets.sync.client import connect

    port = free_port()
    url = f"ws://127.0.0.1:{port}"
    with (
        Outputs([url], swipe.source, patient=True) as outputs,
        socket.socket() as deaf,
        connect(url) as good,
    ):
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.connect(("127.0.0.1", port))
        deaf.sendall(UPGRADE)
        assert deaf.recv(12) == b"HTTP/1.1 101"
        for _ in range(200):  # until all buffers on the way are full
            if outputs.counts[0]["dropped"]:
                break
            for frame in swipe.frames:
                outputs.put(frame)
            for _ in swipe.frames:
                good.recv(timeout=WAIT_S)
        (counts,) = outputs.counts
        assert counts["dropped"] > 0 and counts["failed"] == 0


def test_a_websocket_client_that_only_pings_is_cut(swipe, monkeypatch):
    """Each ping is answered at once, so answers that nobody reads would fill the memory."""
    from websockets.sync.client import connect

    monkeypatch.setattr(websocket, "FULL_BYTES", 1 << 15)
    port = free_port()
    url = f"ws://127.0.0.1:{port}"
    ping = bytes([0x89, 0xFD]) + bytes(4) + bytes(125)
    with Outputs([url], swipe.source) as outputs, socket.socket() as deaf, connect(url) as good:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.connect(("127.0.0.1", port))
        deaf.sendall(UPGRADE)
        assert deaf.recv(12) == b"HTTP/1.1 101"
        deaf.settimeout(WAIT_S)
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            for _ in range(20_000):  # 26 MB
                deaf.sendall(ping * 10)
        outputs.put(swipe.frames[0])
        assert json.loads(good.recv(timeout=WAIT_S))["type"] == "frame"


@contextlib.contextmanager
def running_broker(port: int) -> Iterator[None]:
    """Debian's mosquitto."""
    program = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
    assert program, "Debian's mosquitto is missing; scripts/test installs it"
    with subprocess.Popen([program, "-p", str(port), "-v"], stderr=subprocess.PIPE) as running:
        assert running.stderr is not None
        while not running.stderr.readline().endswith(b" running\n"):
            assert running.poll() is None
        yield
        running.terminate()


@pytest.fixture
def broker() -> Iterator[int]:
    port = free_port()
    with running_broker(port):
        yield port


def test_a_broker_that_comes_back_is_told_again(swipe):
    port = free_port()

    def put_until(count: str) -> None:
        before, end_s = outputs.counts[0][count], time.monotonic() + WAIT_S
        while outputs.counts[0][count] == before and time.monotonic() < end_s:
            outputs.put(swipe.frames[0])
            time.sleep(0.02)
        assert outputs.counts[0][count] > before

    with running_broker(port):
        outputs = Outputs([f"mqtt://127.0.0.1:{port}"], swipe.source)
        put_until("sent")
    with outputs:
        put_until("dropped")
        with running_broker(port):
            put_until("sent")
            assert outputs.end(SUMMARY)[0]["failed"] == 0


def test_mqtt(swipe, broker):
    from paho.mqtt.client import Client
    from paho.mqtt.enums import CallbackAPIVersion

    heard: queue.Queue[Any] = queue.Queue()
    client = Client(CallbackAPIVersion.VERSION2)
    client.on_subscribe = lambda *_: heard.put("subscribed")
    client.on_message = lambda _client, _data, message: heard.put((message.topic, message.payload))
    client.connect("127.0.0.1", broker)
    client.subscribe("skin/left/#")
    client.loop_start()
    assert heard.get(timeout=WAIT_S) == "subscribed"
    send(swipe, f"mqtt://127.0.0.1:{broker}/skin/left")
    came = [heard.get(timeout=WAIT_S) for _ in range(len(swipe.frames) + 1)]
    client.loop_stop()
    check([json.loads(payload) for _, payload in came], swipe)
    assert {topic for topic, _ in came} == {"skin/left/frame", "skin/left/summary"}


def test_lsl(swipe):
    import pylsl

    with Outputs(["lsl:table?touches=2"], swipe.source) as outputs:
        (info,) = pylsl.resolve_byprop("name", "table", timeout=WAIT_S)
        inlet = pylsl.StreamInlet(info)
        inlet.open_stream(timeout=WAIT_S)
        for frame in swipe.frames:
            outputs.put(frame)
        for touches in swipe.touches:
            sample, _ = inlet.pull_sample(timeout=WAIT_S)
            assert sample[0] == len(touches) and len(sample) == 1 + 2 * 10
            for k, touch in enumerate(touches):
                one = sample[1 + 10 * k : 11 + 10 * k]
                assert one[:3] == pytest.approx((touch.id, touch.x_mm, touch.y_mm), rel=1e-6)
                assert np.isnan(one[5])
                assert one[6] == touch.confirmed
                assert one[7] == pytest.approx(touch.x_variance_mm2, rel=1e-6)
        inlet.close_stream()


def test_lsl_of_drives(drives):
    """A stream of their own, from the first report on."""
    import pylsl

    with Outputs(["lsl:table?touches=2"], drives.source) as outputs:
        outputs.put(drives.reports[0])
        (info,) = pylsl.resolve_byprop("name", "table-drives", timeout=WAIT_S)
        assert (info.nominal_srate(), info.channel_count()) == (0, 2 + 2 * 10)
        inlet = pylsl.StreamInlet(info)
        inlet.open_stream(timeout=WAIT_S)
        for report in drives.reports[1:]:
            outputs.put(report)
        for report in drives.reports[1:]:
            (touch,) = report.touches
            sample, _ = inlet.pull_sample(timeout=WAIT_S)
            speed = [touch.vx_mm_per_s, touch.vy_mm_per_s, touch.strength_s_per_m_mm2]
            place = [touch.id, touch.confirmed, touch.x_mm, touch.y_mm]
            sure = [touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2]
            assert sample[:12] == [report.time_s, 1, *place, *speed, *sure]
            assert np.isnan(sample[12:]).all()
        inlet.close_stream()


def test_csv(swipe, drives, tmp_path):
    path = tmp_path / "touches.csv"
    send(with_reports(swipe, drives), f"csv:{path}")
    with path.open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    rows = [line for line in lines if not line["drive"]]
    names = ("time_s", "drive", "id", "x_mm", "vx_mm_per_s", "vy_mm_per_s", "confirmed")
    told_of_drives = [[line[name] for name in names] for line in lines[len(rows) :]]
    assert told_of_drives == [
        [str(one.time_s), str(one.drive)]
        + [str(getattr(touch, name)) if touch else "" for name in names[2:]]
        for one in drives.reports
        for touch in one.touches or [None]
    ]
    found = [row for row in rows if row["id"]]
    assert len({row["frame"] for row in rows}) == len(swipe.frames)
    seen = [(int(row["id"]), float(row["x_mm"])) for row in found]
    assert seen == [(t.id, t.x_mm) for touches in swipe.touches for t in touches]
    assert {row["force_n"] for row in rows} == {""}


def test_mcap(swipe, drives, tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    path = tmp_path / "touches.mcap"
    send(with_reports(swipe, drives), f"mcap:{path}")
    came: dict[str, list[Any]] = {}
    stamps = []
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages():
            came.setdefault(channel.topic, []).append(content)
            stamps += [message.log_time / 1e9] if channel.topic == "/touches" else []
    touches = came["/touches"]
    assert [[(t.id, t.x_mm) for t in one.touches] for one in touches] == [
        [(t.id, t.x_mm) for t in listed] for listed in swipe.touches
    ]
    assert stamps == pytest.approx([frame.time_unix_s for frame in swipe.frames], abs=1e-6)
    image, grid = came["/image"][20], swipe.source.model.grid
    picture = np.frombuffer(bytes(image.data), "<f4").reshape(image.height, image.width)[::-1]
    assert image.encoding == "32FC1" and image.step == 4 * image.width
    np.testing.assert_array_equal(grid.values(picture), swipe.frames[20].image)
    assert [one.level for one in came["/diagnostics"][0].status] == [0]
    assert [(one.frame, one.drive, one.time_s) for one in came["/reports"]] == [
        (one.frame, one.drive, one.time_s) for one in drives.reports
    ]
    for message, report in zip(came["/reports"], drives.reports, strict=True):
        names = [field.name for field in fields(DriveTouch)][:-3]  # then the covariance
        seen = [
            (*(getattr(touch, name) for name in names), *touch.covariance_mm2)
            for touch in message.touches
        ]
        assert seen == [astuple(touch) for touch in report.touches]


KILLED = """
import os, signal, sys, time
from eitskin.cli import live_output
from eitskin.session.session import Session
from eitskin.sinks import websocket
from eitskin.sinks.outputs import Outputs
from eitskin.sinks.sink import TouchSource
source = TouchSource("x")
with Session("sim:swipe") as session, Outputs(sys.argv[1:], source, patient=True) as outputs:
    items = [outputs.put(item) for item in session.messages()]
    until = time.monotonic() + 20
    while min(one["sent"] for one in outputs.counts) < len(items) and time.monotonic() < until:
        pass
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_files_of_a_killed_program_can_be_read(swipe, tmp_path):
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader
    from mcap_ros2.decoder import DecoderFactory

    table, log = tmp_path / "touches.csv", tmp_path / "touches.mcap"
    killed = subprocess.run([sys.executable, "-c", KILLED, f"csv:{table}", f"mcap:{log}"])
    assert killed.returncode == -signal.SIGKILL
    with table.open(newline="") as stream:
        assert len({row["frame"] for row in csv.DictReader(stream)}) == len(swipe.frames)
    frames = []
    with log.open("rb") as stream, pytest.raises(EndOfFile):
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages(log_time_order=False):
            frames += [message.frame] if channel.topic == "/touches" else []
    assert frames == [frame.number for frame in swipe.frames[: len(frames)]]


def test_foxglove(swipe, drives):
    """By the protocol that Foxglove publishes: text for what there is, binary for messages."""
    from websockets.sync.client import connect

    port = free_port()
    with (
        Outputs([f"foxglove://127.0.0.1:{port}"], swipe.source) as outputs,
        connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=["foxglove.sdk.v1"],
            max_size=None,
        ) as client,
    ):
        channels: dict[str, Any] = {}
        topics = ("/touches", "/image", "/reports")
        while not set(topics) <= set(channels):
            text = json.loads(client.recv(timeout=WAIT_S))
            if text["op"] == "advertise":
                channels |= {one["topic"]: one for one in text["channels"]}
        assert channels["/touches"]["encoding"] == "json"
        described = json.loads(channels["/reports"]["schema"])
        Draft202012Validator.check_schema(described)
        wanted = [{"id": k, "channelId": channels[topic]["id"]} for k, topic in enumerate(topics)]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        came: dict[int, list[bytes]] = {0: [], 1: [], 2: []}

        def take(timeout_s: float) -> None:
            data = client.recv(timeout=timeout_s)
            if isinstance(data, bytes) and data[0] == 1:
                came[int.from_bytes(data[1:5], "little")].append(data[13:])

        while not came[0]:  # the subscription holds from a moment on that nobody can foresee
            outputs.put(swipe.frames[0])
            with contextlib.suppress(TimeoutError):
                take(0.05)
        for item in (*swipe.frames[1:], *drives.reports):
            outputs.put(item)
        while len(came[2]) < len(drives.reports):
            take(WAIT_S)
        assert came[1]
    seen = [json.loads(payload) for payload in came[0][-len(swipe.frames) + 1 :]]
    for message in seen:
        VALID.validate(message)
    assert [m["frame"] for m in seen] == [frame.number for frame in swipe.frames[1:]]
    reports = [json.loads(payload) for payload in came[2]]
    assert reports == [report.message() for report in drives.reports]
    assert all(Draft202012Validator(described).is_valid(report) for report in reports)
