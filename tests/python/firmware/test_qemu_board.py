"""The same application on another board: it scans, tares and streams under QEMU, and its images are
the host's to the bit."""

import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from qemu_board import Run, Script, run_board, skin_bytes

from eitskin.core.engine import CoreEngine
from eitskin.device.bank import bank_bytes
from eitskin.device.known_model import board_options
from eitskin.device.wire.link_table import (
    FaultCode,
    GetInfo,
    GetStats,
    ModelBegin,
    ModelCommit,
    ModelData,
    Quality,
    Stream,
    StreamCommand,
    Tare,
)
from eitskin.device.wire.packets import (
    BoardInfo,
    BoardStats,
    Fault,
    RawFrame,
    Reply,
    SolvedImage,
    SolvedTouches,
)
from eitskin.model.prebuilt import load_prebuilt

ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES
FRAME_US = 120_000
TARED_BY_US = 500_000
LSB_V = 3.3 / 4096 / 1.5  # at the electrodes
Kind = TypeVar("Kind")


def of(kind: type[Kind], packets: Iterable[object]) -> list[Kind]:
    return [one for one in packets if isinstance(one, kind)]


def volts() -> np.ndarray:
    """Untouched for longer than the tare takes, then touches of three strengths (k, 208)."""
    model, _ = load_prebuilt()
    reference = model.golden.reference_v.astype(np.float64)
    change = model.golden.frame_v.astype(np.float64) - reference
    untouched = TARED_BY_US // FRAME_US + 1
    return np.vstack(
        [[reference] * untouched, [reference + strength * change for strength in (0.5, 1.0, 1.4)]]
    )


@pytest.fixture(scope="module")
def image(cortex_m7) -> Path:
    return cortex_m7 / "firmware" / "eitskin_mps2_an500.elf"


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    model, blob = load_prebuilt()
    script = Script()
    script.at(100_000, GetInfo())
    script.at(110_000, StreamCommand(int(Stream.RAW)))
    script.at(120_000, Tare(8))
    script.at(TARED_BY_US, StreamCommand(int(ALL)))
    script.at(990_000, GetStats())
    skin = skin_bytes(model.protocol.drive_measure, volts(), FRAME_US)
    return {
        "bank0.bin": bank_bytes(blob, 1),
        "skin.bin": skin,
        "link_in.bin": script.to_bytes(1_000_000),
    }


@pytest.fixture(scope="module")
def run(image, files, tmp_path_factory) -> Run:
    return run_board(image, tmp_path_factory.mktemp("run"), files)


def test_every_packet_arrives_and_every_command_succeeds(run):
    assert vars(run.counters) | {"bytes": 0, "packets": 0} == dict.fromkeys(vars(run.counters), 0)
    assert [reply.request for reply in of(Reply, run.packets) if reply.ok] == [2, 3, 4]
    assert of(Fault, run.packets) == []


def test_the_scan_keeps_its_time(run):
    (stats,) = of(BoardStats, run.packets)
    info = of(BoardInfo, run.packets)[-1]
    assert info.board == "mps2_an500" and info.slot_us == 100
    assert stats.slots_repeated == 0 and stats.packets_dropped == 0
    scans = {raw.scan_us for raw in of(RawFrame, run.packets)}
    print(
        f"\nscan {scans} us; stack {stats.stack_used} of {stats.stack_bytes}; {stats.frames_solved}"
        " frames solved"
    )
    assert max(scans) <= 208 * info.slot_us
    assert stats.stack_used < 18 * 1024  # the F767 has 24 KB


def test_the_voltages_are_the_skins(run):
    """Amplitudes within half a step of the converter, signs and order as the protocol has them."""
    untouched = [raw for raw in of(RawFrame, run.packets) if raw.untouched]
    assert len(untouched) == 8
    expected = volts()[0]
    for raw in untouched:
        assert not (raw.quality & ~np.uint8(Quality.RECIPROCITY)).any()
        assert np.abs(raw.voltage_v - expected).max() < LSB_V / 2


def test_the_same_bits_as_the_host(run):
    model, blob = load_prebuilt()
    host = CoreEngine(blob)
    host.set_options(board_options(model, of(BoardInfo, run.packets)[-1]))
    raws = of(RawFrame, run.packets)
    host.set_reference(np.array([raw.voltage_v for raw in raws if raw.untouched], dtype=np.float64))
    images = {one.solved.frame: one for one in of(SolvedImage, run.packets)}
    touches = {one.solved.frame: one for one in of(SolvedTouches, run.packets)}
    assert len(images) >= 8 and images.keys() == touches.keys()
    last_untouched = max(raw.frame for raw in raws if raw.untouched)
    found = 0
    for raw in raws:
        if raw.frame <= last_untouched:
            continue
        expected = host.reconstruct(raw.voltage_v)
        if raw.frame not in images:
            continue
        board = images.pop(raw.frame)
        assert board.image.tobytes() == expected.solver_image.tobytes(), f"frame {raw.frame}"
        reported = board.solved.stop, board.solved.iterations
        assert reported == (expected.info.stop, expected.info.iterations)
        assert [replace(touch, id=0) for touch in touches[raw.frame].touches] == [
            replace(touch, id=0) for touch in expected.touches
        ]
        found += len(expected.touches)
    assert not images, "images of frames whose voltages were not sent"
    assert found >= 4


def test_runs_are_alike_to_the_bit(image, files, run, tmp_path):
    assert run_board(image, tmp_path, files).output == run.output


def test_a_model_is_uploaded_into_an_empty_board(image, tmp_path):
    _, blob = load_prebuilt()
    script, each, step_us = Script(), 4096, 2_000
    script.at(10_000, GetInfo())
    script.at(20_000, ModelBegin(len(blob), zlib.crc32(blob)))
    time_us = 60_000
    for offset in range(0, len(blob), each):
        script.at(time_us, ModelData(offset, blob[offset : offset + each]))
        time_us += step_us
    commit = script.at(time_us, ModelCommit())
    script.at(time_us + 300_000, GetInfo())
    run = run_board(image, tmp_path, {"link_in.bin": script.to_bytes(time_us + 310_000)})
    before, *_, after = of(BoardInfo, run.packets)
    assert before.model_bytes == 0
    assert FaultCode.NO_MODEL in [fault.code for fault in of(Fault, run.packets)]
    assert [reply.status for reply in of(Reply, run.packets)] == [0] * (commit - 1)
    assert after.model_bytes == len(blob) and after.n_rows == 208
