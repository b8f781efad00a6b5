"""A hostile page, another program on the port, or a full disk changes nothing that other users of
the live page notice."""

import json
import socket
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from served import TOKEN, serving, until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from eitskin.device.recordings.new_file import RecordingFile
from eitskin.errors import FileError
from eitskin.model.eitm import encode_model
from eitskin.page import connections
from eitskin.page.server import PageServer
from small_models import prebuilt


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("scene") / "one.toml"
    path.write_text(
        "[scene]\nframes = 10\nquiet_frames = 16\nelements = 1500\nrate_hz = 40.0\n"
        "[[touch]]\nx_mm = 20.0\ny_mm = 0.0\nradius_mm = 9.0\n"
    )
    return path


@pytest.fixture
def server(scene, tmp_path) -> Iterator[PageServer]:
    with serving(f"sim:{scene}?loop=1", folder=tmp_path) as one:
        yield one


@contextmanager
def page(server: PageServer) -> Iterator[ClientConnection]:
    origin = Origin(f"http://127.0.0.1:{server.port}")
    with connect(f"ws://127.0.0.1:{server.port}/live", origin=origin, compression=None) as line:
        line.send(json.dumps({"type": "hello", "token": TOKEN}))
        yield line


def frame_comes(server: PageServer) -> None:
    with page(server) as line:
        end = time.monotonic() + 20
        while not isinstance(line.recv(10), bytes):
            assert time.monotonic() < end


def raw(server: PageServer, content: bytes) -> socket.socket:
    line = socket.create_connection(("127.0.0.1", server.port), 10)
    line.sendall(content)
    return line


@pytest.mark.parametrize(
    "head",
    [
        b"GET / HTTP/1.1\r\nHost: [:::::]\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: [::::]:80\r\n\r\n",
        b"POST /model HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://[\r\nContent-Length: 0\r\n\r\n",
    ],
)
def test_headers_that_cannot_be_parsed_are_refused(server, head, capfd):
    with closing(raw(server, head)) as line:
        assert b" 403 " in line.recv(4096)
    assert "Traceback" not in capfd.readouterr().err


def test_an_upload_that_is_cut_off_is_quiet(server, capfd):
    head = f"POST /model HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nX-Eitskin-Token: {TOKEN}\r\n"
    with closing(raw(server, f"{head}Content-Length: 1000\r\n\r\nabc".encode())):
        time.sleep(0.2)
    frame_comes(server)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "number", ["Infinity", "-Infinity", "NaN", "1e999", "[" * 9000 + "]" * 9000]
)
def test_numbers_that_are_none_close_that_page(server, number, capfd):
    with page(server) as line:
        line.send('{"type": "drawn", "number": ' + number + "}")
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                line.recv(10)
    assert closed.value.rcvd is not None and closed.value.rcvd.code == 1003
    assert "Traceback" not in capfd.readouterr().err


def test_half_open_requests_keep_nobody_out(server, monkeypatch, capfd):
    lines = [raw(server, b"GET / HT") for _ in range(connections.MAX_CONNECTIONS + 70)]
    try:
        frame_comes(server)
        opened = sum(1 for _ in Path("/proc/self/fd").iterdir())  # the server is in this process
        assert opened < len(lines) + connections.MAX_CONNECTIONS + 60
    finally:
        for line in lines:
            line.close()
    assert "Traceback" not in capfd.readouterr().err


def test_a_request_has_a_limited_time(scene, monkeypatch):
    monkeypatch.setattr(connections, "HEAD_S", 0.3)
    with serving(f"sim:{scene}?loop=1") as one, closing(raw(one, b"GET / HTTP/1.1\r\n")) as line:
        line.settimeout(10)
        with pytest.raises(ConnectionResetError):
            assert line.recv(100) == b"" or line.recv(100)
            raise ConnectionResetError


@pytest.mark.parametrize("says_hello", [False, True])
def test_pings_whose_answers_are_not_read_are_cut(server, says_hello, monkeypatch):
    monkeypatch.setattr(connections, "MAX_UNREAD", 1 << 16)
    head = (
        f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\n"
        f"Connection: Upgrade\r\nOrigin: http://127.0.0.1:{server.port}\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    ping = bytes([0x89, 0xFD]) + bytes(4) + bytes(125)
    with closing(socket.socket()) as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.connect(("127.0.0.1", server.port))
        line.sendall(head.encode())
        line.settimeout(15)
        assert line.recv(12) == b"HTTP/1.1 101"
        if says_hello:
            said = json.dumps({"type": "hello"}).encode()
            line.sendall(bytes([0x81, 0x80 | len(said)]) + bytes(4) + said)
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            for _ in range(200_000):  # 26 MB
                line.sendall(ping * 10)
    frame_comes(server)


def test_a_model_with_a_skin_that_cannot_be_read_is_shown_without_it(server):
    model = prebuilt()[0]
    skin = {"skin": {"name": "odd", "diameter_mm": -5.0, "new_key": 1}}
    blob = encode_model(type(model)(**(vars_of(model) | {"meta": {**model.meta, "skin": skin}})))
    with page(server) as line:
        server.commands.upload(blob).result(30)
        setups = []
        until(lambda: setups.append(line.recv(10)) or '"skin":null' in str(setups[-1]))
    frame_comes(server)


def vars_of(model) -> dict:
    return {name: getattr(model, name) for name in type(model).__dataclass_fields__}


def test_a_full_disk_ends_the_recording_alone(server, monkeypatch, tmp_path):
    with page(server) as line:
        assert "recording to" in server.commands.record(True).result(20)
        session = server.reader.session
        assert session is not None and session.recorder is not None
        name = session.recorder.path

        def full(self: RecordingFile, data: bytes) -> None:
            raise FileError(f"{self.path}: cannot continue the recording (No space left on device)")

        monkeypatch.setattr(RecordingFile, "write", full)
        said: list[str] = []
        until(lambda: said.append(str(line.recv(10))) or "No space left" in said[-1])
        until(lambda: session.recorder is None)
        monkeypatch.undo()
        assert server.reader.state == "live"
        first = server.commands.record(True).result(20)
        assert server.commands.record(False).result(20).startswith("recorded ")
        second = server.commands.record(True).result(20)
        server.commands.record(False).result(20)
    assert first != second and name.exists()
    frame_comes(server)
