"""The codec through cffi: sent packets arrive, damaged ones do not, and every byte is counted."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import LINK_MAX_PAYLOAD, PacketType
from eitskin.errors import DeviceError


def packets_of(wire: bytes, decoder: Decoder | None = None) -> list[Packet]:
    return (decoder or Decoder()).feed(wire)


@given(
    st.integers(0, 255).filter(lambda t: t != PacketType.RECORDING),
    st.integers(0, 2**32 - 1),
    st.binary(max_size=1000),
)
def test_round_trip(packet_type, sequence, payload):
    wire = encode(packet_type, sequence, payload)
    assert wire[0] == wire[-1] == 0
    assert 0 not in wire[1:-1]
    assert packets_of(wire) == [Packet(packet_type, sequence, payload)]


@pytest.mark.parametrize(
    "size", [0, 1, 241, 242, 243, 253, 254, 255, 508, 1000, LINK_MAX_PAYLOAD - 1, LINK_MAX_PAYLOAD]
)
@pytest.mark.parametrize("fill", [0, 1, 255])
def test_sizes_at_the_edges(size, fill):
    payload = bytes([fill]) * size
    assert packets_of(encode(1, 1, payload)) == [Packet(1, 1, payload)]


def test_too_long_a_payload_is_refused():
    with pytest.raises(DeviceError, match="cannot carry 16385 bytes; the most is 16384"):
        encode(1, 1, bytes(LINK_MAX_PAYLOAD + 1))


ORIGINALS = [
    (k % 200 + 1, k, bytes((k * 37 + i * i) % 256 for i in range(k % 90))) for k in range(40)
]
WIRE = b"".join(encode(*one) for one in ORIGINALS)


@st.composite
def damaged_wires(draw: st.DrawFn) -> bytes:
    """The wire with bytes changed, removed, put in, and pieces doubled or moved."""
    wire = bytearray(WIRE)
    for _ in range(draw(st.integers(0, 12))):
        place = draw(st.integers(0, len(wire) - 1))
        kind = draw(st.sampled_from(["change", "remove", "insert", "double", "move"]))
        if kind == "change":
            wire[place] ^= draw(st.integers(1, 255))
        elif kind == "remove":
            del wire[place : place + draw(st.integers(1, 30))]
        elif kind == "insert":
            wire[place:place] = draw(st.binary(min_size=1, max_size=30))
        else:
            piece = bytes(wire[place : place + draw(st.integers(1, 300))])
            if kind == "move":
                del wire[place : place + len(piece)]
            other = draw(st.integers(0, len(wire)))
            wire[other:other] = piece
        if len(wire) < 10:
            break
    return bytes(wire)


@settings(max_examples=300, deadline=None)
@given(damaged_wires(), st.lists(st.integers(1, 700), min_size=1, max_size=8))
def test_a_link_under_fire_takes_only_what_was_sent_and_in_order(wire, cuts):
    decoder, found, place = Decoder(), [], 0
    k = 0
    while place < len(wire):
        cut = cuts[k % len(cuts)]
        found += decoder.feed(wire[place : place + cut])
        place, k = place + cut, k + 1
    sent = {sequence: (packet_type, payload) for packet_type, sequence, payload in ORIGINALS}
    assert all(sent[p.sequence] == (p.type, p.payload) for p in found)  # no wrong packet, ever
    counters = decoder.counters
    if counters.restarts == 0:
        numbers = [p.sequence for p in found]
        assert numbers == sorted(set(numbers))
        if numbers:  # every gap is counted
            assert (
                sum(p.lost for p in found)
                == counters.missing
                == numbers[-1] - numbers[0] + 1 - len(numbers)
            )
    assert counters.packets == len(found)
    assert counters.bytes == len(wire)
    decoder.feed(b"\0")
    tail = encode(77, 5000, b"after all that")  # and it has not lost its way
    last = decoder.feed(tail)
    assert [p.payload for p in last] == [b"after all that"]


@given(st.binary(max_size=3000))
def test_garbage_is_no_packet(garbage):
    decoder = Decoder()
    assert decoder.feed(garbage) == []
    assert decoder.counters.packets == 0


def test_a_port_opened_in_the_middle_of_a_packet():
    first, second = encode(1, 1, b"half of this is gone"), encode(1, 2, b"whole")
    decoder = Decoder()
    assert [p.payload for p in decoder.feed(first[5:] + second)] == [b"whole"]
    assert decoder.counters.skipped_bytes == len(first) - 6
    found = decoder.counters.crc_errors, decoder.counters.framing_errors, decoder.counters.gaps
    assert found == (0, 0, 0)


def test_what_was_half_received_before_a_cut_is_no_error():
    decoder = Decoder()
    decoder.feed(encode(1, 1, b"a") + encode(1, 2, b"b")[:-4])
    decoder.link_lost()
    found = decoder.feed(encode(1, 5, b"c"))
    assert [(p.payload, p.lost) for p in found] == [(b"c", 3)]
    assert decoder.counters.framing_errors == decoder.counters.crc_errors == 0
    assert decoder.counters.gaps == 1
