"""A measured tank's reference frame, where a folder of data has one."""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.errors import FileError, FrameError
from eitskin.frames.frames import Frames
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import table
from eitskin.skin.skin import Skin

FILE = "kit4_dev.npz"
SOURCE = "the open 2D EIT archive of Hauptmann et al. (arXiv:1704.01178)"


@dataclass(frozen=True, eq=False)
class MeasuredTank:
    """A water tank: its description, and its frames with the saline reference."""

    skin: Skin
    frames: Frames


def tank_skin() -> Skin:
    """As in examples/tank_kit4.toml: 280 mm across, 16 electrodes of 25 mm, clockwise from the
    top."""
    electrodes = Electrodes(
        count=16,
        width_mm=25.0,
        start_angle_deg=90.0,
        clockwise=True,
        contact_impedance_ohm_m2=0.001,
    )
    return Skin("tank-kit4", disk(280.0), electrodes, 0.03, 70.0)


def load_tank(folder: Path | None) -> MeasuredTank | None:
    """The tank in ``folder``; None without a folder, or where it has no such file.

    Raises:
        FileError: the file cannot be read, or is not what it is thought to be.
    """
    path = None if folder is None else folder / FILE
    if path is None or not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as archive:
            rows, voltage, reference = (
                archive[name] for name in ("drive_measure", "voltage", "reference_voltage")
            )
        return MeasuredTank(
            tank_skin(), Frames(table(16, rows), np.asarray(voltage), np.asarray(reference))
        )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, FrameError) as error:
        said = str(error).partition("\n")[0] or type(error).__name__
        raise FileError(
            f"{path}: these are not the tank's frames ({said}); leave --data out, or name another"
            " folder"
        ) from None
