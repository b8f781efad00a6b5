"""The same application on another board: it scans, tares and streams under QEMU, and its images are
the host's to the bit."""

import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from qemu_board import Run, Script, run_board, skin_bytes

from eitskin.device.bank import bank_bytes
from eitskin.device.known_model import KnownModel, board_options
from eitskin.device.wire.link_table import (
    FaultCode,
    GetInfo,
    GetStats,
    ModelBegin,
    ModelCommit,
    ModelData,
    Quality,
    Scan,
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
from eitskin.session.assemble import assembled
from eitskin.session.checks.host_check import HostTwin
from eitskin.session.frame import Frame

ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES
PERIOD_US = 80_000  # of frames: each is solved before the next, by QEMU's slow processor, too
FRAME_US = 3 * PERIOD_US
TARED_BY_US = 900_000
SOON_US = 1_150_000  # a touched frame has been solved
END_US = 1_700_000
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


def files_until(end_us: int) -> dict[str, bytes]:
    model, blob = load_prebuilt()
    script = Script()
    script.at(100_000, GetInfo())
    script.at(105_000, Scan(50_000_000, 1_000_000, 80, 16, 1, 0, PERIOD_US))
    script.at(110_000, StreamCommand(int(Stream.RAW)))
    script.at(120_000, Tare(8))
    script.at(TARED_BY_US, StreamCommand(int(ALL)))
    if end_us == END_US:
        script.at(END_US - 10_000, GetStats())
    skin = skin_bytes(model.protocol.drive_measure, volts(), FRAME_US)
    return {
        "bank0.bin": bank_bytes(blob, 1),
        "skin.bin": skin,
        "link_in.bin": script.to_bytes(end_us),
    }


@pytest.fixture(scope="module")
def run(image, tmp_path_factory) -> Run:
    return run_board(image, tmp_path_factory.mktemp("run"), files_until(END_US))


def test_every_packet_arrives_and_every_command_succeeds(run):
    assert vars(run.counters) | {"bytes": 0, "packets": 0} == dict.fromkeys(vars(run.counters), 0)
    assert [reply.request for reply in of(Reply, run.packets) if reply.ok] == [2, 3, 4, 5]
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
    # the joint fit of touches takes most of it: 20124 bytes; the F767 has 24 KB but for a guard
    assert stats.stack_used < 20 * 1024


def test_the_voltages_are_the_skins(run):
    """Amplitudes within half a step of the converter, signs and order as the protocol has them."""
    untouched = [raw for raw in of(RawFrame, run.packets) if raw.untouched]
    assert len(untouched) == 8
    expected = volts()[0]
    for raw in untouched:
        assert not (raw.quality & ~np.uint8(Quality.RECIPROCITY)).any()
        assert np.abs(raw.voltage_v - expected).max() < LSB_V / 2


def test_the_same_bits_as_the_host(run):
    """Images, and touches tracked through scans."""
    model, blob = load_prebuilt()
    info = of(BoardInfo, run.packets)[-1]
    parts = [one for one in run.packets if isinstance(one, RawFrame | SolvedImage | SolvedTouches)]
    twin = HostTwin(KnownModel(model, blob), board_options(model, info), info)
    solved = found = 0
    for frame in assembled(parts, ALL):
        assert isinstance(frame, Frame)
        host = twin.take(frame)
        if host is None:
            continue
        assert frame.info is not None
        reported = frame.info.stop, frame.info.iterations
        assert reported == (host.info.stop, host.info.iterations)
        solved, found = solved + 1, found + len(host.touches)
    check = twin.check
    assert (check.different, check.inconclusive, check.alone) == ([], 0, 0)
    assert check.same == check.images == check.touches >= solved >= 6
    assert found >= 4


def test_runs_are_alike_to_the_bit(image, run, tmp_path):
    """Another run, which ends earlier, sends what the first sent until then."""
    again = run_board(image, tmp_path, files_until(SOON_US))
    assert any(touches.touches for touches in of(SolvedTouches, again.packets))
    assert run.output.startswith(again.output)


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
