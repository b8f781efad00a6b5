"""Commands over a line that loses, changes and repeats; silence, other versions, other boards."""

import random
import zlib
from dataclasses import replace
from functools import cache
from itertools import count

import pytest
from device_helpers import (
    FRAMES,
    UNTOUCHED,
    Damaging,
    board_info,
    dropping,
    of,
    raw_frames,
    same,
    sim_board,
    sim_device,
    stats_of,
)

from eitskin.device.check import check_board, check_model, host_major, no_answer
from eitskin.device.client import Device, _asked_millihz
from eitskin.device.simulated import SimTransport
from eitskin.device.transport import Capabilities, LinkEvent, Transport
from eitskin.device.wire.codec import LinkCounters, encode
from eitskin.device.wire.link_table import PacketType, Stream
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.device.wire.payloads import pack
from eitskin.errors import DeviceError
from eitskin.model.eitm import decode_model
from small_models import prebuilt, tiny_blob


@cache
def clean_run() -> dict[int, bytes]:
    with sim_device() as device:
        device.tare(UNTOUCHED)
        device.start_scene()
        return {raw.frame: raw.voltage_v.tobytes() for raw in raw_frames(device)}


@pytest.mark.parametrize("seed", range(12))
def test_a_lossy_line_loses_frames_but_nothing_else(seed):
    """Commands get through, no frame is wrong, every loss between two packets that came is
    counted."""
    generator = random.Random(seed)
    transport = SimTransport("lossy", sim_board())
    lossy = Damaging(transport, dropping(generator, 0.2), dropping(generator, 0.2))
    truth, board = clean_run(), transport.board
    try:
        with Device(lossy) as device:
            device.tare(UNTOUCHED)
            device.start_scene()
            items = list(device.stream(Stream.RAW | Stream.TOUCHES))
            counters = device.counters
            device.info()
            missing = counters.missing
    except DeviceError as error:  # three times lost in a row: said, not hung
        said = ("is not answered within", "no packet decodes", "no answer within")
        assert any(words in str(error) for words in said)
        return
    sent = stats_of(board).packets_sent
    raws = of(RawFrame, items)
    assert all(truth[raw.frame] == raw.voltage_v.tobytes() for raw in raws)
    assert [raw.frame for raw in raws] == sorted({raw.frame for raw in raws})
    assert sum(event.missing for event in of(LinkEvent, items) if event.kind == "gap") <= missing
    assert counters.duplicates == counters.stale == 0
    assert counters.packets + missing <= sent
    assert sent - counters.packets - missing <= 3  # lost before the first that came


def test_what_is_lost_at_the_streams_end_does_not_hang_it():
    seen = 0

    def back(data: bytes) -> bytes:
        nonlocal seen
        seen += data.count(b"\0") // 2
        return b"" if 12 < seen < 16 else data

    with Device(Damaging(SimTransport("cut", sim_board()), same, back)) as device:
        assert 8 <= len(raw_frames(device, 12)) < 12
        assert device.counters.missing > 0


def test_the_stream_stops_when_it_is_left():
    with sim_device() as device:
        for item in device.stream(Stream.RAW):
            assert isinstance(item, RawFrame)
            break
        assert device.info().streaming == 0


def test_commands_within_a_stream_lose_no_frame():
    with sim_device() as device:
        device.start_scene()
        frames = []
        for item in device.stream(Stream.RAW):
            assert isinstance(item, RawFrame)
            frames.append(item.frame)
            device.stats()
            device.info()
        assert frames == list(range(FRAMES))


def test_a_board_that_restarts_within_a_stream_is_told_and_goes_on():
    board = sim_board()
    with sim_device(board) as device:
        items = []
        for item in device.stream(Stream.RAW, frames=8):
            items.append(item)
            if len(items) == 3:
                board.restart()  # the watchdog
        counters = device.counters
        assert (counters.restarts, counters.gaps, counters.stale) == (1, 0, 0)
    assert [event.kind for event in of(LinkEvent, items)] == ["restarted"]
    assert len(of(RawFrame, items)) == 8


def test_a_restart_loses_the_reference_and_says_so():
    board = sim_board()
    said = "restarted and has no reference frame; leave the skin untouched"
    with sim_device(board) as device, pytest.raises(DeviceError, match=said):
        device.tare(UNTOUCHED)
        device.start_scene()
        for item in device.stream(Stream.TOUCHES):
            if isinstance(item, SolvedTouches):
                board.restart()


class Scripted(Transport):
    """A port with scripted answers: ``answers`` returns the bytes to read for the bytes written."""

    url = name = "serial:/dev/scripted"
    capabilities = Capabilities(own_clock=True, baud=115200)

    def __init__(self, *pieces: bytes) -> None:
        self.pieces = list(pieces)
        self.closed = False

    def read(self, timeout_s: float) -> bytes:
        return self.pieces.pop(0) if self.pieces else b""

    def write(self, data: bytes) -> None:
        pass

    def reopen(self) -> bool:
        return False

    def close(self) -> None:
        self.closed = True


def of_version(version: int) -> bytes:
    """A packet of another version of the link protocol."""
    head = bytes([version, 1, 0, 0, 1, 1, 1, 1])
    plain = head + zlib.crc32(head).to_bytes(4, "little")
    blocks = plain.split(b"\0")  # each stuffed with its length
    return b"\0" + b"".join(bytes([len(one) + 1]) + one for one in blocks) + b"\0"


MAJORS = [host_major() + 1, host_major() + 7]


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        ([], r"no answer within 3 s; is this the board's port, and its firmware running\? flash"),
        ([random.Random(1).randbytes(400)],
         r"400 bytes arrive but no packet decodes at 115200 baud: .*serial:PORT\?baud=N"),
        ([encode(PacketType.FAULT, k, bytes(36)) for k in range(5)],
         "packets arrive, but GET_INFO is not answered within 3 s; reset the board"),
        ([of_version(7)],
         "speaks version 7 of the link protocol and this eitskin 6; upgrade eitskin, or flash"),
        ([of_version(1)],
         "version 1 of the link protocol and this eitskin 6; flash this version's firmware"),
        *(
            ([encode(PacketType.INFO, 0, pack(board_info(firmware=(major, 0, 3))))],
             rf"firmware is {major}\.0\.3 and this eitskin is .*; install eitskin {major}\.x, or f")
            for major in MAJORS
        ),
    ],
    ids=["silence", "another baud rate", "no answer", "a newer link", "an older link",
         *(f"firmware {major}" for major in MAJORS)],
)  # fmt: skip
def test_what_no_board_of_this_version_says_is_refused_and_the_port_let_go(sent, said):
    port = Scripted(*sent)
    with pytest.raises(DeviceError, match=said):
        Device(port)
    assert port.closed


def test_an_older_firmware_is_refused(monkeypatch):
    monkeypatch.setattr("eitskin.device.check.__version__", "3.2.1")
    said = r"firmware is 0\.1\.0 and this eitskin is 3\.2\.1; flash this version's firmware"
    with pytest.raises(DeviceError, match=said):
        check_board(board_info(), "COM1")


def test_a_board_that_talks_for_ever_without_answering_is_given_up():
    port, numbers = Scripted(), count()
    port.read = lambda timeout_s: encode(PacketType.FAULT, next(numbers), bytes(36))
    with pytest.raises(DeviceError, match="is not answered"):
        Device(port)


def test_another_model_is_refused_with_what_to_do():
    model, blob = prebuilt()
    info = board_info(protocol_hash=model.protocol.hash, model_crc=zlib.crc32(blob))
    check_model(info, model, blob, "x")
    tiny, own = (decode_model(tiny_blob(), "tiny"), tiny_blob()), (model, blob)
    protocol = r"scans adjacent \(protocol [0-9a-f]{16}, 16 electrodes, 208 rows\) and the model"
    for board, given, said in (
        (replace(info, model_crc=1), own, "model upload FILE  or name the board's with  --model"),
        (info, tiny, protocol),
        (replace(info, model_bytes=0), own, "the board has no model"),
    ):
        with pytest.raises(DeviceError, match=said):
            check_model(board, *given, "x")


def test_malformed_payloads_are_counted_and_passed_over():
    packets = [
        (PacketType.INFO, pack(board_info(request=1))),
        (PacketType.RAW, b"no raw frame"),
        (PacketType.TOUCHES, bytes(67)),
        (0x60, b"of the future"),
        (PacketType.INFO, pack(board_info(request=2))),
    ]
    wire = [encode(kind, k, body) for k, (kind, body) in enumerate(packets)]
    with Device(Scripted(*wire)) as device:
        assert device.info().request == 2
        assert (device.counters.malformed, device.counters.gaps) == (2, 0)


def test_a_stalled_instrument_is_not_told_to_reset_a_board():
    port = Scripted(encode(PacketType.INFO, 0, pack(board_info(request=1))))
    port.capabilities = Capabilities(own_clock=True, instrument=True)
    with Device(port) as device:
        said = no_answer(device.link, LinkCounters(), "TARE", 3.0)
    assert "TARE is not answered within 3 s, as the instrument sends too few frames" in said
    assert "cable and power" in said and "reset" not in said and "flash" not in said


def test_an_excitation_that_the_generator_rounds_stays_what_was_asked():
    """INFO tells 50000.012 Hz; sent back like that it would be no whole number of periods."""
    slow = {"excitation_millihz": 1003, "sample_rate_hz": 1000, "samples": 1000}
    assert _asked_millihz(board_info()) == 50_000_000
    assert _asked_millihz(board_info(excitation_millihz=9_999_990, samples=100)) == 10_000_000
    assert _asked_millihz(board_info(**slow)) == 1000
