"""The firmware image that ships with eitskin."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from eitskin.errors import DeviceError, FileError
from eitskin.fileio import read_bytes

NAME = "nucleo_f767zi.bin"
ELF = b"\x7fELF"


def load_image(path: Path | None) -> bytes:
    """The image in ``path`` (.bin), or without it the one that ships.

    Raises:
        FileError: it cannot be read.
        DeviceError: it is an .elf.
    """
    if path is None:
        path = Path(str(files("eitskin"))) / "firmware" / NAME
        if not path.exists():
            raise FileError(
                f"{path}: the firmware image is not there; build it (CONTRIBUTING.md), give it with  --image FILE.bin"
            )
    image = read_bytes(path, "firmware image")
    if image.startswith(ELF):
        raise DeviceError(f"{path}: this is an .elf; give the .bin that is built beside it")
    return image
