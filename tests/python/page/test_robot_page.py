"""A robot on the live page: every skin's frames, and commands for all of them."""

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from served import TOKEN, serving
from websockets.sync.client import ClientConnection, connect

import eitskin
from eitskin.page.facts import HEAD
from eitskin.page.hub import IN_FLIGHT, Outgoing, PageClient
from eitskin.page.server import PageServer
from eitskin.robot.description import load_robot
from eitskin.surface.outline import surface_map
from eitskin.surface.shapes import make_shape

ARM = Path(__file__).resolve().parents[3] / "examples" / "robot" / "arm.urdf"
SKINS = ["upper_arm", "forearm", "palm"]


@pytest.fixture(scope="module")
def server(tmp_path_factory) -> Iterator[PageServer]:
    folder = tmp_path_factory.mktemp("recordings")
    with serving(f"robot:{ARM}?loop=1", folder=folder) as one:
        yield one


def read(line: ClientConnection) -> dict:
    """The next message, or a frame's JSON."""
    said = line.recv(20)
    if isinstance(said, str):
        return dict(json.loads(said))
    _, number, pixels, rows = HEAD.unpack_from(said)
    line.send(json.dumps({"type": "drawn", "number": number}))
    return dict(json.loads(said[HEAD.size + 4 * (pixels + rows) :]))


def test_a_page_follows_every_skin_and_commands_all(server):
    url = f"ws://127.0.0.1:{server.port}/live"
    with connect(url, origin=f"http://127.0.0.1:{server.port}", compression=None) as line:  # type: ignore[arg-type]
        line.send(json.dumps({"type": "hello", "token": TOKEN}))
        setup, came = None, []
        while setup is None or set(came[-12:]) != set(SKINS):
            message = read(line)
            if message["type"] == "setup":
                setup = message
            elif message["type"] == "frame":
                came.append(message["source"])
        assert setup["name"] == "arm" and setup["timed"] and setup["speed"] == 1
        skins = setup["skins"]
        assert [one["source"] for one in skins] == SKINS
        assert [one["link"] for one in skins] == ["upper_arm", "forearm", "hand"]
        # the palm lies 1.15 m above the base and looks along x
        pose = np.array(skins[2]["pose"])
        assert pose[:3, 3] == pytest.approx([0.02, 0, 1.15])
        assert pose[:3, 2] == pytest.approx([1, 0, 0], abs=1e-6)
        assert np.array(skins[2]["link_pose"])[:3, 3] == pytest.approx([0, 0, 1.15])
        assert all(one["skin"]["outline_mm"] for one in skins)
        for what, value, text in (
            ("mode", ["touches"], "streaming touches"),
            ("pause", None, "paused"),
            ("sign", "both", "solver: sign both"),
            ("play", None, "playing"),
            ("record", True, "recording to eitskin-"),
            ("record", True, "is being recorded to eitskin-"),
            ("undo-tare", None, "stop the recording first"),
            ("record", False, "ended eitskin-"),
            ("record", False, "nothing is being recorded"),
        ):
            line.send(json.dumps({"type": "do", "do": what, "value": value}))
            while (message := read(line))["type"] != "answer":
                pass
            assert text in message["text"], message
    (recorded,) = server.reader.folder.iterdir()
    starts_s = [skin.starts_s for skin in load_robot(recorded / "robot.toml").skins]
    assert min(starts_s) > 0 and max(starts_s) - min(starts_s) < 0.5
    assert {f.source for f in eitskin.stream(str(recorded / "robot.toml"))} == set(SKINS)
    assert {part.settings.solver.sign for part in server.reader.live().parts.values()} == {"both"}


def test_a_page_gets_the_newest_frame_of_each_skin_in_turn():
    page = PageClient()
    for number, source in enumerate("abab", 1):
        page.offer(Outgoing(number, source.encode(), 0, source))
    assert page.dropped == 2
    assert [asyncio.run(page.next()) for _ in "ab"] == [b"a", b"b"]
    for number in range(5, 5 + 2 * IN_FLIGHT):
        page.offer(Outgoing(number, b"c", 0, "a"))
    assert page.dropped == 2 + 2 * IN_FLIGHT - 1


def test_a_page_gets_a_surface_once_and_before_the_setup():
    """A setup comes with each change of state, and a surface of 4,000 triangles has 160 kB."""
    page, surface = PageClient(), surface_map(*make_shape("saddle", 200))

    def came(count: int) -> list[object]:
        texts = [asyncio.run(page.next()) for _ in range(count)]
        return [text if text == "setup" else json.loads(text)["surface"] for text in texts]

    for _ in range(2):
        page.tell("setup")
        page.show("a", surface)
        page.show("flat", None)
    first, *setups = came(3)
    assert isinstance(first, dict) and len(first["triangles"]) == len(surface.triangles)
    assert setups == ["setup"] * 2
    page.show("a", None)  # a model without it was uploaded
    assert came(1) == [None]
