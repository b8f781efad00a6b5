"""Commands over a line that loses, changes and repeats; silence, other versions, other boards."""

import random
from dataclasses import replace

import pytest
from device_helpers import FRAMES, QUIET, Damaging, board_info, dropping, same, sim_board, stats_of

from eitskin.device.check import check_board, check_model, host_major
from eitskin.device.client import Device
from eitskin.device.link import LinkEvent
from eitskin.device.simulated import SimTransport
from eitskin.device.wire.codec import encode
from eitskin.device.wire.link_table import PacketType, Stream
from eitskin.device.wire.packets import RawFrame, SolvedTouches
from eitskin.device.wire.payloads import pack
from eitskin.errors import DeviceError
from eitskin.model.eitm import decode_model
from small_models import prebuilt, tiny_blob


def clean_run() -> dict[int, bytes]:
    with Device(SimTransport("clean", sim_board())) as device:
        device.tare(QUIET)
        device.start_scene()
        return {
            item.frame: item.voltage_v.tobytes()
            for item in device.stream(Stream.RAW)
            if isinstance(item, RawFrame)
        }


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
            device.tare(QUIET)
            device.start_scene()
            items = list(device.stream(Stream.RAW | Stream.TOUCHES))
            counters = device.counters
            device.info()
            missing = counters.missing
    except DeviceError as error:
        # three times lost in a row: said, not hung
        assert any(
            words in str(error)
            for words in ("is not answered within", "no packet decodes", "no answer within")
        )
        return
    sent = stats_of(board).packets_sent
    raws = [item for item in items if isinstance(item, RawFrame)]
    assert all(truth[raw.frame] == raw.voltage_v.tobytes() for raw in raws)
    assert [raw.frame for raw in raws] == sorted({raw.frame for raw in raws})
    events = sum(
        item.missing for item in items if isinstance(item, LinkEvent) and item.kind == "gap"
    )
    assert events <= missing
    assert counters.duplicates == counters.stale == 0
    assert counters.packets + missing <= sent
    assert sent - counters.packets - missing <= 3  # lost before the first that came


def test_what_is_lost_at_the_streams_end_does_not_hang_it():
    transport = SimTransport("cut", sim_board())
    seen = 0

    def back(data: bytes) -> bytes:
        nonlocal seen
        seen += data.count(b"\0") // 2
        return b"" if 12 < seen < 16 else data

    with Device(Damaging(transport, same, back)) as device:
        items = list(device.stream(Stream.RAW, frames=12))
        assert device.counters.missing > 0
    raws = [item for item in items if isinstance(item, RawFrame)]
    assert 8 <= len(raws) < 12


def test_the_stream_stops_when_it_is_left():
    board = sim_board()
    with Device(SimTransport("left", board)) as device:
        for item in device.stream(Stream.RAW):
            assert isinstance(item, RawFrame)
            break
        assert device.info().streaming == 0


def test_commands_within_a_stream_lose_no_frame():
    with Device(SimTransport("within", sim_board())) as device:
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
    with Device(SimTransport("restarts", board)) as device:
        items = []
        for item in device.stream(Stream.RAW, frames=8):
            items.append(item)
            if len(items) == 3:
                board.restart()  # the watchdog
        assert device.counters.restarts == 1
        assert device.counters.gaps == device.counters.stale == 0
    assert [item.kind for item in items if isinstance(item, LinkEvent)] == ["restarted"]
    assert len([item for item in items if isinstance(item, RawFrame)]) == 8


def test_a_restart_loses_the_reference_and_says_so():
    board = sim_board()
    with Device(SimTransport("restarts", board)) as device:
        device.tare(QUIET)
        device.start_scene()
        with pytest.raises(
            DeviceError, match="restarted and has no reference frame; leave the skin untouched"
        ):
            for item in device.stream(Stream.TOUCHES):
                if isinstance(item, SolvedTouches):
                    board.restart()


class Scripted:
    """A port that says what it is told to; ``answers`` turns what is written into what is read."""

    url = name = "serial:/dev/scripted"
    synchronous = True
    replays = ended = False
    baud = 115200

    def __init__(self, *pieces: bytes) -> None:
        self.pieces = list(pieces)
        self.closed = False

    def read(self, timeout_s: float) -> bytes:
        return self.pieces.pop(0) if self.pieces else b""

    def write(self, data: bytes) -> None:
        pass

    def reopen(self) -> bool:
        return False

    def begin_scene(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True


def test_silence_is_said_and_the_port_let_go():
    port = Scripted()
    with pytest.raises(
        DeviceError,
        match=r"no answer within 3 s; is this the board's port, and its firmware running\? flash",
    ):
        Device(port)
    assert port.closed


def test_bytes_that_are_no_packets_are_another_baud_rate():
    with pytest.raises(
        DeviceError,
        match=r"400 bytes arrive but no packet decodes at 115200 baud: .*serial:PORT\?baud=N",
    ):
        Device(Scripted(bytes(random.Random(1).randrange(256) for _ in range(400))))


def test_packets_without_an_answer_are_told_apart():
    chatter = [encode(PacketType.FAULT, k, bytes(36)) for k in range(5)]
    with pytest.raises(
        DeviceError,
        match=r"packets arrive, but GET_INFO is not answered within 3 s; reset the board",
    ):
        Device(Scripted(*chatter))


def test_a_board_that_talks_for_ever_without_answering_is_given_up():
    port = Scripted()
    numbers = iter(range(10**6))
    port.read = lambda timeout_s: encode(PacketType.FAULT, next(numbers), bytes(36))
    with pytest.raises(DeviceError, match="is not answered"):
        Device(port)


@pytest.mark.parametrize(
    ("version", "advice"), [(7, "upgrade eitskin, or flash"), (1, "flash this version's firmware")]
)
def test_another_link_version_is_refused_with_what_to_do(version, advice):
    import zlib

    head = bytes([version, 1, 0, 0, 1, 1, 1, 1])
    plain = head + zlib.crc32(head).to_bytes(4, "little")
    wire, block = bytearray(b"\0"), bytearray()
    for byte in plain + b"\0":
        if byte:
            block.append(byte)
        else:
            wire += bytes([len(block) + 1]) + block
            block.clear()
    with pytest.raises(
        DeviceError,
        match=f"speaks version {version} of the link protocol and this eitskin 6; {advice}",
    ):
        Device(Scripted(bytes(wire) + b"\0"))


@pytest.mark.parametrize("major", [host_major() + 1, host_major() + 7])
def test_another_firmware_version_is_refused_with_what_to_do(major):
    newer = encode(PacketType.INFO, 0, pack(board_info(firmware=(major, 0, 3))))
    with pytest.raises(
        DeviceError,
        match=(
            rf"firmware is {major}\.0\.3 and this eitskin is .*; install eitskin {major}\.x, or f"
        ),
    ):
        Device(Scripted(newer))


def test_an_older_firmware_is_refused(monkeypatch):
    monkeypatch.setattr("eitskin.device.check.__version__", "3.2.1")
    with pytest.raises(
        DeviceError,
        match=r"firmware is 0\.1\.0 and this eitskin is 3\.2\.1; flash this version's firmware",
    ):
        check_board(board_info(), "COM1")


def test_another_model_is_refused_with_what_to_do():
    model, blob = prebuilt()
    import zlib

    info = board_info(protocol_hash=model.protocol.hash, model_crc=zlib.crc32(blob))
    check_model(info, model, blob, "x")
    with pytest.raises(
        DeviceError, match="model upload FILE  or name the board's with  --model FILE"
    ):
        check_model(replace(info, model_crc=1), model, blob, "x")
    tiny = decode_model(tiny_blob(), "tiny")
    with pytest.raises(
        DeviceError,
        match=r"scans protocol [0-9a-f]{16} \(16 electrodes, 208 rows\) and the model here",
    ):
        check_model(info, tiny, tiny_blob(), "x")
    with pytest.raises(DeviceError, match="the board has no model"):
        check_model(replace(info, model_bytes=0), model, blob, "x")


def test_malformed_payloads_are_counted_and_passed_over():
    packets = [
        (PacketType.INFO, pack(board_info(request=1))),
        (PacketType.RAW, b"no raw frame"),
        (PacketType.TOUCHES, bytes(67)),
        (0x60, b"of the future"),
        (PacketType.INFO, pack(board_info(request=2))),
    ]
    with Device(
        Scripted(*(encode(kind, k, body) for k, (kind, body) in enumerate(packets)))
    ) as device:
        assert device.info().request == 2
        assert device.counters.malformed == 2
        assert device.counters.gaps == 0


def test_an_excitation_that_the_generator_rounds_stays_what_was_asked():
    """INFO tells 50000.012 Hz; sent back like that it would be no whole number of periods."""
    from eitskin.device.client import _asked_millihz

    assert _asked_millihz(board_info()) == 50_000_000
    assert _asked_millihz(board_info(excitation_millihz=9_999_990, samples=100)) == 10_000_000
    found = _asked_millihz(board_info(excitation_millihz=1003, sample_rate_hz=1000, samples=1000))
    assert found == 1000
