"""All skins of a robot in one session: one clock, ids of their own, and boards that go and come."""

import json
import threading
import time
from itertools import pairwise
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import eitskin
from board_on_a_port import Wire
from eitskin.cli.main import main
from eitskin.device.open import open_device
from eitskin.device.simulated import open_simulated
from eitskin.errors import DeviceError, FileError, SkinTouchedError, UsageError
from eitskin.robot.description import load_robot
from eitskin.session.frame import DriveReport, Frame, Notice
from eitskin.session.message import schema
from eitskin.session.robot_session import ROOM, RobotSession, open_session
from eitskin.session.robot_skin import HostClock
from eitskin.session.settings import SessionSettings

VALID = jsonschema.Draft202012Validator(schema())
ARM = """
[[skin]]
name = "forearm"
device = "sim:swipe"
link = "forearm_link"
xyz_m = [0, 0, 0.05]
rpy_rad = [0, 1.5707963267948966, 0]

[[skin]]
name = "palm"
device = "sim:two_touch"

[[skin]]
name = "back"
device = "sim:two_touch"
"""


@pytest.fixture
def arm(tmp_path) -> Path:
    path = tmp_path / "arm.toml"
    path.write_text(ARM)
    return path


def test_messages_of_all_skins_come_in_the_order_of_one_clock(arm):
    settings = SessionSettings(frames=8, report="drive")
    with open_session(f"robot:{arm}", settings) as session:
        messages = list(session.messages())
        summary = session.finish()
    frames = [one for one in messages if isinstance(one, Frame)]
    reports = [one for one in messages if isinstance(one, DriveReport)]
    assert {one.source for one in reports} == {one.source for one in frames}
    assert summary.frames == len(frames) == 24 and len(summary.lines()) == 6
    times = [one.time_us for one in frames]
    assert times == sorted(times) and times[0] == times[1] == times[2]
    ids = {
        name: {t.id for f in messages if not isinstance(f, Notice) and f.source == name
               for t in f.touches}
        for name in ("forearm", "palm", "back")
    }  # fmt: skip
    assert ids == {"forearm": {1}, "palm": {2, 5}, "back": {3, 6}}
    events = {one.first_id for f in frames if f.source == "back" for one in f.events}
    assert events <= {3, 6} and events
    for message in (*frames, *reports[::50]):
        VALID.validate(message.message())


def test_the_same_robot_gives_the_same_messages(arm):
    def run() -> list[str]:
        return [
            json.dumps({k: v for k, v in one.message().items() if k != "time_unix_s"})
            for one in eitskin.stream(str(arm), frames=4)
        ]

    assert run() == run()


def test_touches_are_placed_in_the_frame_of_their_link(arm):
    frames = [f for f in eitskin.stream(f"robot:{arm}", frames=6) if f.source == "forearm"]
    frame = next(one for one in frames if one.touches)
    (touch,), message = frame.touches, frame.message()
    assert frame.placed is not None
    assert frame.placed[0].position_m == pytest.approx(
        [0, touch.y_mm / 1e3, 0.05 - touch.x_mm / 1e3], abs=1e-9
    )
    (table,) = message["touches"]
    assert message["link"] == "forearm_link" and message["source"] == "forearm"
    assert table["position_m"] == frame.placed[0].position_m.tolist()
    assert table["normal"] == pytest.approx([1, 0, 0], abs=1e-9)
    assert np.trace(table["covariance_m2"]) == pytest.approx(
        1e-6 * (touch.x_variance_mm2 + touch.y_variance_mm2)
    )


def test_a_robot_is_recorded_in_a_folder_and_replayed(arm, tmp_path, capsys):
    folder = tmp_path / "run"
    record = ["record", "--device", str(arm), "--frames", "4", "-o", str(folder), "--json"]
    assert main(record) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == 12 and facts["source"] is None
    assert {one.name for one in folder.iterdir()} == {
        "robot.toml", "forearm.eits", "palm.eits", "back.eits"
    }  # fmt: skip
    assert main(record) == 3 and "holds files already" in capsys.readouterr().err
    live = [f.message() for f in eitskin.stream(str(arm), frames=4)]
    assert main(["replay", str(folder), "--json"]) == 0
    *replayed, last = map(json.loads, capsys.readouterr().out.splitlines())
    assert set(last["summary"]["skins"]) == {"forearm", "palm", "back"}
    assert [(m["source"], m["time_s"]) for m in replayed] == [
        (m["source"], m["time_s"]) for m in live
    ]

    def shown(messages: list[dict]) -> list[list[float]]:
        return [[t["id"], t["x_mm"], *t["position_m"]] for m in messages for t in m["touches"]]

    assert np.allclose(shown(replayed), shown(live), rtol=0, atol=1e-9)
    assert main(["replay", str(folder), "--check"]) == 2
    assert main(["replay", str(folder / "palm.eits"), "--check"]) == 0


def test_a_robot_keeps_its_speed(arm):
    with open_session(f"{arm}?speed=0.5", SessionSettings(frames=6)) as session:
        session.start()
        began = time.monotonic()  # on a busy machine, some time after the scene's beginning
        assert sum(isinstance(one, Frame) for one in session.messages()) == 18
    assert time.monotonic() - began > 0.35  # of 0.5 s


def test_a_loop_goes_on_until_it_is_stopped(arm):
    with open_session(f"{arm}?loop=1", SessionSettings()) as session:
        count = 0
        for message in session.messages():
            count += isinstance(message, Frame)
            if count == 200:
                session.stop()
    assert count == 200
    assert [one.name for one in threading.enumerate() if one.name.startswith("eitskin ")] == []


def test_the_reference_of_every_skin_is_taken(arm):
    with open_session(f"{arm}?loop=1", SessionSettings()) as session:
        messages = session.messages()
        next(messages)
        answer = session.tare(anyway=True)
        for message in messages:
            if answer.done() or (isinstance(message, Frame) and message.time_s > 20):
                break
        messages.close()
    with pytest.raises(SkinTouchedError, match=r"skin 'forearm': .*moved"):
        answer.result(0)


def test_what_robots_refuse(arm, capsys, tmp_path):
    with pytest.raises(UsageError, match="names its skins"):
        open_session(str(arm), SessionSettings(name="left"))
    for url in (f"robot:{arm}", str(arm)):
        with pytest.raises(UsageError, match="a robot has several boards"):
            open_device(url)
    assert main(["view", "--device", str(arm), "--teach", "plan.csv"]) == 2
    assert "--teach teaches one skin" in capsys.readouterr().err
    assert main(["stream", "--device", str(arm), "--picture", str(tmp_path / "a.png")]) == 2
    assert "draw one skin" in capsys.readouterr().err
    text = arm.read_text().replace("sim:swipe", "serial:/dev/ttyNONE")
    arm.write_text(text)
    with pytest.raises(DeviceError, match=r"skin 'forearm': .*ttyNONE"):
        RobotSession(load_robot(arm)).__enter__()
    arm.write_text(text.replace("serial:/dev/ttyNONE", "file:none.eits"))
    with pytest.raises(FileError, match=r"skin 'forearm': .*no such recording"):
        list(eitskin.stream(str(arm)))


def test_a_boards_clock_is_followed():
    """Delays of 1 to 9 ms; the board's clock is 50 ppm slow."""
    clock, random = HostClock(), np.random.default_rng(3)
    off = []
    for k in range(30_000):
        host_us = 20_000.0 * k
        made_us = round(host_us * (1 - 50e-6)) + 7_000_000
        offset = clock.offset_us(made_us, host_us + random.uniform(1000, 9000))
        off.append(made_us + offset - host_us)
    assert (
        max(map(abs, off[500:])) < 3000 and max(abs(b - a) for a, b in pairwise(off[500:])) < 1000
    )


def test_a_board_that_goes_comes_back_while_others_go_on(tmp_path):
    """The board behind a terminal is pulled out, and another one with its serial number appears
    there, without a reference, as after a loss of power."""
    wire = Wire(open_simulated("two_touch").board, frame_s=0.005)
    link = tmp_path / "port"
    link.symlink_to(wire.path)
    path = tmp_path / "arm.toml"
    path.write_text(
        f'[[skin]]\nname = "real"\ndevice = "serial:{link}"\n'
        '[[skin]]\nname = "sim"\ndevice = "sim:swipe?loop=1"\n'
    )
    came: list[tuple[str, str]] = []
    second: list[Wire] = []
    settings = SessionSettings(tare=4, record=tmp_path / "run")
    with open_session(f"{path}?speed=1", settings) as session:
        end_s = time.monotonic() + 30
        for message in session.messages():
            kind = message.text if isinstance(message, Notice) else "frame"
            came.append((message.source or "", kind))
            real = [what for name, what in came if name == "real"]
            if len(real) == 10 and not second:
                wire.unplug()
                link.unlink()
                second.append(Wire(open_simulated("two_touch").board, frame_s=0.005))
                link.symlink_to(second[0].path)
            back = [k for k, one in enumerate(real) if one.startswith("link: back")]
            if (back and real[back[0] :].count("frame") > 5) or time.monotonic() > end_s:
                session.stop()
    for one in second:
        one.unplug()
    real = [what for name, what in came if name == "real"]
    lost = next(k for k, one in enumerate(came) if one[1].startswith("link: lost"))
    back = next(k for k, one in enumerate(came) if one[1].startswith("link: back"))
    assert any(what.startswith("link: unplugged") for what in real)
    assert ("sim", "frame") in came[lost:back]
    assert came[back][1].endswith("; its recording goes on in real-2.eits")
    for name in ("real", "real-2", "sim"):
        assert main(["replay", str(tmp_path / "run" / f"{name}.eits")]) == 0
    real_skin, sim = load_robot(tmp_path / "run" / "robot.toml").skins
    # by the robot's clock: some seconds at most, on a busy machine, too
    assert 0 <= real_skin.starts_s < 30 and sim.starts_s == 0


def several(folder: Path, scene: str, count: int) -> Path:
    path = folder / "several.toml"
    skins = (f'[[skin]]\nname = "skin{k}"\ndevice = "sim:{scene}"\n' for k in range(count))
    path.write_text("".join(skins))
    return path


def test_skins_wait_for_a_slow_reader(tmp_path):
    """At most ROOM messages of each skin wait, and none is lost."""
    with open_session(f"{several(tmp_path, 'two_touch', 5)}?loop=1", SessionSettings()) as session:
        assert isinstance(session, RobotSession)
        numbers: dict[str | None, list[int]] = {}
        messages = session.messages()
        for _, message in zip(range(5 * 8), messages, strict=False):
            time.sleep(0.002)
            assert max(map(len, session._queue.lanes)) <= ROOM
            if isinstance(message, Frame):
                numbers.setdefault(message.source, []).append(message.number)
        messages.close()
    assert len(numbers) == 5
    assert {tuple(np.diff(one)) for one in numbers.values()} == {(1,) * 7}


@pytest.mark.long("test_skins_wait_for_a_slow_reader")
@pytest.mark.parametrize(("report", "some"), [("frame", 10_000), ("drive", 1_000)])
def test_sixteen_skins_need_two_cores_and_constant_memory(tmp_path, report, some):
    """At 48 frames per second of each; the memory after three times ``some`` frames is that after
    ``some``, within 3 MB."""

    def resident_mb() -> float:
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(one for one in lines if one.startswith("VmRSS")).split()[1]) / 1e3

    settings = SessionSettings(report=report)
    with open_session(f"{several(tmp_path, 'swipe', 16)}?loop=1", settings) as session:
        session.start()
        count, seen, began_s = 0, [], time.process_time()
        for message in session.messages():
            count += isinstance(message, Frame)
            if isinstance(message, Frame) and count % some == 0:
                seen.append(resident_mb())
            if count == 3 * some:
                session.stop()
    assert seen[2] < seen[0] + 3, seen
    cores = 16 * 48 * (time.process_time() - began_s) / count
    print(f"16 skins at 48 frames per second, report {report}: {cores:.2f} cores")
    assert cores < 2
