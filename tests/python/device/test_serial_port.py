"""Serial ports on pseudo-terminals: a board behind one, ports that are not there, busy, forbidden,
slow to be read, unplugged."""

import errno
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import count, islice
from pathlib import Path

import pytest
import serial
from device_helpers import empty_bank, of, raw_frames, scene, sim_board, st_link

from board_on_a_port import Wire
from eitskin.device import ports as ports_module
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.link import Reconnect
from eitskin.device.open import list_devices, open_device
from eitskin.device.ports import Port, SerialTransport
from eitskin.device.simulated import SimBoard
from eitskin.device.transport import LinkEvent
from eitskin.device.wire.link_table import GetInfo, Stream, Tare
from eitskin.device.wire.packets import BoardInfo, RawFrame
from eitskin.errors import DeviceError
from eitskin.scene.board_frames import BoardFrames
from small_models import prebuilt

SOON = Reconnect(tries=40, every_s=0.05)


class Bench(ExitStack):
    """Wires to boards, and the paths of those that the host finds when it looks."""

    def __init__(self) -> None:
        super().__init__()
        self.there: list[str] = []
        self.looks = 0
        self.on_look: Callable[[], object] = lambda: None

    def plug(self, board: SimBoard, frame_s: float = 0.0) -> Wire:
        wire = Wire(board, frame_s=frame_s)
        self.callback(wire.unplug)
        self.there[:] = [wire.path]
        return wire

    def ports(self) -> list[Port]:
        self.looks += 1
        self.on_look()
        return [st_link(path) for path in self.there]


@pytest.fixture
def bench(monkeypatch) -> Iterator[Bench]:
    with Bench() as made:
        monkeypatch.setattr(ports_module, "ports", made.ports)
        yield made


@pytest.fixture
def wire(bench) -> Wire:
    return bench.plug(sim_board())


def quick(url: str, **more: object) -> Device:
    return open_device(url, reconnect=SOON, **more)


def test_a_board_on_a_port(wire):
    with quick(f"serial:{wire.path}") as device:
        assert device.board.board == "simulated"
        device.tare(8)
        frames = [raw.frame for raw in raw_frames(device, 20)]
        assert frames == list(range(frames[0], frames[0] + 20))
        assert device.counters.gaps == device.counters.crc_errors == 0
        assert not device.transport.capabilities.own_clock


def test_a_slow_reader_loses_the_oldest_whole_frames_and_knows_how_many(wire):
    with quick(f"serial:{wire.path}", room=16) as device:
        stream = device.stream(Stream.RAW)
        items = [next(stream)]
        end = time.monotonic() + 20
        while device.counters.dropped < 50 and time.monotonic() < end:
            time.sleep(0.01)
        items += islice(stream, 200)
        stats = device.stats()  # an answer is not lost among the frames
        counters = device.counters
        stream.close()
    assert stats.frames_scanned > 200
    reported = sum(event.missing for event in of(LinkEvent, items) if event.kind == "dropped")
    frames = [item.frame for item in of(RawFrame, items)]
    assert frames == sorted(set(frames))
    assert reported >= 50
    assert frames[-1] - frames[0] + 1 - len(frames) == reported  # exactly those that are missing
    # the port itself never waited
    assert counters.gaps == counters.crc_errors == counters.framing_errors == 0


def test_unplugged_and_plugged_in_again_elsewhere(bench):
    board = sim_board()
    first = second = bench.plug(board, frame_s=0.005)
    with quick(f"serial:{first.path}") as device:
        events, frames = [], []
        for item in device.stream(Stream.RAW, frames=60):
            if isinstance(item, LinkEvent):
                events.append(item.kind)
            elif isinstance(item, RawFrame):
                frames.append(item.frame)
            if len(frames) == 10 and second is first:
                bench.there.clear()
                first.unplug()
                second = bench.plug(board, frame_s=0.005)
        assert device.transport.name == second.path
        assert events[:2] == ["unplugged", "reconnected"]
        assert device.counters.reconnects == 1
        assert frames == sorted(set(frames)) and len(frames) >= 55


def test_a_command_waits_for_a_board_that_is_away_longer_than_an_answer_may_take(bench):
    """Answers may take 3 x 0.2 s here; the board is away for 25 looks, 0.04 s apart."""
    board = sim_board()
    first = bench.plug(board)
    url, wait = f"serial:{first.path}", Reconnect(tries=1000, every_s=0.04)
    with open_device(url, reconnect=wait) as device:
        bench.there.clear()
        bench.looks = 0
        bench.on_look = lambda: bench.plug(board) if bench.looks == 25 else None
        first.unplug()
        answer = device.ask(GetInfo(), 0.2)
        assert isinstance(answer, BoardInfo) and answer.serial == device.board.serial
        assert device.counters.reconnects == 1 and bench.looks == 25


def test_a_port_that_comes_back_before_it_may_be_opened_is_tried_again(wire, monkeypatch):
    tries, opened = count(1), ports_module.open_port

    def forbidden_at_first(path: str, baud: int) -> object:
        if next(tries) < 4:
            raise DeviceError(f"{path}: no permission to open it")
        return opened(path, baud)

    wait = Reconnect(tries=1000, every_s=0.02)
    with open_device(f"serial:{wire.path}", reconnect=wait) as device:
        monkeypatch.setattr(ports_module, "open_port", forbidden_at_first)
        monkeypatch.setattr(device.transport._port, "read", lambda count: os.read(-1, 1))
        answer = device.ask(GetInfo(), 0.2)
        assert isinstance(answer, BoardInfo) and next(tries) == 5


def test_another_board_in_its_place_is_refused(bench):
    other = BoardFrames(replace(scene(), name="other"))  # another scene, another serial number
    second = SimBoard(other, [bank_bytes(prebuilt()[1], 1), empty_bank()])
    first = bench.plug(sim_board(), frame_s=0.005)
    with (
        quick(f"serial:{first.path}") as device,
        pytest.raises(DeviceError, match="another board came back"),
    ):
        for k, _ in enumerate(device.stream(Stream.RAW)):
            if k == 5:
                bench.plug(second)
                first.unplug()
            assert k < 1000


def test_unplugged_for_good_is_an_error_and_no_hang(wire):
    said = r"the port is gone .*; it did not come back within 0\.06 s: plug it in"
    with open_device(f"serial:{wire.path}", reconnect=Reconnect(tries=3, every_s=0.02)) as device:
        began = time.monotonic()
        with pytest.raises(DeviceError, match=said):
            for k, _ in enumerate(device.stream(Stream.RAW)):
                if k == 3:
                    wire.unplug()
        assert time.monotonic() - began < 10
        with pytest.raises(DeviceError, match="the port is gone"):
            device.info()


def test_a_board_that_dies_on_a_port_that_stays(wire):
    with open_device(f"serial:{wire.path}") as device:
        wire._stop.set()
        wire._thread.join(5)
        with pytest.raises(DeviceError, match="has fallen silent: TARE is not answered within"):
            device.send_command(Tare(4), 0.1)


def test_a_port_that_is_not_there(monkeypatch):
    monkeypatch.setattr(ports_module, "ports", lambda: [Port("/dev/ttyS9", "old thing")])
    said = r"/dev/ttyNONE: no such port; there are: /dev/ttyS9 \(old thing\)"
    with pytest.raises(DeviceError, match=said):
        open_device("serial:/dev/ttyNONE")


def test_a_busy_port(wire):
    first = SerialTransport(wire.path)
    try:
        with pytest.raises(DeviceError, match=f"{wire.path}: another program uses it; close that"):
            SerialTransport(wire.path)
    finally:
        first.close()
    SerialTransport(wire.path).close()  # and free again


def test_a_port_without_permission(wire, monkeypatch):
    """Superusers may open anything, so the refusal itself is put in by hand."""

    def refuse(*args: object, **kinds: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port: Permission denied")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(DeviceError) as caught:
        open_device(f"serial:{wire.path}")
    text = str(caught.value)
    assert "no permission to open it" in text
    assert """'SUBSYSTEM=="tty", ATTRS{idVendor}=="0483", MODE="0660", TAG+="uaccess"'""" in text
    assert "sudo usermod -aG dialout $USER" in text
    assert "\n" not in text


@pytest.mark.parametrize("kind", ["file", "folder", "null"])
def test_what_is_no_serial_port(kind, tmp_path):
    (tmp_path / "file").write_bytes(b"x")
    path = {"file": tmp_path / "file", "folder": tmp_path, "null": Path("/dev/null")}[kind]
    with pytest.raises(DeviceError) as caught:
        open_device(f"serial:{path}")
    assert "no serial port" in str(caught.value) or "cannot open it" in str(caught.value)
    assert "\n" not in str(caught.value)


BOARD, SECOND = st_link("/dev/ttyACM0", "A"), st_link("/dev/ttyACM1", "C")
OTHER = Port("/dev/ttyUSB0", "adapter", 0x0403, 0x6001, "B")


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ([], r"no ST-LINK port is there \(serial ports: none\)"),
        ([OTHER], r"no ST-LINK port is there \(serial ports: /dev/ttyUSB0 \(adapter\)\)"),
        ([BOARD, replace(SECOND, product=0x374E), OTHER], r"several boards .*ttyACM0.*ttyACM1"),
    ],
)
def test_auto_needs_exactly_one_board(found, message, monkeypatch):
    monkeypatch.setattr(ports_module, "ports", lambda: found)
    with pytest.raises(DeviceError, match=message):
        open_device("auto")


def test_auto_takes_the_one_board(wire, monkeypatch):
    monkeypatch.setattr(ports_module, "ports", lambda: [OTHER, st_link(wire.path)])
    with open_device("auto") as device:
        assert device.transport.name == wire.path


def test_devices_are_listed_boards_first(monkeypatch):
    monkeypatch.setattr("eitskin.device.open.ports", lambda: [Port("/dev/ttyACM9"), BOARD, OTHER])
    found = [port.path for port in list_devices()]
    assert found == ["/dev/ttyACM0", "/dev/ttyACM9", "/dev/ttyUSB0"]
