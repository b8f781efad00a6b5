"""A board's numbers in words: each number is in its place, and each text says what to do."""

import numpy as np
import pytest
from device_helpers import board_info

from eitskin.device.bandwidth import frame_bytes, least_every
from eitskin.device.client import check_tare_frames
from eitskin.device.known_model import scanned_protocol
from eitskin.device.link import LinkEvent
from eitskin.device.wire.explain import fault_text, field_at, quality_text, reply_text
from eitskin.device.wire.layout import Command
from eitskin.device.wire.link_table import FaultCode, PacketType, Quality, ReplyStatus, Stream
from eitskin.device.wire.packets import Fault, Reply
from eitskin.errors import DeviceError, UsageError
from eitskin.session.notices import Novelty, notice_of
from eitskin.skin.protocol import adjacent, opposite, skip

SCAN = PacketType.SCAN
EXCITATION_AT = next(
    at for at in range(64) if field_at(SCAN, at) == "excitation_millihz"
)  # the field's place in the packet

REPLIES = {
    "done": (ReplyStatus.OK, (0, 0), "SCAN: done"),
    "another length": (ReplyStatus.LENGTH, (28, 0), "expects 28 bytes; flash one of this version"),
    "out of range": (
        ReplyStatus.RANGE, (EXCITATION_AT, 7), "excitation_millihz is out of range, its limit is 7",
    ),
    "no such field": (ReplyStatus.RANGE, (999, 7), "byte 999 is out of range, its limit is 7"),
    "no model": (ReplyStatus.NO_MODEL, (0, 0), "upload one with  eitskin model upload"),
    "no reference": (ReplyStatus.NOT_TARED, (0, 0), "untouched and run  eitskin tare"),
    "busy": (ReplyStatus.BUSY, (PacketType.TARE, 0), "the board is busy with TARE; wait for it"),
    "a model too large": (ReplyStatus.MODEL_SIZE, (4096, 0), "models of 4096 bytes at most"),
    "a model with a wrong number": (
        ReplyStatus.MODEL_INVALID, (0, 0), "the board refuses the model: ok; the old one stays",
    ),
    "a model of more electrodes": (
        ReplyStatus.MODEL_SCAN, (32, 16), "needs 32 electrodes and the board has 16",
    ),
    "bytes from elsewhere": (ReplyStatus.OFFSET, (512, 0), "the model's bytes from 512 on"),
    "a flash that fails": (ReplyStatus.FLASH, (77, 0), "the flash failed at byte 77"),
    "no whole periods": (ReplyStatus.PERIODS, (84, 0), "the nearest that are: 84"),
    "too fast": (ReplyStatus.TOO_FAST, (20_800, 0), "a frame period of at least 20800 us"),
    "another image": (ReplyStatus.SELF_TEST, (31, 0), "by 31 parts in 1e9 of its peak"),
    "locked": (ReplyStatus.LOCKED, (0, 0), "hold the blue button on it and run this again"),
    "a status of a newer board": (200, (0, 0), "SCAN: refused with the unknown status 200"),
}  # fmt: skip


@pytest.mark.parametrize(("status", "detail", "said"), REPLIES.values(), ids=REPLIES)
def test_a_reply_says_why_and_what_to_do(status, detail, said):
    text = reply_text(Reply(request=1, command=SCAN, status=status, detail=detail))
    assert text.startswith("SCAN: ") and said in text


def test_every_reply_has_a_text_of_its_own():
    texts = {reply_text(Reply(1, SCAN, status, (1, 2))) for status in ReplyStatus}
    assert len(texts) == len(ReplyStatus)
    assert not any("unknown status 1" in text for text in texts)
    assert reply_text(Reply(1, 0x99, ReplyStatus.OK, (0, 0))) == "command 0x99: done"


def test_fields_are_named_by_their_offset():
    layout = Command.KNOWN[SCAN].LAYOUT
    names = [field_at(SCAN, at) for at in range(layout.size)]
    assert names[0] == "request" and set(names) - {f"byte {at}" for at in range(layout.size)}
    assert field_at(SCAN, layout.size) == f"byte {layout.size}"
    assert field_at(0x99, 4) == "byte 4"


FAULTS = {
    "an open electrode": (
        FaultCode.ELECTRODE_OPEN, 5, 0,
        "electrode 5 open, frame 70: it makes no contact; wet or press it, then tare",
        "electrode 5 open: over, frame 70",
    ),
    "saturated rows": (
        FaultCode.SATURATED, 5, 9,
        "9 rows saturated from row 5 on, frame 70: beyond the converter's range; lower the gain or"
        " the current",
        "rows saturated: over, frame 70",
    ),
    "a bridge": (
        FaultCode.BRIDGED, 5, 6,
        "electrodes 5 and 6 bridged, frame 70: water, paste or a wire joins them; dry or"
        " separate them",
        "electrode 5 bridged: over, frame 70",
    ),
    "a mismatch": (
        FaultCode.MODEL_MISMATCH, 0, 73,
        "model mismatch 7.3 %, frame 70: no change of this skin gives such voltages; check order,"
        " signs and wiring (eitskin doctor)",
        "model mismatch: over, frame 70",
    ),
    "a late frame": (
        FaultCode.DEADLINE, 0, 900,
        "deadline, frame 70: it took 900 us longer than the frame period; make the period longer",
        "deadline: over, frame 70",
    ),
    "reciprocals that differ": (
        FaultCode.RECIPROCITY, 5, 9,
        "reciprocity, frame 70: row 5 and its reciprocal differ by 9 parts per thousand of the rms"
        " voltage; check the wiring (eitskin doctor)",
        "reciprocity: over, frame 70",
    ),
    "too much current": (
        FaultCode.CURRENT, 0, 800,
        "current, frame 70: 800 uA rms flowed, above the limit, and was switched off; look for a"
        " short or a wrong part, then run  eitskin board --clear-faults",
        "current: over, frame 70",
    ),
    "a locked board": (
        FaultCode.LOCKED, PacketType.TARE, 0,
        "locked, frame 70: the locked board refused TARE; its owner must hold the blue button",
        "locked: over, frame 70",
    ),
    "no analog supply": (
        FaultCode.ANALOG_SUPPLY, 0, 0,
        "analog supply, frame 70: the analog supply of +-15 V, or one half of it, is missing;"
        " switch it on, then measure it at the board",
        "analog supply: over, frame 70",
    ),
    "a crash": (
        FaultCode.CRASH, 0, 0,
        "crash, frame 70: the board restarted after a processor fault at pc 0x00000001, lr"
        " 0x00000002, cfsr 0x00000003, hfsr 0x00000004, address 0x00000005; please report it",
        "crash: over, frame 70",
    ),
    "a fault of a newer board": (200, 5, 9, "fault 200, frame 70: value 9",
                                 "fault 200: over, frame 70"),
}  # fmt: skip


@pytest.mark.parametrize(("code", "index", "value", "up", "over"), FAULTS.values(), ids=FAULTS)
def test_a_fault_says_what_and_where_and_what_to_do(code, index, value, up, over):
    words = (1, 2, 3, 4, 5)
    assert fault_text(Fault(code, True, 70, index, value, words)) == up
    assert fault_text(Fault(code, False, 70, index, value, words)) == over


def test_every_fault_has_a_text_of_its_own():
    texts = {fault_text(Fault(code, True, 70, 5, 9, (1, 2, 3, 4, 5))) for code in FaultCode}
    assert len(texts) == len(FaultCode)
    assert not any(text.startswith("fault ") for text in texts)


def test_qualities_are_named_by_their_bits():
    assert quality_text(0) == "good"
    assert quality_text(Quality.SATURATED) == "saturated"
    assert quality_text(Quality.SATURATED | Quality.RECIPROCITY) == "saturated, reciprocity"
    every = quality_text(int(np.bitwise_or.reduce([bit.value for bit in Quality])))
    assert every.split(", ") == [bit.name.lower() for bit in Quality if bit.name]


LINK = {
    "restarted": (LinkEvent("restarted", 0, ""), "link: restarted"),
    "a gap": (LinkEvent("gap", 4, ""), "link: gap (4 packets)"),
    "dropped, with a text": (LinkEvent("dropped", 1, "said"), "link: dropped (1 packets): said"),
    "skipped lines": (LinkEvent("skipped", 4, "said"), "lines: said"),
}


@pytest.mark.parametrize(("event", "line"), LINK.values(), ids=LINK)
def test_what_happens_to_the_line_is_one_line(event, line):
    assert Novelty().lines(notice_of(event)) == [line]


BYTES = {  # 208 rows, 812 pixels, 16 electrodes; 16 bytes around a packet, one in 254 for stuffing
    Stream.RAW: 16 + 208 * 5 + 16 + 4,
    Stream.IMAGE: 104 + 812 * 4 + 16 + 13,
    Stream.TOUCHES: 104 + 8 * 60 + 16 + 2,
    Stream.EVENTS: 12 + 4 * 28 + 16,
    Stream.DRIVE_TOUCHES: 16 * (20 + 40 + 16) + 4,
}


def test_what_a_frame_takes_of_a_line():
    info = board_info()
    assert {kind: frame_bytes(info, kind) for kind in BYTES} == BYTES
    both = Stream.RAW | Stream.IMAGE
    assert frame_bytes(info, both) == BYTES[Stream.RAW] + BYTES[Stream.IMAGE]
    assert frame_bytes(info, Stream(0)) == 0


def test_how_many_frames_a_line_carries():
    """1,076 bytes take 103.8 ms of nine tenths of a line of 115,200 baud, a frame 20.8 ms."""
    assert least_every(board_info(), Stream.RAW, 115_200) == 5
    assert least_every(board_info(), Stream.RAW, 2_000_000) == 1
    assert least_every(board_info(model_bytes=0), Stream.RAW, 115_200) == 1


@pytest.mark.parametrize("count", [1, 4, 1024])
def test_frames_of_a_tare(count):
    assert check_tare_frames(count) == count


@pytest.mark.parametrize("count", [0, 2, 3, 1025])
def test_other_counts_are_refused(count):
    with pytest.raises(UsageError, match=f"a tare of {count} frames cannot be; use 1, or 4 to"):
        check_tare_frames(count)


@pytest.mark.parametrize("protocol", [adjacent(8), opposite(16), skip(16, 4)])
def test_usual_protocols_are_known_without_a_model(protocol):
    electrodes, rows = protocol.n_electrodes, protocol.n_rows
    info = board_info(protocol_hash=protocol.hash, n_electrodes=electrodes, n_rows=rows)
    found = scanned_protocol(info, None, "port")
    assert np.array_equal(found.drive_measure, protocol.drive_measure)


def test_another_protocol_needs_the_model():
    with pytest.raises(
        DeviceError, match=r"only the board's model shows .* name its file with  --model FILE"
    ):
        scanned_protocol(board_info(), None, "port")


def test_the_noise_floor_is_that_of_the_samples_phases():
    """Samples of 50 kHz at 1 MHz repeat after 20; less than half a period counts as one phase."""
    floors = {n: board_info(samples=n).noise_floor_v for n in (4, 20, 40, 80)}
    step_v = board_info().volts_per_code_nv * 1e-9
    assert floors[80] == floors[40] == floors[20] == pytest.approx(step_v / np.sqrt(6 * 20))
    assert floors[4] == pytest.approx(step_v / np.sqrt(6))
    assert board_info(slot_us=0).noise_floor_v == 0
