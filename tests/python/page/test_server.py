"""Rights to watch and to command, the effect of a slow page on others, and refused requests."""

import asyncio
import json
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from served import TOKEN, serving, until
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from eitskin.cli.main import main
from eitskin.device.client import Device
from eitskin.device.wire.link_table import Stream
from eitskin.page.facts import HEAD, MAGIC
from eitskin.page.hub import IN_FLIGHT, Hub, Outgoing, PageClient
from eitskin.page.server import FILES, MAX_WAITING, NO_TOKEN, PageServer
from eitskin.session import session as session_module
from fresh_python import INTERRUPTIBLE
from line_of_a_board import Line


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("scene") / "one.toml"
    path.write_text(
        "[scene]\nframes = 10\nquiet_frames = 16\nelements = 1500\nrate_hz = 48.0\n"
        "[[touch]]\nx_mm = 20.0\ny_mm = 0.0\nradius_mm = 9.0\n"
    )
    return path


@pytest.fixture(scope="module")
def server(scene) -> Iterator[PageServer]:
    with serving(f"sim:{scene}?loop=1") as one:
        yield one


@contextmanager
def opened(
    server: PageServer, token: object, origin: str | None = "its own"
) -> Iterator[ClientConnection]:
    """A page's WebSocket that has said who it is."""
    if origin == "its own":
        origin = f"http://127.0.0.1:{server.port}"
    url = f"ws://127.0.0.1:{server.port}/live"
    with connect(url, origin=origin, compression=None) as line:
        line.send(json.dumps({"type": "hello", "token": token}))
        yield line


def reported(line: ClientConnection, kind: str) -> dict:
    """The next message of a kind."""
    while True:
        said = line.recv(10)
        if isinstance(said, str) and (message := json.loads(said))["type"] == kind:
            return dict(message)


def got(server: PageServer, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}{path}", headers=headers)
    if "X-Eitskin-Token" in headers:
        request.method, request.data = "POST", b"no model"
    try:
        with urllib.request.urlopen(request, timeout=10) as reply:
            return reply.status, dict(reply.headers), reply.read()
    except urllib.error.HTTPError as error:
        return error.code, dict(error.headers), error.read()


def test_files_say_that_nothing_else_may_be_loaded(server):
    for path in FILES:
        status, headers, content = got(server, path)
        assert status == 200
        assert content
        lines = {key.lower(): value for key, value in headers.items()}
        policy = lines["content-security-policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'")
        assert "unsafe" not in policy
        assert lines["x-content-type-options"] == "nosniff"
        assert b"http://" not in content.replace(b"http://www.w3.org/2000/svg", b"")
        assert b"https://" not in content
    assert got(server, "/../server.py")[0] == 404


def test_a_frame_is_what_is_documented(server):
    with opened(server, TOKEN) as line:
        setup = reported(line, "setup")
        assert setup["mode"] == ["raw", "image", "touches"]
        while isinstance(data := line.recv(10), str):
            pass
    magic, number, pixels, rows = HEAD.unpack_from(data)
    assert magic == MAGIC and number > 0
    assert (pixels, rows) == (len(setup["skin"]["cells"]), 208)
    image = np.frombuffer(data, "<f4", pixels, HEAD.size)
    volts = np.frombuffer(data, "<f4", rows, HEAD.size + 4 * pixels)
    message = json.loads(data[HEAD.size + 4 * (pixels + rows) :])
    assert np.isfinite(image).all() and np.isfinite(volts).all()
    assert message["type"] == "frame" and len(message["true"]) == 1
    assert not {"image_s_per_m", "voltage_v"} & set(message)


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example:80", "", "127.0.0.1:80; script-src *"]
)
def test_another_hosts_name_is_refused(server, host):
    assert got(server, "/", Host=host)[0] in (400, 403)


@pytest.mark.parametrize("origin", ["http://evil.example", "null", None])
def test_another_sites_page_is_refused(server, origin):
    with pytest.raises(InvalidStatus, match="403"), opened(server, TOKEN, origin):
        pass


def test_a_model_needs_the_token_and_the_same_site(server):
    assert got(server, "/model", **{"X-Eitskin-Token": "guess"})[0] == 401
    foreign = {"X-Eitskin-Token": TOKEN, "Origin": "http://evil.example"}
    assert got(server, "/model", **foreign)[0] == 403
    status, _, said = got(server, "/model", **{"X-Eitskin-Token": TOKEN})
    assert status == 400
    assert "the uploaded file" in json.loads(said)["error"]


@pytest.mark.parametrize("token", [None, "", "guess", 7])
def test_commands_need_the_token(server, token):
    with opened(server, token) as line:
        assert reported(line, "setup")["may_command"] is False
        for what in ("tare", "pause", "record", "sign"):
            line.send(json.dumps({"type": "do", "do": what, "value": True}))
            answer = reported(line, "answer")
            assert not answer["ok"]
            assert "needs the token" in answer["text"]
    assert not server.reader.live().pacer.paused


@pytest.mark.parametrize(
    "said", ["no json", "[1]", '{"type": "drawn"}', '{"type": "drawn", "number": "x"}']
)
def test_a_page_that_talks_nonsense_is_let_go(server, said):
    with opened(server, TOKEN) as line:
        reported(line, "setup")
        line.send(said)
        with pytest.raises(ConnectionClosed):
            while True:
                line.recv(10)


ORDERS = ["fly", "preset", "sign", "iterations", "mode", "speed", "press", "seek"]


@pytest.mark.parametrize("what", ORDERS)
def test_an_order_that_cannot_be_is_answered(server, what):
    with opened(server, TOKEN) as line:
        line.send(json.dumps({"type": "do", "do": what, "value": ["x"]}))
        answer = reported(line, "answer")
        assert not answer["ok"]


def test_commands_of_a_board_that_falls_silent_are_answered_and_the_page_starts_it_again(
    monkeypatch,
):
    """Two pages ask for a tare before the session fails; then one presses  Start again."""
    board = Line()
    monkeypatch.setattr(session_module, "open_with_files", lambda *files, **how: Device(board))
    with (
        serving("serial:fake", Stream.RAW) as server,
        opened(server, TOKEN) as page,
        opened(server, TOKEN) as other,
    ):
        until(lambda: server.reader.frames > 3)
        board.silent = True
        for one in (page, other):
            one.send(json.dumps({"type": "do", "do": "tare"}))
        for one in (page, other):
            answer = reported(one, "answer")
            assert not answer["ok"] and "has fallen silent" in answer["text"]
        until(lambda: server.reader.state == "failed")
        board.silent = False
        page.send(json.dumps({"type": "do", "do": "play"}))
        assert reported(page, "answer")["text"] == "starting again"
        until(lambda: server.reader.state == "live")
        page.send(json.dumps({"type": "do", "do": "tare"}))
        assert reported(page, "answer")["ok"]


def test_a_command_that_is_not_answered_yet_keeps_no_other_from_its_answer(server, monkeypatch):
    """Sixteen may wait; one more is refused."""
    never: Future[str] = Future()
    monkeypatch.setattr(server.commands, "tare", lambda: never)
    with opened(server, TOKEN) as line:
        for _ in range(MAX_WAITING - 1):
            line.send(json.dumps({"type": "do", "do": "tare"}))
        line.send(json.dumps({"type": "do", "do": "sign", "value": "up"}))
        assert "cannot be" in reported(line, "answer")["text"]
        for _ in range(2):
            line.send(json.dumps({"type": "do", "do": "tare"}))
        assert "are not answered yet" in reported(line, "answer")["text"]


def test_from_elsewhere_even_looking_on_needs_the_token(scene):
    with serving(f"sim:{scene}?loop=1", remote=True, host="0.0.0.0") as server:
        with opened(server, "guess") as line, pytest.raises(ConnectionClosed) as end:
            while True:
                line.recv(10)
        assert end.value.rcvd is not None
        assert end.value.rcvd.code == NO_TOKEN
        with opened(server, TOKEN) as line:
            assert reported(line, "setup")["may_command"] is True
        assert got(server, "/", Host=f"evil.example:{server.port}")[0] == 403


def test_a_page_that_reads_nothing_disturbs_nobody(server):
    """It says that it has drawn nothing: it gets a few frames, the rest is dropped and counted."""
    with opened(server, TOKEN) as slow, opened(server, TOKEN) as quick:
        reported(slow, "setup")
        seen = 0
        while seen < 30:
            said = quick.recv(10)
            if isinstance(said, bytes):
                seen += 1
                number = HEAD.unpack_from(said)[1]
                quick.send(json.dumps({"type": "drawn", "number": number}))
        dropped = sorted(page.dropped for page in server.hub.pages)
        sent = sorted(page.sent for page in server.hub.pages)
    assert sent[0] == IN_FLIGHT
    assert dropped[1] > 15
    assert sent[1] >= 30
    until(lambda: not server.hub.pages)


def test_what_a_page_cannot_take_is_dropped_and_counted():
    async def run() -> tuple[list[int], PageClient]:
        hub, page = Hub(), PageClient()
        hub.pages.add(page)
        got_numbers = []
        for number in range(1, IN_FLIGHT + 1):
            hub.offer(Outgoing(number, bytes([number]), 0))
            got_numbers.append((await page.next())[0])
        for number in range(5, 9):
            hub.offer(Outgoing(number, bytes([number]), 0))
        page.drawn(2)
        got_numbers.append((await page.next())[0])
        hub.tell("words go first")
        hub.offer(Outgoing(9, bytes([9]), 0))
        assert await page.next() == "words go first"
        return got_numbers, page

    numbers, page = asyncio.run(run())
    assert numbers == [1, 2, 3, 4, 8]
    assert (page.sent, page.dropped) == (5, 3)


def refused(capsys: pytest.CaptureFixture[str], code: int, *arguments: str) -> str:
    assert main(["view", "--device", "sim:two_touch", *arguments]) == code
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_taken_port(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        line = refused(capsys, 2, "--port", str(taken.getsockname()[1]))
    assert "another program has it" in line
    assert "--port 0" in line


def test_other_hosts_without_a_token(capsys, tmp_path):
    assert "--token WORD" in refused(capsys, 2, "--host", "0.0.0.0", "--port", "0")
    assert "at least 12" in refused(capsys, 2, "--token", "short")
    assert "no such folder" in refused(capsys, 3, "--folder", str(tmp_path / "none"))
    assert "cannot listen" in refused(capsys, 2, "--host", "no.such.host.invalid", "--token", TOKEN)


def test_what_keeps_it_from_starting_is_said_once(capsys):
    assert main(["view", "--port", "0", "--device", "sim:none.toml"]) == 3
    said = capsys.readouterr().err
    assert said.count("none.toml: no such scene") == 1 and "Traceback" not in said


def test_the_command_says_where_and_ends_by_the_keyboard(scene, tmp_path):
    command = [sys.executable, "-c", INTERRUPTIBLE, "view", "--device", f"sim:{scene}?loop=1"]
    command += ["--port", "0", "--token", "a-word-for-tests", "--to", f"csv:{tmp_path}/t.csv"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.fullmatch(r"open (http://127\.0\.0\.1:(\d+))/#token=a-word-for-tests\n", line)
        assert found is not None
        with connect(
            f"ws://127.0.0.1:{found.group(2)}/live", origin=Origin(found.group(1))
        ) as page:
            page.send(json.dumps({"type": "hello", "token": "a-word-for-tests"}))
            while not isinstance(page.recv(20), bytes):
                pass
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=20)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert errors.splitlines()[-1] == "eitskin: stopped"
    assert len((tmp_path / "t.csv").read_text().splitlines()) > 1


def test_a_tare_under_a_finger_is_refused_then_taken_and_undone(tmp_path):
    """The second tare within seconds takes the reference all the same; the page offers undo."""
    path = tmp_path / "long.toml"
    path.write_text(
        "[scene]\nframes = 4000\nquiet_frames = 16\nelements = 1500\nrate_hz = 48.0\n"
        "[[touch]]\nx_mm = 20.0\ny_mm = 0.0\nradius_mm = 9.0\n"
    )
    with serving(f"sim:{path}?speed=1") as server, opened(server, TOKEN) as line:
        assert not reported(line, "setup")["can_undo_tare"]

        def ask(what: str) -> tuple[bool, str, bool]:
            """Whether it was done, the answer's text, and whether a tare can be undone now."""
            line.send(json.dumps({"type": "do", "do": what}))
            can_undo = reported(line, "setup")["can_undo_tare"]
            answer = reported(line, "answer")
            return answer["ok"], answer["text"], can_undo

        ok, text, can_undo = ask("tare")
        assert not ok and not can_undo
        assert re.search(r"touches the skin at \(\d+, -?\d+\) mm", text)
        assert "press Tare again within 10 s" in text
        assert ask("tare") == (True, "reference taken from 16 frames", True)
        assert ask("undo-tare") == (True, "the reference before the last tare is back", False)
        ok, text, _ = ask("undo-tare")
        assert not ok and "does not keep" in text


@pytest.mark.parametrize(
    "value",
    [None, "x", [1.0, 2.0], [[1.0]], [[1.0, None]], [[1.0, True]], [[1e9, 0.0]], [[0.0, 0.0]] * 6],
)
def test_a_press_that_cannot_be_is_refused(server, value):
    with opened(server, TOKEN) as line:
        name = reported(line, "setup")["skins"][0]["source"]
        for one in (value, {name: value}, {"another": []}):
            line.send(json.dumps({"type": "do", "do": "press", "value": one}))
            answer = reported(line, "answer")
            assert not answer["ok"] and "press" in answer["text"]
    assert server.reader.live().device.transport.board.fingers == ()


def test_a_real_board_is_not_pressed_and_has_no_timeline(monkeypatch):
    monkeypatch.setattr(session_module, "open_with_files", lambda *files, **how: Device(Line()))
    with serving("serial:fake", Stream.RAW) as server, opened(server, TOKEN) as line:
        (skin,) = reported(line, "setup")["skins"]
        name = skin["source"]
        assert skin["finger_mm"] is None
        line.send(json.dumps({"type": "do", "do": "press", "value": {name: [[0, 0]]}}))
        answer = reported(line, "answer")
        assert not answer["ok"] and "only the skin of  sim:  can be pressed" in answer["text"]
        line.send(json.dumps({"type": "do", "do": "seek", "value": 1}))
        answer = reported(line, "answer")
        assert not answer["ok"] and "is not a recording" in answer["text"]


def test_a_recording_needs_the_token_and_must_be_there(server):
    assert got(server, "/recording")[0] == 401
    request = urllib.request.Request(
        f"http://127.0.0.1:{server.port}/recording", headers={"X-Eitskin-Token": TOKEN}
    )
    with pytest.raises(urllib.error.HTTPError) as error:
        urllib.request.urlopen(request, timeout=10)
    assert error.value.code == 404
    assert "nothing has been recorded here yet" in json.loads(error.value.read())["error"]
