"""docs/reference/link-protocol.md says what the code does: sizes, offsets, numbers, the worked
example."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import pytest

from eitskin.core import _core_f32 as core
from eitskin.device.wire import packets as pk
from eitskin.device.wire.codec import encode
from eitskin.device.wire.commands import COMMANDS, ModelData

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "link-protocol.md").read_text(
    encoding="utf-8"
)


def section(title: str) -> str:
    """From a heading that begins with ``title`` to the next heading."""
    match = re.search(rf"^#+ {re.escape(title)}.*?$(.*?)(?=^#+ |\Z)", PAGE, flags=re.M | re.S)
    assert match, title
    return match.group(0)


def rows(text: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    ]


def offsets(text: str) -> list[int]:
    """The offsets of the byte tables in ``text``."""
    fields = re.findall(r"^ *(\d+)  (?:u8|u16|u32|u64|i32|f32|char)\b", text, flags=re.M)
    return [int(offset) for offset in fields]


@pytest.mark.parametrize(
    ("title", "struct", "size"),
    [
        ("INFO", "eits_packet_info", 152),
        ("REPLY", "eits_packet_reply", 16),
        ("RAW", "eits_packet_raw", 16),
        ("IMAGE", "eits_packet_solved", 104),
        ("STATS", "eits_packet_stats", 164),
        ("FAULT", "eits_packet_fault", 36),
    ],
)
def test_offsets_are_the_structs(title: str, struct: str, size: int) -> None:
    text = section(title)
    assert f"### {title}, {size}" in text
    assert core.ffi.sizeof(struct) == size
    in_c = {info.offset for _, info in core.ffi.typeof(struct).fields}
    stated = offsets(text)
    beyond = [offset for offset in stated if offset >= size]
    assert set(stated) - set(beyond) <= in_c
    assert len(set(stated)) == len(stated)
    if struct not in (
        "eits_packet_stats",
        "eits_packet_raw",
    ):  # the first says some in one row, the second has rows behind it
        assert set(stated) == in_c


def test_types_statuses_and_faults_are_the_enums() -> None:
    types = {
        row[1]: int(row[0], 16) for row in rows(section("Packet types")) if row[0].startswith("0x")
    }
    assert types == {kind.name: int(kind) for kind in pk.PacketType}
    statuses = {
        row[1]: int(row[0])
        for row in rows(section("REPLY"))
        if row[1] in pk.ReplyStatus.__members__
    }
    assert statuses == {kind.name: int(kind) for kind in pk.ReplyStatus}
    faults = {
        row[1]: int(row[0]) for row in rows(section("FAULT")) if row[1] in pk.FaultCode.__members__
    }
    assert faults == {kind.name: int(kind) for kind in pk.FaultCode}


def test_commands_are_as_long_as_stated() -> None:
    stated = {
        row[0]: row[1] for row in rows(section("Commands")) if row[0] in pk.PacketType.__members__
    }
    assert stated.keys() == {kind.TYPE.name for kind in COMMANDS.values()}
    for kind in COMMANDS.values():
        size = kind.LAYOUT.size
        assert stated[kind.TYPE.name] == (f"{size} + k" if kind is ModelData else str(size))


def test_the_worked_example() -> None:
    match = re.search(r"^wire +((?:[0-9a-f]{2} ?)+)$", PAGE, flags=re.M)
    assert match
    assert encode(0x80, 7, bytes([1, 2, 0, 3])) == bytes.fromhex(match.group(1))
    head = re.search(
        r"^head +((?:[0-9a-f]{2} ?)+) +payload ([0-9a-f ]+?) +CRC-32 0x([0-9A-F]{8})$",
        PAGE,
        flags=re.M,
    )
    assert head
    assert zlib.crc32(bytes.fromhex(head.group(1) + head.group(2))) == int(head.group(3), 16)


def test_versions_and_limits() -> None:
    assert f"describes **link version {pk.LINK_VERSION}**" in PAGE
    assert f"at most {pk.MAX_PAYLOAD:,}" in PAGE
