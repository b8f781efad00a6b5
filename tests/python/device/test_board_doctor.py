"""The doctor before a board: its own faults become findings, its missing rows are looked at,
import's remedies are left out."""

import zlib
from dataclasses import replace

import numpy as np
import pytest
from device_helpers import board_info

from eitskin.device.known_model import KnownModel, find_model, need_model, scanned_protocol
from eitskin.device.wire.link_table import FaultCode, Quality
from eitskin.device.wire.packets import BoardInfo, Fault, RawFrame
from eitskin.errors import DeviceError, FrameError
from eitskin.frames.doctor.examine import examine
from eitskin.frames.doctor.subject import subject_from_frames
from eitskin.session.checks.diagnose_board import MeasuredBoard, board_findings
from eitskin.session.checks.raw_frames import RawRun, as_frames, finite_only, gather
from eitskin.session.frame import Frame
from eitskin.skin.protocol import adjacent, opposite, skip
from small_models import prebuilt, session


def info(**changes: object) -> BoardInfo:
    """Return the properties of a board with the prebuilt model."""
    model, blob = prebuilt()
    own = {"model_bytes": len(blob), "model_crc": zlib.crc32(blob)}
    return board_info(**own | {"protocol_hash": model.protocol.hash, "drive": 1} | changes)


def raw_frames(open_electrode: int | None = None) -> list[RawFrame]:
    """Sixteen untouched frames, all rows of one electrode missing."""
    rows = prebuilt()[0].protocol.drive_measure
    gone = (rows == -1 if open_electrode is None else rows == open_electrode).any(axis=1)
    quality = np.where(gone, int(Quality.OPEN), 0).astype(np.uint8)
    volts = [
        np.where(gone, np.nan, untouched).astype(np.float32)
        for untouched in session().untouched_v[:16]
    ]
    return [RawFrame(k, 20_800 * k, 20_780, 0, v, quality) for k, v in enumerate(volts)]


def test_an_open_electrode_is_found_by_the_doctor_and_told_by_the_board():
    fault = Fault(FaultCode.ELECTRODE_OPEN, True, 3, 5, 0)
    run = RawRun([], raw_frames(open_electrode=5), [fault, replace(fault, raised=False)], missing=2)
    board = info(faults=1 << FaultCode.ELECTRODE_OPEN | 1 << FaultCode.WATCHDOG)
    known = KnownModel(*prebuilt())
    frames = as_frames(run.frames, [], known.model.protocol, board, known, allow_nonfinite=True)
    report = board_findings(
        examine(subject_from_frames(frames, known.model.skin)),
        MeasuredBoard(run, RawRun(), board, None),
    )
    by_name = {finding.name: finding for finding in report.findings}
    assert "electrode 5 open, frame 3: it makes no contact" in by_name["board-electrode-open"].text
    assert by_name["board-watchdog"].severity == "note"
    assert "2 packets" in by_name["board-link"].text
    assert "not-finite" in by_name and report.exit_code == 11
    assert report.repair == "" and not any(finding.repair for finding in report.findings)
    assert not any("import" in text for text in report.lines())


def test_protocols_that_need_no_model():
    for protocol in (adjacent(16), opposite(16), skip(16, 3), adjacent(8), skip(11, 2)):
        electrodes, rows = protocol.n_electrodes, protocol.n_rows
        board = info(model_crc=1, protocol_hash=protocol.hash, n_electrodes=electrodes, n_rows=rows)
        assert scanned_protocol(board, None, "x").hash == protocol.hash
    with pytest.raises(DeviceError, match="only the board's model shows which rows"):
        scanned_protocol(info(model_crc=1, protocol_hash=1), None, "x")
    found = scanned_protocol(info(protocol_hash=1), KnownModel(*prebuilt()), "x").hash
    assert found == prebuilt()[0].protocol.hash


def test_the_prebuilt_model_is_known_by_its_checksum():
    known = find_model(info(), None, "x")
    assert known is not None and known.blob == prebuilt()[1]
    another, none = info(model_crc=1), info(model_bytes=0)
    assert find_model(another, None, "x") is find_model(none, None, "x") is None
    said = "x: a picture needs the board's model, 00000001, which is not the prebuilt one"
    with pytest.raises(DeviceError, match=said):
        need_model(another, None, "x", "a picture")
    with pytest.raises(DeviceError, match="no model; upload one"):
        need_model(none, None, "x", "a picture")


def test_only_frames_that_are_whole_become_a_frames_file():
    whole, cut = raw_frames(), raw_frames(open_electrode=5)
    known = KnownModel(*prebuilt())

    def made(untouched: list[RawFrame], frames: list[RawFrame]) -> tuple[int, int]:
        protocol = known.model.protocol
        given = as_frames(untouched, frames, protocol, info(), known, allow_nonfinite=True)
        kept, left_out = finite_only(given, "x")
        return kept.n_frames, left_out

    assert made(whole, [*whole[:3], *cut[:2]]) == (3, 2)
    missing = r"x: no frame has all its rows measured; row \d+ is missing most often"
    for untouched, frames, said in (
        (whole, cut, missing),
        (cut, whole, "x: no untouched frame has all"),
        ([], whole, "there is no untouched frame"),
    ):
        with pytest.raises(FrameError, match=said):
            made(untouched, frames)


def test_of_two_tares_the_last_counts():
    order = [True, True, False, False, True, False]
    marked = (
        replace(raw, flags=int(untouched))
        for raw, untouched in zip(raw_frames(), order, strict=False)
    )
    run = gather(Frame(raw.frame, 0, 0, raw=raw) for raw in marked)
    assert [raw.frame for raw in run.untouched] == [4] and [raw.frame for raw in run.frames] == [5]
    assert run.left_out == 4
