"""Boards for tests of the command line: a small scene, and a simulated board behind a
pseudo-terminal as behind a port."""

from __future__ import annotations

import os
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from eitskin.device.bank import BANK_BYTES, ERASED, bank_bytes
from eitskin.device.simulated import SimBoard
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.board_frames import BoardFrames
from eitskin.scene.library_scenes import find_scene

SCENE = """
[scene]
name = "one"
frames = {frames}
quiet_frames = 8
elements = 900

[[touch]]
radius_mm = 9.0
contrast = 9.0
x_mm = -40.0
y_mm = 10.0

[effects.noise]
snr_db = 60.0
"""


def write_scene(path: Path, frames: int = 6) -> Path:
    """A scene of ``frames`` frames with one touch at (-40, 10), coarsely meshed."""
    path.write_text(SCENE.format(frames=frames), encoding="utf-8")
    return path


def board_of(scene: Path, model: bytes | None = None, *, begun: bool = False) -> SimBoard:
    """A simulated board before ``scene`` with ``model`` (b"": none); ``begun``: its skin is touched
    from the start."""
    blob = load_prebuilt()[1] if model is None else model
    empty = bytes([ERASED]) * BANK_BYTES
    board = SimBoard(
        BoardFrames(find_scene(str(scene))), [bank_bytes(blob, 1) if blob else empty, empty]
    )
    if begun:
        board.begin_scene()
    return board


@contextmanager
def behind_a_port(board: SimBoard) -> Iterator[str]:
    """The path of a serial port with ``board`` on its other side."""
    master, slave = os.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    stop = threading.Event()

    def serve() -> None:
        while not stop.is_set():
            ready, _, _ = select.select([master], [], [], 0.002)
            if ready:
                board.receive(os.read(master, 4096))
            board.scan_one()
            output = board.take_output()
            while output and not stop.is_set():
                _, room, _ = select.select([], [master], [], 0.05)
                if room:
                    output = output[os.write(master, output[:1024]) :]

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        stop.set()
        thread.join(timeout=5.0)
        os.close(master)
        os.close(slave)
