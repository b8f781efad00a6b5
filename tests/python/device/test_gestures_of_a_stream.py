"""Gestures of library scenes: on the simulated board, on this host, replayed, in the examples."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from eitskin.core.gestures import Gestures, Zone
from eitskin.core.gestures_table import EventKind
from eitskin.device.client import Device
from eitskin.device.recordings.recording import FileTransport
from eitskin.device.wire.link_table import Stream
from eitskin.errors import UsageError
from eitskin.session.assemble import read_frames
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "python"


def frames_of(url: str, mode: Stream, record: Path | None = None, **more: object) -> list[Frame]:
    settings = SessionSettings(mode=mode, record=record, **more)
    with Session(url, settings, observe=observe_scene) as session:
        return [item for item in session.messages() if isinstance(item, Frame)]


def reported(frames: list[Frame]) -> list[str]:
    """Return the names of the events that are gestures."""
    return [event.name for frame in frames for event in frame.events if event.is_gesture]


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        ("tap", ["tap"]),
        ("double_tap", ["tap", "double-tap"]),
        ("hold", ["hold"]),
        ("spread", ["spread", "spread"]),
    ],
)
def test_a_scene_tells_its_gesture(scene, expected):
    assert reported(frames_of(f"sim:{scene}", Stream.TOUCHES)) == expected


@pytest.mark.parametrize("side", ["right", "up", "left", "down"])
def test_a_swipe_says_which_way(side):
    frames = frames_of(f"sim:swipe_{side}", Stream.TOUCHES)
    swipes = [one for frame in frames for one in frame.events if one.kind == EventKind.SWIPE]
    assert [one.side for one in swipes] == [side]
    assert reported(frames) == ["swipe"]


def test_the_boards_events_are_the_hosts_and_a_recording_keeps_them(tmp_path):
    path = tmp_path / "run.eits"
    everything = Stream.RAW | Stream.TOUCHES | Stream.EVENTS
    live = frames_of("sim:double_tap", everything, record=path)
    here = frames_of("sim:double_tap", Stream.TOUCHES)
    assert reported(live) == reported(here) == ["tap", "double-tap"]
    sent = [frame.board_events for frame in live if frame.board_events is not None]
    assert sent == [frame.events for frame in here]
    with Device(FileTransport(path)) as device:
        replayed = [item for item in read_frames(device, Stream.EVENTS) if isinstance(item, Frame)]
    assert [item.board_events for item in replayed] == sent
    check, _ = check_recording(path, None)
    assert not check.different and check.events == sum(map(len, sent)) > 4


def test_events_alone_can_be_asked_for():
    frames = frames_of("sim:tap", Stream.EVENTS)
    assert reported(frames) == ["tap"]
    message = next(frame.message() for frame in frames if reported([frame]))
    assert message["touches"] is None
    event = message["events"][-1]
    assert event["kind"] == "tap" and event["zone"] is None and event["direction_deg"] is None
    assert event["time_s"] == message["time_s"]


def test_zones_are_pressed_by_the_boards_events_too():
    pad = Zone("pad", x_mm=30, y_mm=20, outer_mm=15)
    for mode in (Stream.TOUCHES, Stream.EVENTS):
        frames = frames_of("sim:tap", mode, zones=(pad,))
        assert sorted(reported(frames)) == ["press", "release", "tap"]
        names = [one.zone_name for frame in frames for one in frame.events if one.zone]
        assert names == ["pad", "pad"]


def test_options_that_cannot_be_are_refused():
    with pytest.raises(UsageError, match="option tap_ms"):
        Gestures(tap_ms=3)
    with pytest.raises(UsageError, match="at least 0"):
        Gestures(pair_mm=-1)
    with pytest.raises(UsageError, match="at most 64"):
        Gestures([Zone("a", outer_mm=1)] * 65)
    with pytest.raises(UsageError, match="one of a, b is not valid"):
        Gestures([Zone("a", outer_mm=1), Zone("b", inner_mm=2, outer_mm=1)])


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_examples_play_their_scenes():
    beats = [pad for _, pad in example("drum_pad").beats("sim:drum_beat")]
    assert beats == ["kick", "hat", "snare", "hat", "kick", "ride", "snare"]
    volumes = list(example("volume_ring").volumes("sim:ring_turn"))
    assert volumes == sorted(volumes) and 0.55 < volumes[-1] < 0.72
    assert list(example("page_turner").pages("sim:page_turns")) == [2, 3, 2]
