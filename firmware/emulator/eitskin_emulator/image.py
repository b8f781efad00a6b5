"""The firmware image that runs on the emulated board: one of the user's, or the one that ships with
eitskin."""

from pathlib import Path

from eitskin.device.flash import check_image
from eitskin.fileio import read_bytes


def image_bytes(path: Path | None) -> bytes:
    """The image in ``path`` (.bin), or without it the one that ships.

    Raises:
        FileError: it cannot be read.
        DeviceError: it cannot be this board's firmware.
    """
    if path is None:
        from eitskin.firmware.prebuilt import load_image

        return load_image()[0]
    image = read_bytes(path, "firmware image")
    check_image(path, image)
    return image
