"""Sessions: one generator for all, bounded for ever, described by one message."""

import json

import jsonschema
import numpy as np
import pytest

from eitskin.cli.main import main
from eitskin.device.wire.link_table import Stream
from eitskin.errors import DeviceError, UsageError
from eitskin.frames.frames import save_frames
from eitskin.session.frame import Frame, Notice
from eitskin.session.message import schema
from eitskin.session.replay import recording_length_s
from eitskin.session.sample import SIZE, Sample
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.session.summary import Summary
from eitskin.truth import observe_scene
from small_models import session as small_session

VALID = jsonschema.Draft202012Validator(schema())


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(schema())
    for wrong in ({}, {"version": 2, "type": "frame"}, {"version": 1, "type": "frame"}):
        assert not VALID.is_valid(wrong)


@pytest.mark.parametrize("mode", ["touches", "raw,image,touches", "image", "raw"])
def test_what_stream_prints_is_valid(mode, capsys):
    command = ["stream", "--device", "sim:two_touch", "--frames", "3", "--json", "--mode", mode]
    assert main(command) == 0
    *frames, last = map(json.loads, capsys.readouterr().out.splitlines())
    for message in (*frames, last):
        VALID.validate(message)
    assert len(frames) == 3 and last["summary"]["frames"] == 3
    assert {frame["touches"] is None for frame in frames} == {"touches" not in mode}
    assert all(frame["time_unix_s"] > 1.7e9 for frame in frames)


def test_what_reconstruct_prints_is_valid(tmp_path, capsys):
    path = tmp_path / "frames.npz"
    frames = small_session().as_frames()
    save_frames(path, frames)
    assert main(["reconstruct", str(path), "--json"]) == 0
    message = json.loads(capsys.readouterr().out)
    VALID.validate(message)
    assert message["type"] == "reconstruction" and len(message["frames"]) == frames.n_frames
    assert {t["force_n"] for frame in message["frames"] for t in frame["touches"]} == {None}
    VALID.validate(Notice("link", "link: gap (2 packets)", 0.5, 1.8e9).message())


def test_a_sample_stays_bounded_and_fair():
    sample = Sample()
    for value in range(SIZE):
        sample.add(value)
    assert sample.quantile(0.5) == np.quantile(np.arange(SIZE), 0.5)  # exact up to there
    for value in range(SIZE, 20 * SIZE):
        sample.add(value)
    assert (len(sample.values), sample.count, sample.largest) == (SIZE, 20 * SIZE, 20 * SIZE - 1)
    for fraction in (0.1, 0.5, 0.99):
        assert sample.quantile(fraction) == pytest.approx(
            fraction * 20 * SIZE, abs=0.03 * 20 * SIZE
        )
    assert np.isnan(Sample().quantile(0.5))


def test_a_summary_of_a_day_is_as_large_as_one_of_a_minute():
    settings = SessionSettings(mode=Stream.TOUCHES, frames=1)
    with Session("sim:swipe", settings) as session:
        (frame,) = [item for item in session.messages() if isinstance(item, Frame)]
    summary = Summary()
    for _ in range(3 * SIZE):
        summary.add(frame)
    assert summary.frames == 3 * SIZE and len(summary.solve_us.values) == SIZE


def test_a_board_is_asked_between_frames():
    """The stream goes on, and its clock with it."""
    settings = SessionSettings(mode=Stream.TOUCHES)
    with Session("sim:swipe", settings) as session:
        asked, times, numbers = None, [], []
        for item in session.messages():
            if not isinstance(item, Frame):  # of touches that move during a scan
                continue
            times.append(item.time_s)
            numbers.append(item.number)
            if len(times) == 5:
                asked = session.ask(lambda device: device.stats())
                refused = session.ask(lambda device: device.tare(2))
            if len(times) == 20:
                session.stop()
        assert asked is not None and asked.result().as_dict()["stages"]
        with pytest.raises(Exception, match="1, or 4 to 1024"):
            refused.result()
    assert len(times) == 20 and np.all(np.diff(times) > 0) and np.all(np.diff(numbers) > 0)


def test_a_recording_is_asked_too_and_says_no(tmp_path):
    run = tmp_path / "run.eits"
    settings = SessionSettings(mode=Stream.TOUCHES, record=run, frames=6)
    with Session("sim:swipe", settings) as session:
        assert sum(isinstance(item, Frame) for item in session.messages()) == 6
    with Session(f"file:{run}") as session:
        answers, count = [], 0
        for _ in session.messages():
            count += 1
            answers.append(session.tare())
        with pytest.raises(DeviceError, match="is a recording"):
            answers[0].result()
    assert count == 6


def test_a_recording_goes_on_where_it_is_asked_to(tmp_path):
    """Forwards, back, and to one frame while it is paused; each frame is what it was."""
    path = tmp_path / "run.eits"
    settings = SessionSettings(mode=Stream.TOUCHES, record=path, frames=20)
    with Session("sim:swipe", settings) as session:
        recorded = [one.touches for one in session.messages() if isinstance(one, Frame)]
    with Session(f"file:{path}") as session:
        assert recording_length_s(session.device) == pytest.approx(0.95, abs=0.01)
    numbers: list[int] = []
    with Session(f"file:{path}") as session:
        asked = {2: 0.6, 4: 0.2, 6: 0.95}  # after so many frames
        for message in session.messages():
            assert isinstance(message, Frame)
            numbers.append(round(20 * message.time_s))
            assert message.touches == recorded[numbers[-1]]
            if (time_s := asked.get(len(numbers))) is not None:
                if len(numbers) == 6:
                    session.pacer.pause()
                session.ask(lambda device, at=time_s: session.seek(at))
    assert numbers == [0, 1, 12, 13, 4, 5, 19]


@pytest.mark.parametrize("loop", ["", "?loop=1"])
def test_the_truth_of_a_recording_is_that_of_its_time(tmp_path, loop):
    """Wherever it begins to be shown, and if its time goes back after a round of the scene."""
    path = tmp_path / "run.eits"
    settings = SessionSettings(mode=Stream.TOUCHES, record=path, frames=50)
    true = []
    with Session(f"sim:swipe{loop}", settings, observe=observe_scene) as session:
        true = [one.true for one in session.messages() if isinstance(one, Frame)]
    assert len({touch.x_mm for touches in true for touch in touches or ()}) > 10
    last_s = 0.05 * (len(true) - 1)
    numbers: list[int] = []
    with Session(f"file:{path}", observe=observe_scene) as session:
        session.ask(lambda device: session.seek(0.6))
        for message in session.messages():
            assert isinstance(message, Frame)
            if not numbers and message.time_s < 0.5:
                continue  # read before the wish was
            numbers.append(round(20 * message.time_s))
            assert message.true == true[numbers[-1]], numbers
            if (time_s := {2: last_s, 3: 0.3, 5: last_s}.get(len(numbers))) is not None:
                session.ask(lambda device, at=time_s: session.seek(at))
    assert numbers == [12, 13, len(true) - 1, 6, 7, len(true) - 1]


def test_only_a_recording_goes_on_elsewhere():
    with Session("sim:swipe") as session, pytest.raises(UsageError, match="is not a recording"):
        session.seek(1.0)
