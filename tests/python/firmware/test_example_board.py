"""The board of the porting guide, another generator, other switches and another link, speaks with
the host's client, scans its ring of resistors and solves with the host's bits."""

import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from cross_build import ROOT
from eitskin.device.client import Device
from eitskin.device.known_model import KnownModel, board_options
from eitskin.device.ports import SerialTransport
from eitskin.device.wire import link_table as commands
from eitskin.device.wire.link_table import Quality, Stream
from eitskin.device.wire.packets import RawFrame
from eitskin.model.eitm import decode_model
from eitskin.session.assemble import assembled
from eitskin.session.checks.host_check import HostTwin
from eitskin.session.frame import Frame
from small_models import small_blob

ELECTRODES, OHM, PRESSED, CURRENT_A = 24, 1000.0, 5, 1e-3
LSB_V = 3.3 / 4096 / 1.5
ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES
M4 = "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16"


def ring_v(rows: np.ndarray, pressed: bool) -> np.ndarray:
    """Voltages of the ring, by its nodes' conductances: the board computes them by arcs."""
    siemens = np.full(ELECTRODES, 1 / OHM)
    siemens[PRESSED] *= 3 if pressed else 1
    after = np.roll(np.eye(ELECTRODES), 1, axis=1) - np.eye(ELECTRODES)
    ohm = np.linalg.pinv(after.T @ np.diag(siemens) @ after)
    plus, minus, v_plus, v_minus = rows.T
    return CURRENT_A * (
        ohm[v_plus, plus] - ohm[v_plus, minus] - ohm[v_minus, plus] + ohm[v_minus, minus]
    )


@contextmanager
def board(image: Path, machine: str) -> Iterator[Device]:
    """QEMU with the image, its UART on a pseudo-terminal."""
    command = ["qemu-system-arm", "-M", machine, "-display", "none", "-monitor", "none"]
    command += ["-icount", "shift=6,sleep=off", "-serial", "pty", "-kernel", str(image)]
    emulator = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        assert emulator.stdout is not None
        line = emulator.stdout.readline()
        found = re.search(r"/dev/\S+", line)
        assert found, line
        with Device(SerialTransport(found[0])) as device:
            yield device
    finally:
        emulator.kill()
        emulator.wait()


def check(image: Path, machine: str) -> None:
    """A tare, untouched frames, then frames of the pressed ring."""
    blob = small_blob(electrodes=8, rank=19)
    model = decode_model(blob, "the model")
    with board(image, machine) as device:
        info = device.board
        assert (info.board, info.electrodes, info.excitation_millihz) == ("example", 24, 50_000_000)
        device.upload_model(blob)
        twin = HostTwin(KnownModel(model, blob), board_options(model, device.board), device.board)
        for raw in tared(device):
            twin.take(Frame(raw.frame, 0, raw.time_us, raw=raw))
        frames, pressed, until = [], 0, time.monotonic() + 240
        for frame in assembled(device.stream(ALL), ALL):
            if isinstance(frame, Frame) and frame.raw is not None:
                twin.take(frame)
                frames.append(frame.raw)
                pressed += far(frame.raw, frames[0])
                if pressed == 2 or time.monotonic() > until:  # the first may be of both
                    break
        assert device.stats().slots_repeated == 0
    rows = model.protocol.drive_measure
    for raw, is_pressed in ((frames[0], False), (frames[-1], True)):
        assert not (raw.quality & ~np.uint8(Quality.RECIPROCITY)).any()
        assert np.abs(raw.voltage_v - ring_v(rows, is_pressed)).max() < LSB_V / 2
    assert twin.check.as_dict()["same_bits"] and twin.check.compared >= 4


def tared(device: Device) -> list[RawFrame]:
    """The frames that the board took its reference from."""
    taken = []
    device.send_command(commands.StreamCommand(int(Stream.RAW)), 1.0)
    device.tare(8)
    device.send_command(commands.StreamCommand(0), 1.0)
    while (item := device.next_item(0.3)) is not None:
        taken.append(item)
    return [item for item in taken if isinstance(item, RawFrame) and item.untouched]


def far(raw: RawFrame, first: RawFrame) -> bool:
    return bool(np.abs(raw.voltage_v - first.voltage_v).max() > 20 * LSB_V)


def test_it_is_an_instrument(cortex_m7):
    check(cortex_m7 / "firmware" / "eitskin_example.elf", "mps2-an500")


@pytest.mark.long("the same board on a Cortex-M7, whose build other tests use")
def test_it_is_one_on_a_cortex_m4(tmp_path):
    if shutil.which("arm-none-eabi-gcc") is None:
        pytest.fail("no arm-none-eabi-gcc: install gcc-arm-none-eabi")
    for command in (
        ["cmake", "--preset", "cortex-m7", "-B", str(tmp_path), f"-DEITSKIN_CPU={M4}"],
        ["cmake", "--build", str(tmp_path), "--target", "eitskin_example"],
    ):
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    check(tmp_path / "firmware" / "eitskin_example.elf", "mps2-an386")


def test_the_porting_guide_counts_the_lines_of_its_files():
    page = (ROOT / "docs" / "guide" / "your-board.md").read_text(encoding="utf-8")
    folder = ROOT / "firmware" / "boards" / "example"
    counts = re.findall(r"^\| `([\w./]+)` \| (\d+) \|", page, re.MULTILINE)
    assert len(counts) == 10
    for name, lines in counts:
        assert len((folder / name).read_text(encoding="utf-8").splitlines()) == int(lines), name
