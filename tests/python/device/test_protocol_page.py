"""docs/reference/link-protocol.md agrees with the code: sizes, the worked example, version and
limits."""

import re
import zlib
from pathlib import Path

from eitskin.core import _core_f32 as core
from eitskin.device.wire.codec import encode
from eitskin.device.wire.link_table import LINK_MAX_PAYLOAD, LINK_VERSION

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "link-protocol.md").read_text(
    encoding="utf-8"
)


def test_payloads_state_the_structs_size():
    stated = dict(re.findall(r"(eits_(?:packet|command)_\w+) \((\d+)\)", PAGE))
    assert len(stated) >= 20
    assert stated == {name: str(core.ffi.sizeof(name)) for name in stated}


def test_the_worked_example():
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


def test_versions_and_limits():
    assert f"describes **link version {LINK_VERSION}**" in PAGE
    assert f"at most {LINK_MAX_PAYLOAD:,}" in PAGE
