"""The measured tanks: their skin, their frames from the published files, and the objects that are
known to have stood in them.

Hauptmann et al., arXiv:1704.01178, doi 10.5281/zenodo.1203914: nine phantoms, truth digitised by
hand. Two raw exports of another tank with rods (MIT licence, CBZ199671/PyEIDORS), of which only the
places are stated. Neither is part of this project.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.frames.frames import Frames
from eitskin.frames.import_options import ImportOptions
from eitskin.frames.importer import import_frames
from eitskin.frames.source import SourceOptions
from eitskin.frames.truth import TruthOptions
from eitskin.scoring.metrics import Raster, mask_on_points
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.outline import disk
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import Skin

RADIUS_MM = 140.0
PHANTOMS = "kit4_dev.npz"
TOUCH_LIKE = ("1_3", "2_3", "2_6", "3_4")
ROD_AT = 0.58
# file, electrodes before which metal stands, and plastic
RODS = (("tank_metal_e1.csv", (0,), ()), ("tank_metal_e1_e13_plastic_e5_e9.csv", (0, 12), (4, 8)))


@dataclass(frozen=True)
class Rods:
    """A raw export: ``frames`` with one frame, and the stated places of metal and plastic, (k, 2)
    mm each."""

    name: str
    frames: Frames
    metal_mm: FloatArray
    plastic_mm: FloatArray


def tank() -> tuple[Skin, Protocol]:
    """The tank as examples/tank_kit4.toml describes it: 280 mm across, 16 electrodes of 25 mm,
    clockwise from 12 o'clock."""
    electrodes = Electrodes(
        count=16,
        width_mm=25.0,
        start_angle_deg=90.0,
        clockwise=True,
        contact_impedance_ohm_m2=0.001,
    )
    outline = disk(2 * RADIUS_MM)
    return Skin(
        "tank-kit4", outline, electrodes, thickness_mm=70.0, conductivity_s_per_m=0.03
    ), adjacent(16)


def folder_of(data: Path | None) -> Path:
    """The folder with the measured frames.

    Raises:
        UsageError: none is given, or a file is missing.
    """
    if data is None:
        raise UsageError(
            "study tank: needs measured frames, which are not part of the project; give --data DIR"
            f" with {PHANTOMS}"
        )
    for name in (PHANTOMS, *(rods[0] for rods in RODS)):
        if not (data / name).is_file():
            raise UsageError(
                f"--data {data}: has no {name}; studies/results/tank.md says where to get the"
                " measured frames"
            )
    return data


def phantoms(folder: Path) -> Frames:
    """The nine frames with their truth.

    Raises:
        EitskinError: the file is another than the one that this study knows.
    """
    skin, protocol = tank()
    source = SourceOptions(
        voltage="voltage",
        reference="reference_voltage",
        names="frame_name",
        protocol_table="drive_measure",
        scale=1.0,
    )
    truth = TruthOptions(
        touch_frame="object_frame",
        touch_xy="object_xy",
        touch_radius="object_radius",
        touch_sign="object_is_conductive",
        touch_unit_mm=RADIUS_MM,
        mask="truth_mask",
    )
    return import_frames(
        folder / PHANTOMS, ImportOptions(source=source, truth=truth), protocol, skin
    )


def rods(folder: Path) -> tuple[Rods, ...]:
    """The two raw exports, in this project's order and polarity.

    Raises:
        EitskinError: a file is another than the one that this study knows.
    """
    skin, protocol = tank()
    source = SourceOptions(columns="2", reference_columns="0", scale=1.0)
    options = ImportOptions(source=source, order="rotating", sign="reversed", clockwise=True)
    before = ROD_AT * skin.electrode_centres_mm()
    found = []
    for name, metal, plastic in RODS:
        frames = import_frames(folder / name, options, protocol, skin)
        found.append(Rods(name.removesuffix(".csv"), frames, before[[*metal]], before[[*plastic]]))
    return tuple(found)


def touch_like(frames: Frames) -> list[int]:
    """Return the numbers of the frames that show metal only."""
    return [frames.frame_name.index(name) for name in TOUCH_LIKE]


def truth_of(frames: Frames, raster: Raster) -> tuple[BoolArray, BoolArray]:
    """Return masks of conductive and of resistive objects on ``raster``: (k, p) each."""
    assert frames.truth_mask is not None and frames.truth_mask_extent_mm is not None
    box = frames.truth_mask_extent_mm
    conductive, resistive = (
        np.array(
            [mask_on_points(raster.points_mm, mask == sign, box) for mask in frames.truth_mask]
        )
        for sign in (1, -1)
    )
    return conductive, resistive


def objects_of(frames: Frames, number: int, sign: int) -> IntArray:
    """The objects of frame ``number`` that conduct (+1), or insulate (-1)."""
    assert frames.touch_sign is not None
    there = frames.touches_in(number)
    return np.asarray(there[frames.touch_sign[there] == sign])


def reciprocal_share(frames: Frames) -> FloatArray:
    """For each frame the noise of a reading over the rms of the change, from how far reciprocal
    readings differ: (k,).

    Reciprocity is exact whatever stands in the tank, so that half the squared difference of a pair
    is the noise's variance.
    """
    fold = frames.protocol.reciprocal_pairs()
    paired = fold.second >= 0
    change = frames.voltage_v - frames.reference_v
    apart = change[:, fold.first[paired]] - fold.sign[paired] * change[:, fold.second[paired]]
    return np.asarray(np.sqrt((apart**2).mean(axis=1) / 2 / (change**2).mean(axis=1)))
