"""Putting firmware, and a model beside it, on a NUCLEO-F767ZI by whichever programmer's tool is
installed."""

import shlex
import shutil
import struct
import subprocess
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from eitskin.device.bank import ERASED, RECORD_BYTES, bank_bytes, record_offset
from eitskin.errors import DeviceError, UsageError
from eitskin.fileio import read_bytes, write_bytes

FIRMWARE_ADDRESS = 0x0800_0000
FIRMWARE_ROOM = 0x4_0000
BANK_ADDRESS = 0x0804_0000
SECOND_BANK_ADDRESS = 0x080C_0000
MIN_IMAGE = 512
RAM = (0x2000_0000, 0x2008_0000)
TOOLS = ("openocd", "st-flash", "pyocd")
INSTALL = "install one:  apt install openocd  or  apt install stlink-tools  or  pip install pyocd"


@dataclass(frozen=True)
class FlashPlan:
    """The commands that will be run, in order, as argument lists for ``tool``. ``bank_file`` holds
    the bank of the model, if a model is flashed too."""

    tool: str
    commands: tuple[tuple[str, ...], ...]
    image: Path
    bank_file: Path | None = None

    def lines(self) -> list[str]:
        """The commands as a shell takes them."""
        return [shlex.join(command) for command in self.commands]


def find_tool(wanted: str | None = None, *, installed: bool = True) -> str:
    """Return the programmer's tool: ``wanted``, or the first of ``TOOLS`` that is installed. If
    none is and it need not be ``installed``, return the first of ``TOOLS``."""
    if wanted is not None and wanted not in TOOLS:
        raise UsageError(f"--tool {wanted}: use one of {', '.join(TOOLS)}")
    choice = [wanted] if wanted else list(TOOLS)
    found = [tool for tool in choice if shutil.which(tool)] or ([] if installed else choice)
    if not found:
        raise DeviceError(
            f"{wanted + ' is not' if wanted else 'none of ' + ', '.join(TOOLS) + ' is'} installed;"
            f" {INSTALL}"
        )
    return found[0]


def plan_flash(
    image: str | Path,
    model: bytes | None,
    folder: Path,
    *,
    tool: str | None = None,
    serial: str | None = None,
    installed: bool = True,
) -> FlashPlan:
    """The commands that put the firmware ``image`` (.bin) on a board and, where given, ``model`` in
    its first bank; the record of the second bank is then erased, so that the first one counts. What
    the commands read beside ``image`` is written into ``folder``.
    ``serial``: the ST-LINK's, where several boards are plugged in. ``installed``: the tool must be
    there; not to show only what would be run."""
    path = Path(image)
    check_image(path, read_bytes(path, "firmware image"))
    name = find_tool(tool, installed=installed)
    pieces = [(path, FIRMWARE_ADDRESS)]
    bank_file = None
    if model is not None:
        bank_file = folder / f"eitskin-bank-{zlib.crc32(model):08x}.bin"
        no_record = folder / "eitskin-no-record.bin"
        write_bytes(bank_file, bank_bytes(model, 1))
        write_bytes(no_record, bytes([ERASED]) * RECORD_BYTES)
        # the other bank may hold a model of a later generation, which would win
        pieces += [(bank_file, BANK_ADDRESS), (no_record, SECOND_BANK_ADDRESS + record_offset())]
    return FlashPlan(name, tuple(_MAKERS[name](pieces, serial)), path, bank_file)


def export_flash(image: bytes, model: bytes | None, suffix: str) -> bytes:
    """Return one file that holds the firmware ``image`` and, where given, ``model`` in the first
    bank, for the drive that an ST-LINK shows: ".bin" begins at the start of the flash and has ones
    between the pieces; ".hex" (Intel's format) has the pieces alone, and erases the record of the
    second bank, as flashing by a tool does.

    Raises:
        UsageError: another ``suffix``.
    """
    pieces = [(FIRMWARE_ADDRESS, image)]
    if model is not None:
        pieces.append((BANK_ADDRESS, bank_bytes(model, 1)))
    if suffix == ".bin":
        whole = bytearray()
        for address, content in pieces:
            whole += bytes([ERASED]) * (address - FIRMWARE_ADDRESS - len(whole)) + content
        return bytes(whole)
    if suffix == ".hex":
        if model is not None:
            erased = bytes([ERASED]) * RECORD_BYTES
            pieces.append((SECOND_BANK_ADDRESS + record_offset(), erased))
        lines = [line for address, content in pieces for line in _hex_lines(address, content)]
        return "".join(f"{line}\n" for line in (*lines, ":00000001FF")).encode("ascii")
    raise UsageError(f"--export: a name that ends in {suffix or 'nothing'}; end it in .bin or .hex")


def _hex_lines(address: int, content: bytes) -> list[str]:
    """Records of 16 bytes; each 64 KB begins with the upper half of its address."""
    lines = []
    for at in range(address, address + len(content), 16):
        if at == address or at % 0x10000 == 0:
            lines.append(_hex_line(0, 4, struct.pack(">H", at >> 16)))
        lines.append(_hex_line(at & 0xFFFF, 0, content[at - address : at - address + 16]))
    return lines


def _hex_line(address: int, kind: int, content: bytes) -> str:
    record = struct.pack(">BHB", len(content), address, kind) + content
    return f":{record.hex()}{-sum(record) & 0xFF:02x}".upper()


def check_image(path: Path, image: bytes) -> None:
    """Reject a file that cannot be this board's firmware."""
    if image[:4] == b"\x7fELF":
        raise DeviceError(f"{path}: this is an .elf; give the .bin beside it")
    if len(image) > FIRMWARE_ROOM:
        raise DeviceError(
            f"{path}: {len(image)} bytes, but firmware has room for {FIRMWARE_ROOM}; is this the"
            " right file?"
        )
    stack, start = struct.unpack("<II", image[:8]) if len(image) >= MIN_IMAGE else (0, 0)
    in_flash = FIRMWARE_ADDRESS <= start < FIRMWARE_ADDRESS + len(image) and start & 1
    if not (RAM[0] < stack <= RAM[1] and stack % 8 == 0 and in_flash):
        raise DeviceError(
            f"{path}: no firmware image of this board (its first words are no stack and start in"
            " its memory)"
        )


def run_flash(plan: FlashPlan, echo: Callable[[str], None] | None = None) -> None:
    """Run the plan; ``echo`` gets each command before it runs. The tool's own output is not
    redirected."""
    for command, line in zip(plan.commands, plan.lines(), strict=True):
        if echo is not None:
            echo(line)
        try:
            code = subprocess.run(command, check=False).returncode
        except OSError as error:
            raise DeviceError(f"{plan.tool}: cannot be run ({error.strerror}); {INSTALL}") from None
        if code:
            raise DeviceError(
                f"flashing failed: {line} ended with {code}; is the board plugged in by its ST-LINK"
                " port, and no debugger on it? flash again"
            )


def _openocd(pieces: Sequence[tuple[Path, int]], serial: str | None) -> list[tuple[str, ...]]:
    words = ["openocd", "-f", "board/st_nucleo_f7.cfg"]
    if serial is not None:
        words += ["-c", f"adapter serial {serial}"]
    for path, address in pieces:
        words += ["-c", f"program {{{path}}} verify 0x{address:08x}"]
    return [(*words, "-c", "reset run", "-c", "shutdown")]


def _st_flash(pieces: Sequence[tuple[Path, int]], serial: str | None) -> list[tuple[str, ...]]:
    which = ("--serial", serial) if serial is not None else ()
    return [
        ("st-flash", *which, "--reset", "write", str(path), f"0x{address:08x}")
        for path, address in pieces
    ]


def _pyocd(pieces: Sequence[tuple[Path, int]], serial: str | None) -> list[tuple[str, ...]]:
    load = ["pyocd", "load", "--target", "stm32f767zi", "--no-wait"]
    load += [] if serial is None else ["--uid", serial]
    return [
        (*load, "--format", "bin", "--base-address", f"0x{address:08x}", str(path))
        for path, address in pieces
    ]


_MAKERS = {"openocd": _openocd, "st-flash": _st_flash, "pyocd": _pyocd}
