"""The firmware on QEMU's mps2-an500: its skin, its link and its flash are files."""

import struct
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from eitskin.device.wire.codec import Decoder, LinkCounters, encode
from eitskin.device.wire.layout import Command
from eitskin.device.wire.packets import FromBoard
from eitskin.device.wire.payloads import parse


@dataclass
class Script:
    """Packets that the host sends, each with its time on the board's clock (us)."""

    records: list[tuple[int, bytes]] = field(default_factory=list)

    def at(self, time_us: int, command: Command) -> int:
        """Send ``command``; its request number is returned."""
        request = len(self.records) + 1
        self.records.append((time_us, encode(command.TYPE, request - 1, command.payload(request))))
        return request

    def to_bytes(self, end_us: int) -> bytes:
        ended = [*self.records, (end_us, b"")]
        return b"".join(struct.pack("<II", time_us, len(data)) + data for time_us, data in ended)


def skin_bytes(rows: np.ndarray, volts: np.ndarray, frame_us: int) -> bytes:
    """``rows`` (m, 4) electrodes, ``volts`` (k, m); frames change every ``frame_us`` from the start
    of the scan."""
    head = struct.pack("<III", len(rows), len(volts), frame_us)
    return head + rows.astype(np.uint8).tobytes() + volts.astype("<f4").tobytes()


@dataclass(frozen=True)
class Run:
    """Everything that the board sent, and what its link counted."""

    output: bytes
    packets: list[FromBoard]
    counters: LinkCounters


def run_board(image: Path, folder: Path, files: dict[str, bytes]) -> Run:
    """Run until the script ends; ``files`` are put into ``folder`` before."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    machine = "qemu-system-arm -M mps2-an500 -nographic -monitor none"
    how = "-semihosting-config enable=on,target=native -icount shift=6 -kernel"
    done = subprocess.run(
        [*machine.split(), *how.split(), str(image)], cwd=folder, capture_output=True, text=True,
        timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    output = (folder / "link_out.bin").read_bytes()
    decoder = Decoder()
    found = [parse(packet.type, packet.payload) for packet in decoder.feed(output)]
    return Run(output, [one for one in found if one is not None], decoder.counters)
