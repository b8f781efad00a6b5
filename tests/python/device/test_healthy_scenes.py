"""The scenes of the library in which nothing is wrong raise no diagnostic while fingers land, move
and lift."""

import pytest

from eitskin.device.open import open_device
from eitskin.device.wire.link_table import Stream
from eitskin.scene.library_scenes import find_scene, library
from eitskin.session.assemble import read_frames
from eitskin.session.frame import Frame

QUICK = ("double_tap", "drum_beat", "hold", "tap", "two_touch")
# one frame, while five fingers land at once
KNOWN = {"grip": {"crowded"}}


def healthy() -> list[str]:
    """Scenes with noise alone, and touches that have paths."""
    return [
        name
        for name in library()
        if set(find_scene(name).effects) <= {"noise"} and find_scene(name).touches
    ]


def diagnosed(name: str) -> set[str]:
    with open_device(f"sim:{name}?speed=max") as device:
        device.tare()
        device.start_scene()
        messages = list(read_frames(device, Stream.TOUCHES | Stream.DRIVE_TOUCHES))
    frames = [one for one in messages if isinstance(one, Frame)]
    assert len(frames) > 0.8 * find_scene(name).frames
    return {what for frame in frames for what in frame.diagnostics}


@pytest.mark.parametrize("name", QUICK)
def test_fingers_raise_no_diagnostic(name):
    assert name in healthy()
    assert diagnosed(name) == set()


@pytest.mark.long("the quick ones of the library")
def test_no_healthy_scene_raises_a_diagnostic():
    found = {name: diagnosed(name) for name in healthy()}
    assert len(found) >= 25
    assert {name: what for name, what in found.items() if what} == KNOWN
