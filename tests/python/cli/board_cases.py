"""Boards for tests of the command line: a small scene, and a simulated board before it."""

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
elements = {elements}

[[touch]]
radius_mm = 9.0
contrast = 9.0
x_mm = -40.0
y_mm = 10.0

[effects.noise]
snr_db = 60.0
"""


def write_scene(path: Path, frames: int = 6, elements: int = 4000) -> Path:
    """Write a scene of ``frames`` frames with one touch at (-40, 10). On a mesh of 900 elements the
    touch no longer looks like a disc, and the solver takes longer."""
    path.write_text(SCENE.format(frames=frames, elements=elements), encoding="utf-8")
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
