"""Touches after each drive of a simulated board: their places and times, a recording that
reproduces them bit for bit, and refused requests."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from eitskin.device.settings import ScanSettings
from eitskin.device.wire.codec import Decoder, encode
from eitskin.device.wire.link_table import DriveTouch, DriveTouchesHead, PacketType, Stream
from eitskin.device.wire.payloads import MalformedPacket, pack, parse
from eitskin.errors import DeviceError
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import DriveReport, Frame
from eitskin.session.message import schema
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene

DRIVE_S, SCAN_S = 1.3e-3, 20.8e-3
CONTACT_S, MOVES_S, STOPS_S = 0.0527, 0.1, 0.2
SPEED_MM_PER_S = 400.0
SCENE = f"""[scene]
name = "swipe"
seed = 4
rate_hz = {1 / SCAN_S!r}
frames = 12
quiet_frames = 16
elements = 3500
[[touch]]
radius_mm = 8.0
contrast = 5.0
path = [{{t_s = {CONTACT_S}, x_mm = -20.0, y_mm = 10.0}},
        {{t_s = {MOVES_S}, x_mm = -20.0, y_mm = 10.0}},
        {{t_s = {STOPS_S}, x_mm = 20.0, y_mm = 10.0}}]
[effects.noise]
snr_db = 60.0
[effects.contact_impedance]
spread = 0.2
"""
SETTINGS = SessionSettings(mode=Stream.RAW | Stream.TOUCHES, report="drive", tare=16)
PALM = replace(SETTINGS, mode=Stream.TOUCHES, tare=64)


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    path: Path = tmp_path_factory.mktemp("drives") / "swipe.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def followed(url: str, settings: SessionSettings) -> list[Any]:
    with Session(url, settings, observe=observe_scene) as session:
        return [item for item in session.messages() if isinstance(item, Frame | DriveReport)]


@pytest.fixture(scope="module")
def recorded(scene) -> tuple[Path, list[Any]]:
    path = scene.with_name("swipe.eits")
    return path, followed(f"sim:{scene}", replace(SETTINGS, record=path))


def test_they_are_told_soon_where_they_are_and_how_fast(recorded):
    reports = [item for item in recorded[1] if isinstance(item, DriveReport)]
    begun = reports[0].time_s - DRIVE_S / 2  # the scene's time 0
    reported = [(one.time_s - begun, one.touches) for one in reports if one.touches]
    assert reports[0].touches == () and 0 < reported[0][0] - CONTACT_S < 10 * DRIVE_S
    assert {len(touches) for _, touches in reported} == {1}
    assert {touch.id for _, touches in reported for touch in touches} == {reported[0][1][0].id}
    x_mm = [-20 + SPEED_MM_PER_S * min(max(s - MOVES_S, 0), 0.1) for s, _ in reported]
    off_mm = [
        np.hypot(t.x_mm - x, t.y_mm - 10) for x, (_, (t,)) in zip(x_mm, reported, strict=True)
    ]
    assert off_mm[0] < 6 and np.median(off_mm) < 2 and max(off_mm) < 8
    speeds = [t.vx_mm_per_s for s, (t,) in reported if MOVES_S + 0.03 < s < STOPS_S]
    assert np.median(speeds) == pytest.approx(SPEED_MM_PER_S, rel=0.15)
    assert reported[-1][1][0].confirmed and not reported[0][1][0].confirmed
    frames = [item for item in recorded[1] if isinstance(item, Frame)]
    assert not any(frame.diagnostics for frame in frames if frame.touches)  # its lift may name one
    assert any(len(frame.touches) == 1 for frame in frames)


@pytest.mark.parametrize(
    ("x_mm", "y_mm", "from_s"),
    [(37.48, -10.13, 0.0125), (-27.9, 14.6, 0.002), (-17.1, 29.5, 0.002)],
)
def test_a_palm_that_lands_slowly_is_one_touch_in_its_place(tmp_path, x_mm, y_mm, from_s):
    place = f"x_mm = {x_mm}, y_mm = {y_mm}"
    path = tmp_path / "palm.toml"
    path.write_text(
        f"""[scene]
name = "palm"
seed = 1
rate_hz = 48.0
frames = 9
quiet_frames = 64
elements = 3500
[[touch]]
radius_mm = 22.0
contrast = 2.0
path = [{{t_s = {from_s}, {place}, press = 0.0}}, {{t_s = {from_s + 0.12}, {place}, press = 1.0}}]
[effects.noise]
snr_db = 60.0
""",
        encoding="utf-8",
    )
    told = followed(f"sim:{path}", PALM)
    touches = [one for item in told for one in item.touches]
    assert len(touches) > 60
    assert max(np.hypot(one.x_mm - x_mm, one.y_mm - y_mm) for one in touches) < 12
    frames = [item.touches for item in told if isinstance(item, Frame) and item.touches]
    assert max(len(touches) for touches in frames) == 1
    assert max(np.hypot(one.x_mm - x_mm, one.y_mm - y_mm) for (one,) in frames) < 8


@pytest.mark.parametrize(
    ("a", "b", "radius_mm", "contrasts", "seed"),
    [
        ((20.482, -41.147), (4.804, -20.462), 6.749, (6.655, 9.108), 7025),
        ((-24.323, -4.56), (-1.956, -13.977), 6.945, (5.959, 6.15), 7050),
    ],
)
def test_two_fingers_that_land_at_once_are_not_one_between_them(
    tmp_path, a, b, radius_mm, contrasts, seed
):
    path = tmp_path / "pair.toml"
    touches = [
        f"""[[touch]]
radius_mm = {radius_mm}
contrast = {contrast}
path = [{{t_s = 0.2, x_mm = {x}, y_mm = {y}, press = 0.0}},
        {{t_s = 0.23, x_mm = {x}, y_mm = {y}, press = 1.0}},
        {{t_s = 0.83, x_mm = {x}, y_mm = {y}, press = 1.0}}]
"""
        for (x, y), contrast in zip((a, b), contrasts, strict=True)
    ]
    path.write_text(
        f"""[scene]
name = "pair"
seed = {seed}
rate_hz = 48.0
frames = 36
quiet_frames = 64
elements = 5000
{"".join(touches)}[effects.noise]
snr_db = 60.0
""",
        encoding="utf-8",
    )
    told = followed(f"sim:{path}", PALM)
    ends = np.array([a, b])

    def between(item: Any) -> bool:
        return any(np.hypot(*(ends - (t.x_mm, t.y_mm)).T).min() > 12 for t in item.touches)

    frames = [item for item in told if isinstance(item, Frame)]
    assert not any(map(between, frames))
    assert sum(map(between, told)) <= 8
    assert all(len(frame.touches) == 2 for frame in frames[-12:])


def test_their_messages_keep_to_the_schema(recorded):
    validator = Draft202012Validator(schema())
    for item in recorded[1]:
        validator.validate(item.message())
    report = next(item for item in recorded[1] if isinstance(item, DriveReport) and item.touches)
    broken = report.message() | {"touches": [{"id": 1}]}
    assert not validator.is_valid(broken)


def test_a_recording_gives_them_again_to_the_bit(recorded):
    path, items = recorded
    again = followed(f"file:{path}", replace(SETTINGS, tare=None))

    def numbers(found: list[Any]) -> list[Any]:
        return [(one.touches, one.board_us) for one in found
                if isinstance(one, DriveReport)]  # fmt: skip

    assert numbers(again) == numbers(items)
    frames = sum(isinstance(item, Frame) for item in items)
    check, _ = check_recording(path, None)
    assert check.as_dict()["same_bits"] and check.drives == 16 * frames
    without = followed(f"file:{path}", replace(SETTINGS, tare=None, report="frame"))
    assert not any(isinstance(item, DriveReport) for item in without) and len(without) == frames


def test_another_bit_is_noticed(recorded, tmp_path):
    packets = Decoder().feed(recorded[0].read_bytes())
    (first, *_) = [one for one in packets if one.type == PacketType.DRIVE_TOUCHES and
                   len(one.payload) > DriveTouchesHead.LAYOUT.size]  # fmt: skip
    changed = bytearray(first.payload)
    changed[DriveTouchesHead.LAYOUT.size + 4] ^= 1  # of x
    path = tmp_path / "changed.eits"
    path.write_bytes(b"".join(
        encode(one.type, one.sequence, bytes(changed) if one is first else one.payload)
        for one in packets
    ))  # fmt: skip
    check, _ = check_recording(path, None)
    assert check.drives_different == 1 and not check.as_dict()["same_bits"]
    assert "after 1 drives" in check.text()


@pytest.mark.parametrize("scan", [ScanSettings(check_every=0), ScanSettings(check_every=4)])
def test_half_scans_are_refused(scene, scan):
    with pytest.raises(DeviceError, match=r"leave {2}--report drive {2}out"):
        followed(f"sim:{scene}", replace(SETTINGS, scan=scan))


HEAD = DriveTouchesHead(3, 100, 2, 50, 40, 5, 1)
TOUCH = DriveTouch(1, True, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
GOOD = pack(HEAD) + pack(TOUCH)


@pytest.mark.parametrize(
    "payload",
    [
        GOOD[:-1],
        GOOD + b"\0",
        pack(HEAD),
        pack(replace(HEAD, count=2)) + pack(TOUCH),
        pack(HEAD) + pack(replace(TOUCH, vx_mm_per_s=float("nan"))),
        pack(HEAD) + pack(replace(TOUCH, x_mm=float("inf"))),
    ],
)
def test_a_malformed_packet_of_a_drive_is_refused(payload):
    with pytest.raises(MalformedPacket, match="DRIVE_TOUCHES"):
        parse(PacketType.DRIVE_TOUCHES, payload)
