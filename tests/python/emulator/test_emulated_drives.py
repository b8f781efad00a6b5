"""Touches after each drive on the emulated board: reported while whole frames are solved, at the
frame rate, and the bits of this host. The press lands once the tracker has begun: a frame in whose
scan it lands before that is solved as it is, which takes several scans' time."""

import numpy as np

from eitskin.device.wire.link_table import Stream
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import DriveReport, Frame
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene
from eitskin_emulator.peripherals.nvic import PENDSV

DRIVE_US, SCAN_US, FRAMES = 1300, 20_800, 9
SCENE = f"""[scene]
name = "press"
seed = 4
rate_hz = {1e6 / SCAN_US!r}
frames = {FRAMES}
quiet_frames = 4
elements = 2500
[[touch]]
radius_mm = 8.0
contrast = 5.0
path = [{{t_s = 0.045, x_mm = 10.0, y_mm = 30.0}}, {{t_s = 0.2, x_mm = 30.0, y_mm = 10.0}}]
[effects.noise]
snr_db = 60.0
"""


def test_drives_do_not_wait_for_frames(tmp_path):
    scene, run = tmp_path / "press.toml", tmp_path / "run.eits"
    scene.write_text(SCENE, encoding="utf-8")
    settings = SessionSettings(mode=Stream.RAW | Stream.TOUCHES, report="drive", tare=4, record=run)
    with Session(f"emu:{scene}", settings, observe=observe_scene) as session:
        items = [item for item in session.messages() if isinstance(item, Frame | DriveReport)]
        stats = session.device.stats()
        interrupts = session.device.transport.board.record.interrupts
    frames = [item for item in items if isinstance(item, Frame)]
    reported = [item for item in items if isinstance(item, DriveReport) and item.touches]
    solved = [frame.info for frame in frames if frame.info is not None]
    # solves take several drives' time; drives are reported within their own
    assert max(one.solve_us + one.touch_us for one in solved) > 3 * DRIVE_US
    ages_us = [one.packet.head.age_us for one in reported]
    assert np.quantile(ages_us, 0.8) < DRIVE_US and len(reported) > 16 * (FRAMES - 4)
    # no scan waited, no row was late; two frames are missing, since the touches of those before
    # them, in which the finger begins to move, take 22 and 26 ms
    apart_us = [int(us) for us in np.diff([frame.board_us for frame in frames])]
    assert set(apart_us) <= {SCAN_US, 2 * SCAN_US} and apart_us.count(2 * SCAN_US) <= 2
    assert {int(us) for us in np.diff([one.board_us for one in reported])} == {DRIVE_US}
    assert (stats.slots_repeated, stats.packets_dropped) == (0, 0)
    assert interrupts[PENDSV] >= 16 * FRAMES
    # the joint fit of touches takes most: 20416 of 24320 bytes in the worst press seen
    assert stats.stack_used < 0.875 * stats.stack_bytes
    # what comes after the missing frame depends on it and cannot be compared
    check, _ = check_recording(run, None)
    assert check.as_dict()["same_bits"] and check.drives >= 16 * 3
