"""Any bytes on a line or as a recording: packets or counted, never an exception; pieces do not
matter."""

from dataclasses import fields

import numpy as np
from bytes_damage import any_bytes, bounded, read_or_refuse, written
from hypothesis import given
from hypothesis import strategies as st

from eitskin.device.recordings.recording import read_head, recorded_options
from eitskin.device.wire.codec import Decoder, encode
from eitskin.device.wire.explain import fault_text, quality_text, reply_text
from eitskin.device.wire.link_table import PacketType
from eitskin.device.wire.packets import (
    BoardInfo,
    Fault,
    RawFrame,
    Reply,
    Solved,
    SolvedImage,
    SolvedTouches,
)
from eitskin.device.wire.payloads import MalformedPacket, pack, parse
from eitskin.session.checks.raw_frames import frames_of
from eitskin.skin.protocol import adjacent
from made_payloads import build_image, build_raw, build_touches

ROWS = 40
PROTOCOL = adjacent(8)


def board() -> BoardInfo:
    text = {"board": "fake", "serial": "1", "name": "left"}
    values = {one.name: 1 for one in fields(BoardInfo)} | text | {"firmware": (0, 1, 0)}
    hashed = {
        "n_electrodes": 8, "n_rows": ROWS, "protocol_hash": PROTOCOL.hash, "electrodes": 16,
        "model_bytes": 0,
    }  # fmt: skip
    return BoardInfo(**{**values, **hashed})


def raw(frame: int, flags: int) -> bytes:
    volts = (1 + 0.01 * np.sin(np.arange(ROWS) * (frame + 1))).astype("<f4")
    return build_raw(
        RawFrame(frame, 1000 * frame, 900, flags, volts, np.zeros(ROWS, dtype=np.uint8))
    )


def solved(count: int) -> Solved:
    return Solved(
        1, 2, 3, 4, 5, count, 0, "iterations", "solver", 0, 6, 7, 8, 9, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3
    )


PAYLOADS = [
    (PacketType.INFO, pack(board())),
    (PacketType.REPLY, pack(Reply(1, 0x82, 3, (4, 5)))),
    (PacketType.RAW, raw(1, 0)),
    (PacketType.IMAGE, build_image(SolvedImage(solved(3), np.ones(3, dtype=np.float32)))),
    (PacketType.TOUCHES, build_touches(SolvedTouches(solved(0), ()))),
    (PacketType.FAULT, pack(Fault(8, True, 1, 2, 3, (1, 2, 3, 4, 5)))),
]


def recording(notes: tuple[bytes, ...] = ()) -> bytes:
    head = b'{"format": "eits", "version": 1, "eitskin": "0", "url": "sim:x", "model_crc": "0"}'
    solver = b'{"solver": {"iterations": 5, "warm_start": true}}'
    data = encode(PacketType.RECORDING, 0, head) + encode(PacketType.RECORDING, 0, solver)
    data += b"".join(encode(PacketType.RECORDING, 0, note) for note in notes)
    data += encode(PacketType.INFO, 0, PAYLOADS[0][1])
    return data + b"".join(encode(PacketType.RAW, 1 + k, raw(k, int(k < 4))) for k in range(7))


WIRE = b"".join(encode(kind, k, payload) for k, (kind, payload) in enumerate(PAYLOADS))
WIRES = [WIRE, recording()]


def pieces(content: bytes, size: int) -> list[bytes]:
    return [content[at : at + size] for at in range(0, len(content), size)]


@given(content=any_bytes(WIRES), size=st.integers(1, 700))
@bounded(150)
def test_any_line_gives_packets_whatever_the_pieces(content, size):
    whole, cut = Decoder(), Decoder()
    packets = whole.feed(content)
    assert [packet for piece in pieces(content, size) for packet in cut.feed(piece)] == packets
    assert cut.counters == whole.counters
    for packet in packets:
        again = Decoder().feed(encode(packet.type, packet.sequence, packet.payload))
        assert [(one.type, one.sequence, one.payload) for one in again] == [
            (packet.type, packet.sequence, packet.payload)
        ]


KINDS = [kind for kind, _ in PAYLOADS] + [PacketType.STATS, 0x55]


@given(kind=st.sampled_from(KINDS), payload=any_bytes([one for _, one in PAYLOADS]))
@bounded(250)
def test_any_payload_is_of_its_type_or_malformed(kind, payload):
    try:
        content = parse(kind, payload)
    except MalformedPacket as error:
        assert "\n" not in str(error)
        return
    texts = [""]
    if isinstance(content, Reply):
        texts = [reply_text(content)]
    elif isinstance(content, Fault):
        texts = [fault_text(content)]
    elif isinstance(content, RawFrame):
        texts = [quality_text(int(one)) for one in content.quality]
    elif isinstance(content, BoardInfo):
        texts = [str(content.as_dict()), content.firmware_text]
    assert all("\n" not in text for text in texts)


def resealed(notes: list[bytes]) -> bytes:
    return recording(tuple(notes))


NOTES = [
    b'{"solver": {"iterations": 7}}',
    b'{"solver": {"lambda_rel": 0.1, "sign": "both"}}',
    b'{"other": [1, 2]}',
    b'{"solver": 3}',
]


@given(
    content=st.one_of(
        any_bytes([recording()]), st.lists(any_bytes(NOTES), max_size=2).map(resealed)
    )
)
@bounded(200)
def test_any_recording_is_read_or_refused_in_a_line(tmp_path, content):
    path = written(tmp_path, "x.eits", content)
    head = read_or_refuse(read_head, path)
    options = read_or_refuse(recorded_options, path)
    frames = read_or_refuse(frames_of, path)
    if head is None:
        assert options is None and frames is None
    if frames is not None:
        assert frames.voltage_v.shape[1] == ROWS


HEADS = [
    b'{"format": "eits", "version": 1}',
    b'{"format": "eits", "version": true}',
    b'{"format": "eits", "version": 99999}',
    b"[" * 3000,
]


@given(head=any_bytes(HEADS))
@bounded(100)
def test_any_head_of_a_recording(tmp_path, head):
    path = written(tmp_path, "x.eits", encode(PacketType.RECORDING, 0, head))
    read_or_refuse(read_head, path)
