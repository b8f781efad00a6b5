"""Frames on time: speed and loop after a device's URL, by a clock that is counted, not waited
for."""

import threading
from pathlib import Path

import pytest

from eitskin.device.pacing import Pacer, Slowness
from eitskin.device.timing import Timing, split_timing
from eitskin.device.wire.link_table import Stream
from eitskin.errors import UsageError
from eitskin.session.frame import Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene


class CountedClock:
    """Time that passes only where someone waits."""

    def __init__(self) -> None:
        self.s, self.waits = 0.0, 0
        self.on_wait = lambda: None

    def now_s(self) -> float:
        return self.s

    def wait(self, changed: threading.Condition, timeout_s: float | None) -> None:
        self.waits += 1
        self.s += timeout_s or 0.0
        self.on_wait()


def test_what_follows_the_question_mark():
    assert split_timing("sim:swipe") == ("sim:swipe", Timing())
    assert split_timing("emu:a.toml?speed=0.5") == ("emu:a.toml", Timing(0.5))
    assert split_timing("file:a.eits?loop=1&speed=max") == ("file:a.eits", Timing(0.0, True))
    assert split_timing("serial:/dev/x?baud=9600") == ("serial:/dev/x?baud=9600", Timing())


@pytest.mark.parametrize(
    "query",
    [
        "speed=fast",
        "speed=-1",
        "speed=nan",
        "speed=1001",
        "loop=2",
        "loop",
        "loop=1&loop=1",
        "pace=1",
        "",
    ],
)
def test_what_cannot_follow(query):
    with pytest.raises(UsageError, match=r"device 'sim:swipe\?"):
        split_timing(f"sim:swipe?{query}")


def test_frames_are_held_until_they_are_due():
    clock = CountedClock()
    pacer = Pacer(2.0, clock)
    due = []
    for time_us in (1_000_000, 1_050_000, 1_100_000):
        pacer.hold(time_us)
        due.append(clock.s)
    assert due == pytest.approx([0.0, 0.025, 0.05])
    clock.s += 10.0  # the frames came late: what is lost is not caught up
    pacer.hold(1_150_000)
    pacer.hold(1_200_000)
    assert clock.s == pytest.approx(10.05 + 0.025)
    pacer.set_speed(0.0)
    waits = clock.waits
    pacer.hold(9_000_000)
    assert clock.waits == waits


def test_pause_step_and_play():
    clock = CountedClock()
    pacer = Pacer(1.0, clock)
    pacer.pause()
    clock.on_wait = pacer.step
    pacer.hold(0)
    assert pacer.paused
    clock.on_wait = pacer.play
    pacer.hold(20_000)
    assert not pacer.paused
    pacer.pause()
    clock.on_wait = pacer.wake
    pacer.hold(40_000)
    assert pacer.paused


def test_slowness_is_said_once():
    clock, said = CountedClock(), []
    slow = Slowness(clock)
    for frame in range(40):
        clock.s = 0.3 * frame
        said += slow.lines(50_000 * frame)
    assert said == ["emulated: 6.0 times slower than real time"]


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("timing") / "two.toml"
    path.write_text(
        "[scene]\nframes = 6\nquiet_frames = 8\nelements = 1500\nrate_hz = 20.0\n"
        "[[touch]]\nradius_mm = 9.0\npath = [{t_s = 0.0, x_mm = -40.0, y_mm = 10.0},"
        " {t_s = 0.3, x_mm = 20.0, y_mm = 10.0}]\n"
    )
    return path


def frames_of(url: str, count: int, **more: object) -> list[Frame]:
    settings = SessionSettings(Stream.TOUCHES, frames=count)
    with Session(url, settings, observe=observe_scene, **more) as session:
        return [item for item in session.messages() if isinstance(item, Frame)]


def test_a_looped_scene_begins_again_and_the_truth_with_it(scene_file):
    frames = frames_of(f"sim:{scene_file}?loop=1", 20)
    assert [f.time_us for f in frames] == [50_000 * k for k in range(20)]
    first, second, third = frames[0:6], frames[6:12], frames[12:18]
    assert [f.true for f in first] == [f.true for f in second] == [f.true for f in third]
    assert len({f.true for f in first}) == 6


def test_a_looped_recording_goes_on_in_time(scene_file, tmp_path):
    settings = SessionSettings(Stream.TOUCHES, record=tmp_path / "run.eits")
    with Session(f"sim:{scene_file}", settings) as session:
        recorded = [item for item in session.messages() if isinstance(item, Frame)]
    frames = frames_of(f"file:{tmp_path}/run.eits?loop=1", 15)
    assert len(recorded) == 6
    assert len(frames) == 15
    assert [f.time_us for f in frames] == [50_000 * k for k in range(15)]
    assert [f.touches for f in frames[6:12]] == [f.touches for f in recorded]


def test_pacing_changes_nothing_but_when(scene_file):
    clock = CountedClock()
    fast = frames_of(f"sim:{scene_file}", 6)
    paced = frames_of(f"sim:{scene_file}?speed=0.5", 6, clock=clock)
    assert [f.touches for f in fast] == [f.touches for f in paced]
    assert clock.s == pytest.approx(5 * 0.05 / 0.5)
