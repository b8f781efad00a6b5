"""Diagnostics of a stream are named in the heads of frames, as faults, and once in lines: on a
simulated board, and in a recording of it."""

import zlib
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import pytest
from device_helpers import UNTOUCHED, Damaging, empty_bank, of, same, scene, sim_device

from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS, DIAGNOSTICS
from eitskin.device.bank import bank_bytes
from eitskin.device.client import Device
from eitskin.device.known_model import board_options
from eitskin.device.open import open_device
from eitskin.device.recordings.recording import Recorder
from eitskin.device.simulated import SimBoard, SimTransport
from eitskin.device.wire.codec import Decoder, encode
from eitskin.device.wire.link_table import (
    FAULT_CLEAR_FRAMES,
    FAULT_RAISE_FRAMES,
    FaultCode,
    PacketType,
    Stream,
)
from eitskin.device.wire.packets import Fault, Solved, SolvedTouches
from eitskin.errors import DeviceError
from eitskin.scene.board_frames import BoardFrames
from eitskin.session.assemble import read_frames
from eitskin.session.checks.host_check import check_recording
from eitskin.session.frame import Frame
from eitskin.session.notices import Novelty, notice_of
from eitskin.session.set_up import take_reference
from small_models import prebuilt

OPEN_AT = Solved.LAYOUT.size - 24  # of the open electrodes in a head
OFF, FROM_FRAME, UNTIL_FRAME, FRAMES = 5, 3, 6, 20
ALL = Stream.RAW | Stream.IMAGE | Stream.TOUCHES


@cache
def wobbling() -> BoardFrames:
    """One touch, and electrode 5 off from the scene's frame 3 until frame 6."""
    times = {"from_s": (FROM_FRAME - 0.5) / 20, "until_s": (UNTIL_FRAME - 0.5) / 20}
    effects = {**scene().effects, "detached": {"electrodes": [OFF], **times}}
    return BoardFrames(replace(scene(), frames=FRAMES, effects=effects))


def board() -> SimBoard:
    return SimBoard(wobbling(), [bank_bytes(prebuilt()[1], 1), empty_bank()])


def heads(items: Iterable[object]) -> list[Solved]:
    return [item.solved for item in of(SolvedTouches, items)]


def faults(items: Iterable[object]) -> list[tuple[int, bool, int, int]]:
    return [(item.code, item.raised, item.index, item.frame) for item in of(Fault, items)]


@pytest.mark.parametrize("every", [1, 4])
def test_an_electrode_that_comes_off_is_named_and_goes_when_it_is_back(every):
    """The electrode is named in that very frame. If touches are tracked through scans, it is named
    two frames later, because a touch might have caused the change."""
    late = 2 if every == 1 else 0
    with sim_device(board()) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        items = list(device.stream(Stream.TOUCHES, every=every))
        assert device.info().faults == 0
    first = heads(items)[0].frame
    assert [head.open_electrodes for head in heads(items)] == [
        (OFF,) if FROM_FRAME + late <= head.frame - first < UNTIL_FRAME else ()
        for head in heads(items)
    ]
    reported = [fault for fault in faults(items) if fault[0] == FaultCode.ELECTRODE_OPEN]
    gone = first + UNTIL_FRAME + FAULT_CLEAR_FRAMES - 1
    assert reported == [
        (FaultCode.ELECTRODE_OPEN, True, OFF, first + FROM_FRAME + late),
        (FaultCode.ELECTRODE_OPEN, False, OFF, gone),
    ]
    if every == 1:
        at = next(k for k, item in enumerate(items) if isinstance(item, Fault))
        # the fault comes before the frame that it is of
        assert heads(items[at:])[0].frame == first + FROM_FRAME + late
        row = prebuilt()[0].protocol.drive_measure
        assert heads(items)[FROM_FRAME + late].masked == int((row == OFF).any(axis=1).sum())


@pytest.mark.parametrize(("off", "touched"), [(5, True), (7, False), (8, True)])
def test_an_electrode_that_stays_off_is_named_in_each_frame(off, touched):
    """Without its contact the rows beside it change by some times the noise, which drives do not
    explain: such frames are solved all the same."""
    from_frame, frames = 2, 14
    effects = {**scene().effects, "detached": {"electrodes": [off], "from_s": 1.5 / 20}}
    touches = scene().touches if touched else ()
    staying = BoardFrames(replace(scene(), frames=frames, effects=effects, touches=touches))
    with sim_device(SimBoard(staying, [bank_bytes(prebuilt()[1], 1), empty_bank()])) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        named = [head.open_electrodes for head in heads(device.stream(Stream.TOUCHES))]
    assert named[from_frame + 3 :] == [(off,)] * (frames - from_frame - 3)


def test_it_is_told_though_nobody_wants_images():
    with sim_device(board()) as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        reported = faults(device.stream(Stream.RAW))
    found = [fault[:3] for fault in reported]
    assert found == [(FaultCode.ELECTRODE_OPEN, True, OFF), (FaultCode.ELECTRODE_OPEN, False, OFF)]


def test_what_is_not_looked_for_is_not_found():
    opened = bits("electrode open")
    with sim_device(board()) as device:
        device.tare(UNTOUCHED)
        options = board_options(prebuilt()[0], device.board)
        device.solver(replace(options, diagnostics=ALL_DIAGNOSTICS & ~opened))
        device.start_scene()
        items = list(device.stream(Stream.TOUCHES))
    assert not any(head.open_electrodes or head.diagnostics & opened for head in heads(items))
    assert FaultCode.ELECTRODE_OPEN not in {fault[0] for fault in faults(items)}


def test_the_check_finds_what_the_board_found(tmp_path):
    path = tmp_path / "run.eits"
    with sim_device(board()) as device:
        options = board_options(prebuilt()[0], device.board)
        device.solver(options)
        with Recorder(path, device, options):
            take_reference(device, UNTOUCHED, streamed=True)
            device.start_scene()
            live = of(Frame, read_frames(device, ALL))
    assert (OFF,) in {frame.info.open_electrodes for frame in live if frame.info is not None}
    check, noted = check_recording(path, None)
    assert noted and (check.same, check.different) == (FRAMES, [])


def test_the_check_tells_findings_apart(tmp_path):
    """A board that hides an electrode's fate in its heads differs from the host."""

    def hide(data: bytes) -> bytes:
        packets = [(p.type, p.sequence, bytearray(p.payload)) for p in Decoder().feed(data)]
        for kind, _, payload in packets:
            if kind in (PacketType.IMAGE, PacketType.TOUCHES):
                payload[OPEN_AT : OPEN_AT + 8] = bytes(8)
        return b"".join(encode(kind, k, bytes(payload)) for kind, k, payload in packets)

    path, hiding = tmp_path / "run.eits", Damaging(SimTransport("hides", board()), same, hide)
    with Device(hiding) as device, Recorder(path, device):
        device.solver(board_options(prebuilt()[0]))
        take_reference(device, UNTOUCHED, streamed=True)
        device.start_scene()
        list(read_frames(device, ALL))
    check, _ = check_recording(path, None)
    assert len(check.different) == UNTIL_FRAME - FROM_FRAME - 2  # that were solved


def test_a_recording_of_link_version_1_is_refused_by_a_line(tmp_path):
    head = bytes([1, 0x70, 1, 0, 1, 1, 1, 1]) + b"{"
    plain = head + zlib.crc32(head).to_bytes(4, "little")
    stuffed = bytes([4]) + plain[:3] + bytes([len(plain) - 3]) + plain[4:]
    path = tmp_path / "old.eits"
    path.write_bytes(b"\0" + stuffed + b"\0")
    with pytest.raises(
        DeviceError,
        match=r"old\.eits: packets of link version 1, and this eitskin reads version 6; read",
    ):
        open_device(f"file:{path}")


# ---- lines ----


def solved(frame: int, **found: object) -> Frame:
    head = Solved(
        frame,
        0,
        0,
        0,
        0,
        0,
        0,
        "gap",
        "solver",
        0,
        1,
        1,
        1,
        1,
        0.1,
        0.2,
        0.0,
        0.0,
        0.0,
        1.0,
        **found,
    )
    return Frame(frame, 0, 0, has_touches=True, info=head)


def bits(*names: str) -> int:
    return sum(1 << DIAGNOSTICS.index(name) for name in names)


def test_what_only_heads_tell_is_said_once_and_when_it_is_over():
    events, nearly = Novelty(), FAULT_CLEAR_FRAMES - 1
    outlier = {"diagnostics": bits("outlier"), "outliers": 1}
    assert events.lines(solved(1)) == []
    said = [events.lines(solved(frame, **outlier)) for frame in range(FAULT_RAISE_FRAMES + 1)]
    line = f"1 row left out as an outlier, frame {FAULT_RAISE_FRAMES - 1}"
    assert said == [[]] * (FAULT_RAISE_FRAMES - 1) + [[line], []]
    assert [events.lines(solved(4 + k)) for k in range(nearly)] == [[]] * nearly
    assert events.lines(solved(20, **outlier)) == []  # it came back in time
    said = [events.lines(solved(21 + k)) for k in range(FAULT_CLEAR_FRAMES)]
    assert said == [[]] * nearly + [[f"outlier: over, frame {20 + FAULT_CLEAR_FRAMES}"]]


def test_what_fault_and_head_tell_is_said_once():
    events, opened = Novelty(), {"diagnostics": bits("electrode open")}
    rise = Fault(FaultCode.ELECTRODE_OPEN, True, 41, 5, 0)
    over = Fault(FaultCode.ELECTRODE_OPEN, False, 53, 5, 0)
    what_to_do = "it makes no contact; wet or press it, then tare"
    for reported, said in (
        (rise, [f"electrode 5 open, frame 41: {what_to_do}"]),
        (solved(41, open_electrodes=(5,), **opened), []),
        # the fault of 9 was lost
        (solved(42, open_electrodes=(5, 9), **opened), ["electrode 9 open, frame 42"]),
        (replace(rise, frame=42, index=9), []),
        (over, ["electrode 5 open: over, frame 53"]),
        (over, []),
    ):
        assert (
            events.lines(reported if isinstance(reported, Frame) else notice_of(reported)) == said
        )


def test_a_bridged_pair_is_said_once():
    events, both = Novelty(), (0xC0, 0, 0, 0, 0)
    what_to_do = "water, paste or a wire joins them; dry or separate them"
    pair = {"diagnostics": bits("electrodes bridged"), "bridged_electrodes": (6, 7)}
    for reported, said in (
        (Fault(FaultCode.BRIDGED, True, 3, 6, 7, both),
         [f"electrodes 6 and 7 bridged, frame 3: {what_to_do}"]),
        (Fault(FaultCode.BRIDGED, True, 3, 7, 6, both), []),
        (solved(3, **pair), []),
        (Fault(FaultCode.BRIDGED, False, 11, 6, 0), ["electrode 6 bridged: over, frame 11"]),
        (Fault(FaultCode.BRIDGED, False, 11, 7, 0), ["electrode 7 bridged: over, frame 11"]),
    ):  # fmt: skip
        assert (
            events.lines(reported if isinstance(reported, Frame) else notice_of(reported)) == said
        )


def test_what_a_moving_touch_looks_like_is_said_only_when_it_lasts():
    events, off = Novelty(), {"diagnostics": bits("model mismatch"), "model_mismatch": 0.125}
    frames = ((k, off if k in (2, 3, 7, 8, 9, 10) else {}) for k in range(1, 12))
    reported = [events.lines(solved(frame, **found)) for frame, found in frames]
    assert reported == [[]] * 8 + [["model mismatch 12.5 %, frame 9"], [], []]
