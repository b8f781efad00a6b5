"""Payloads: their layouts are the C structs', their enums the header's, and what is built is read
back."""

import math
import re
import struct

import numpy as np
import pytest
from device_helpers import board_info
from hypothesis import given
from hypothesis import strategies as st

from eitskin.core import _core_f32 as core
from eitskin.core.diagnostics_table import Touch
from eitskin.device.wire import link_table as link
from eitskin.device.wire import packets as pk
from eitskin.device.wire import payloads as pl
from eitskin.device.wire.layout import Command, Payload
from made_payloads import build_image, build_raw, build_touches

LAYOUTS = {
    kind.LAYOUT.name: kind.LAYOUT
    for base in (Payload, Command)
    for kind in base.__subclasses__()
    if hasattr(kind, "LAYOUT")
}
PLACES = {"B": 1, "c": 1, "s": 1, "H": 2, "I": 4, "i": 4, "f": 4, "Q": 8}


def places(layout: struct.Struct) -> list[tuple[int, int]]:
    """(offset, size) of each value of a format, counted by hand; strings are one value."""
    found, offset = [], 0
    for count, letter in re.findall(r"(\d*)([A-Za-z])", layout.format):
        sizes = [int(count)] if letter == "s" else [PLACES[letter]] * int(count or 1)
        for size in sizes:
            found.append((offset, size))
            offset += size
    return found


def c_places(name: str) -> list[tuple[int, int]]:
    """The same of a C struct, arrays of numbers element by element, strings and firmware whole,
    structs field by field."""
    found = []
    for field, info in core.ffi.typeof(name).fields:
        kind = info.type
        if kind.kind == "array" and kind.item.kind == "struct":
            inner = c_places(kind.item.cname)
            size = core.ffi.sizeof(kind.item)
            found += [
                (info.offset + k * size + at, width)
                for k in range(kind.length)
                for at, width in inner
            ]
        elif kind.kind == "array" and core.ffi.sizeof(kind.item) > 1:
            size = core.ffi.sizeof(kind.item)
            found += [(info.offset + k * size, size) for k in range(kind.length)]
        else:
            found.append((info.offset, core.ffi.sizeof(kind)))
        assert field
    return found


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_are_the_c_structs(name):
    assert LAYOUTS[name].size == core.ffi.sizeof(name)
    assert places(LAYOUTS[name].struct) == c_places(name)


def test_every_payload_of_the_header_has_a_layout():
    beginnings = ("eits_packet_", "eits_command_", "eits_stage_stats")
    structs = {name for name in core.ffi.list_types()[0] if name.startswith(beginnings)}
    assert structs - {"eits_packet_type"} == set(LAYOUTS)


@pytest.mark.parametrize("name", LAYOUTS)
def test_fields_are_named_in_the_structs_order(name):
    in_c = [{"lambda": "lambda_", "stage": "stages"}.get(field, field) for field, _ in
            core.ffi.typeof(name).fields]  # fmt: skip
    assert [field for field, _, _ in LAYOUTS[name].fields] == in_c


@pytest.mark.parametrize(
    ("enum", "name", "prefix"),
    [
        (link.PacketType, "eits_packet_type", "EITS_PACKET_"),
        (link.ReplyStatus, "eits_reply_status", "EITS_REPLY_"),
        (link.FaultCode, "eits_fault", "EITS_FAULT_"),
        (link.Quality, "eits_quality", "EITS_QUALITY_"),
        (link.RawFlags, "eits_raw_flags", "EITS_RAW_"),
        (link.Stream, "eits_stream", "EITS_STREAM_"),
    ],
)
def test_enums_are_the_headers(enum, name, prefix):
    in_c = {
        member.removeprefix(prefix): value
        for member, value in core.ffi.typeof(name).relements.items()
    }
    assert {member.name: int(member) for member in enum} == in_c


def test_stages_and_limits_are_the_headers():
    lib = core.lib
    for name in (
        "LINK_VERSION",
        "LINK_MAX_PAYLOAD",
        "FAULT_RAISE_FRAMES",
        "FAULT_CLEAR_FRAMES",
        "NAME_CHARACTERS",
    ):
        assert getattr(link, name) == getattr(lib, f"EITS_{name}")
    assert len(link.STAGES) == lib.EITS_STAGES
    number = core.ffi.typeof("eits_stage").relements
    assert [number[f"EITS_STAGE_{name.upper()}"] for name in link.STAGES] == [*range(len(number))]


def test_a_command_is_known_by_its_type():
    assert {kind.TYPE for kind in Command.KNOWN.values()} == {
        kind for kind in link.PacketType if kind >= 0x80
    }


def test_info_is_read_as_it_was_built():
    info = board_info(firmware=(1, 2, 255), faults=0b10100, board="x" * 15, serial="A" * 24)
    payload = pl.pack(info)
    c = core.ffi.from_buffer("eits_packet_info *", bytearray(payload))
    found = c.protocol_hash, c.volts_per_code_nv, list(c.firmware)
    assert found == (2**63 + 5, 805664, [1, 2, 255, 0])
    assert pl.parse(link.PacketType.INFO, payload) == info
    assert info.fault_codes == (link.FaultCode.ELECTRODE_OPEN, link.FaultCode.DEADLINE)
    assert info.firmware_text == "1.2.255"
    assert info.frame_us == 20800
    assert board_info(check_every=0).frame_us == 10400
    assert board_info(frame_period_us=50000).frame_us == 50000


def test_info_grows_at_its_end():
    """An older board has no name and does not know its source; a newer one sends more."""
    payload = pl.pack(board_info())
    older = pl.parse(link.PacketType.INFO, payload[: pl.OLDEST_INFO_BYTES])
    assert older == board_info(name="", source_ua=0, gain_ppm=0)
    assert pl.parse(link.PacketType.INFO, payload + b"more") == board_info()


words = st.integers(0, 2**32 - 1)
halves = st.integers(0, 2**16 - 1)


@given(
    st.lists(st.tuples(st.floats(width=32), st.integers(0, 255)), max_size=300),
    words,
    words,
    words,
    halves,
)
def test_raw_frames_are_read_bit_for_bit(rows, frame, time, scan, flags):
    volts = np.array([v for v, _ in rows], dtype=np.float32)
    quality = np.array([q for _, q in rows], dtype=np.uint8)
    again = pl.parse(
        link.PacketType.RAW, build_raw(pk.RawFrame(frame, time, scan, flags, volts, quality))
    )
    assert isinstance(again, pk.RawFrame)
    assert (again.frame, again.time_us, again.scan_us, again.flags) == (frame, time, scan, flags)
    assert again.voltage_v.tobytes() == volts.tobytes()
    assert again.quality.tobytes() == quality.tobytes()


def solved(count: int, status: int = 0) -> pk.Solved:
    return pk.Solved(7, 8, 9, 10, 11, count, status, "gap", "touches", 3, 20, 40, 1234, 56, 0.5,
        1.5, 0.25, 0.125, 2.0, 4.0,
                     0b10111111, 3, 2, 0.375, (5, 63), (0, 1), (7,))  # fmt: skip


@pytest.mark.parametrize("extra", [-1, 1, 4])
def test_a_payload_of_another_length_is_refused(extra):
    whole = {
        link.PacketType.INFO: pl.pack(board_info())[: pl.OLDEST_INFO_BYTES + min(extra, 0)],
        link.PacketType.REPLY: pl.pack(pk.Reply(1, 2, 3)),
        link.PacketType.RAW: build_raw(
            pk.RawFrame(1, 2, 3, 0, np.zeros(4, np.float32), np.zeros(4, np.uint8))
        ),
        link.PacketType.IMAGE: build_image(pk.SolvedImage(solved(3), np.zeros(3, np.float32))),
        link.PacketType.TOUCHES: build_touches(
            pk.SolvedTouches(solved(1), (Touch(1, 1, 1, 1, 1, 1),))
        ),
        link.PacketType.FAULT: pl.pack(pk.Fault(1, True, 1, 1, 1)),
    }
    if extra > 0:
        del whole[link.PacketType.INFO]  # it may grow
    for kind, payload in whole.items():
        with pytest.raises(pl.MalformedPacket):
            pl.parse(kind, payload[:extra] if extra < 0 else payload + bytes(extra))


def test_touches_of_a_board_that_does_not_tell_deviations_of_radii_are_read():
    each = [Touch(k, 1.5, 2.5, 8.0, 3.0, 0.5, radius_sd_mm=0.25) for k in (1, 2)]
    today = build_touches(pk.SolvedTouches(solved(2), tuple(each)))
    old = pl.pack(solved(2)) + b"".join(
        today[start : start + pl.OLDEST_TOUCH_BYTES]
        for start in range(len(pl.pack(solved(2))), len(today), link.TouchPacket.LAYOUT.size)
    )
    kind = link.PacketType.TOUCHES
    older, newer = pl.parse(kind, old), pl.parse(kind, today)
    assert [touch.id for touch in older.touches] == [touch.id for touch in newer.touches] == [1, 2]
    assert [touch.radius_mm for touch in older.touches] == [8.0, 8.0]
    assert all(touch.confirmed for touch in older.touches)
    assert [touch.radius_sd_mm for touch in older.touches] == [None, None]


@given(words, halves, halves, words)
def test_a_command_lies_as_its_layout_says(request, what, every, frames):
    command = link.StreamCommand(what, every, frames)
    read = command.LAYOUT.struct.unpack(command.payload(request))
    assert read == (request, what, every, frames)
    data = link.ModelData(frames, bytes(every % 50)).payload(request)
    assert link.ModelData.LAYOUT.struct.unpack_from(data) == (request, frames)
    assert data[link.ModelData.LAYOUT.size :] == bytes(every % 50)


def test_floats_of_a_command_are_single():
    command = link.Solver(10, 3, 1, 0, 0.03, 1e-4, 3, 10**9, 37)
    request, *values = command.LAYOUT.struct.unpack(command.payload(5))
    assert (request, values[0]) == (5, 10)
    assert math.isclose(values[4], 0.03, rel_tol=1e-7)
