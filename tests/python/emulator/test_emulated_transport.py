"""``emu:SCENE``: opening it, its time, its refusals."""

import json
from pathlib import Path

import numpy as np
import pytest

from eitskin.device.open import open_device
from eitskin.device.transport import Transport
from eitskin.device.wire.link_table import Stream
from eitskin.device.wire.packets import SolvedTouches
from eitskin.errors import DeviceError, FileError, ProtocolError
from eitskin_emulator import transport as transport_module
from eitskin_emulator.clocktime import TICKS_PER_S
from eitskin_emulator.transport import EmulatedTransport, open_emulated
from emulated import IMAGE
from small_models import small_blob


@pytest.fixture(scope="module")
def built(cortex_m7) -> Path:
    return cortex_m7 / IMAGE


def test_a_device_by_its_url(built):
    with open_device("emu:two_touch", image=built) as device:
        assert device.transport.url == "emu:two_touch"
        assert isinstance(device.transport, Transport)
        device.tare(4)
        device.start_scene()
        items = list(device.stream(Stream.TOUCHES, frames=3))
        last = [item for item in items if isinstance(item, SolvedTouches)][-1]
        assert len(last.touches) == 2
        assert not device.transport.ended
        shown = device.transport.board.skin
    with open_device("emu:two_touch.toml", image=built) as device:
        assert device.transport.url == "emu:two_touch.toml"
        same = device.transport.board.skin
        assert np.array_equal(same.untouched_v, shown.untouched_v)
        assert np.array_equal(same.frames_v[-1], shown.frames_v[-1])


def test_time_is_the_board_s(built):
    transport = open_emulated("two_touch", image=built)
    board = transport.board
    assert transport.capabilities.own_clock
    while transport.read(0.001):
        pass
    began = board.now_s
    assert transport.read(0.04) == b""
    assert board.now_s - began == pytest.approx(0.04, abs=1e-6)
    transport.begin_scene()
    assert board.skin.frame_number(board.clock.now + TICKS_PER_S) == 20


def test_a_closed_one_is_refused(built):
    transport = open_emulated("two_touch", image=built)
    assert transport.reopen()
    transport.close()
    transport.close()
    assert not transport.reopen()
    for use in (lambda: transport.read(0.1), lambda: transport.write(b"x")):
        with pytest.raises(DeviceError, match="has been closed"):
            use()


def test_an_image_that_hangs_does_not_hang_its_user(built, monkeypatch):
    transport = open_emulated("two_touch", image=built)
    while transport.read(0.001):
        pass
    monkeypatch.setattr(transport_module, "MAX_WALL_S", -1.0)
    with pytest.raises(DeviceError, match="said nothing"):
        transport.read(1.0)


def test_refusals(built, tmp_path):
    with pytest.raises(FileError, match="no such scene"):
        open_emulated("two_tuch", image=built)
    with pytest.raises(FileError, match="no such firmware image"):
        open_emulated("two_touch", image=tmp_path / "none.bin")
    elf = built.with_suffix(".elf")
    with pytest.raises(DeviceError, match=r"this is an \.elf; give the \.bin"):
        open_emulated("two_touch", image=elf)
    with pytest.raises(ProtocolError, match="has 16 electrodes, but the board's model is for 8"):
        open_emulated("two_touch", image=built, model=small_blob(electrodes=8, rank=12))


def test_the_image_that_ships_runs():
    transport: EmulatedTransport = open_emulated("two_touch")
    assert transport.read(0.5)
    report = transport.board.report()
    assert report.clean
    found = report.resets, report.mclk_hz, report.interrupts[15] > 5
    assert found == (("power",), 8_000_000, True)
    assert json.dumps(report.as_dict())
