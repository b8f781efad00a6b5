"""Frames of a comparison for programs of other languages, and the images that those give back.

``eitskin compare --give FRAMES.mat`` writes the frames of a comparison with the same arguments:
those of training scenes, with their touches; those of test scenes, without; and those of the small
targets of GREIT's figures. The other program writes ``images`` beside ``dv`` in a file of its own,
and ``eitskin compare --images IMAGES.mat`` scores them beside all other methods.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import FrameError, UsageError
from eitskin.fileio import write_beside
from eitskin.frames.arrays import pick, read_arrays
from eitskin.scene.simulate import Simulated
from eitskin_studies.compare.baselines import difference_frames
from eitskin_studies.compare.families import Family, Setup

SETS = ("train", "test", "target")
SUFFIXES = (".mat", ".npz")
SAME = 1e-6  # of a frame's norm: how far a frame of the file may be from that of the comparison


def check_suffix(path: Path) -> None:
    """Refuse a file that ``give_frames`` cannot write.

    Raises:
        UsageError: its name ends neither with .mat nor with .npz.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"--give {path}: write a file that ends with {' or '.join(SUFFIXES)}")


def give_frames(
    path: Path, setup: Setup, train: Simulated, test: Simulated, targets: Simulated
) -> int:
    """Write the frames of the three sets, and what a method may know; return the number of frames.

    Raises:
        UsageError, FileError: the file cannot be written.
    """
    check_suffix(path)
    sessions = (train, test, targets)
    counts = [len(one.frames_v) for one in sessions]
    content: dict[str, Any] = {
        "format": "eitskin-compare-frames",
        "dv": np.concatenate([one.differences_v() for one in sessions]),
        "reference_v": np.repeat([one.reference_v for one in sessions], counts, axis=0),
        "set": np.repeat(SETS, counts),
        "train_untouched_v": train.untouched_v,
        "test_untouched_v": test.untouched_v,
        **_touches_of(train),
        "J": setup.jacobian,
        "v0": setup.voltages_v,
        "pixel_xy_mm": setup.grid.centres_mm(),
        "pixel_mm": setup.grid.pixel_mm,
        "electrode_xy_mm": setup.skin.electrode_centres_mm(),
        "drive_measure": setup.protocol.drive_measure.astype(np.int64),
        "current_a": setup.protocol.current_a,
        "conductivity_s_per_m": setup.skin.conductivity_s_per_m,
        "thickness_mm": setup.skin.thickness_mm,
        "contact_impedance_ohm_m2": setup.skin.electrodes.contact_impedance_ohm_m2,
    }
    with write_beside(path) as temporary:
        if path.suffix.lower() == ".mat":
            from scipy.io import savemat

            content["set"] = content["set"].astype(object)  # a cell array in MATLAB
            savemat(str(temporary), content, appendmat=False, oned_as="column")
        else:
            with temporary.open("wb") as file:
                np.savez(file, **content)
    return sum(counts)


def _touches_of(train: Simulated) -> dict[str, AnyArray]:
    """Return the touches of training scenes: their frames, from 0, places, radii and contrasts."""
    flat = [(k, one) for k, scene in enumerate(train.touches.scenes) for one in scene.touches]
    return {
        "train_touch_frame": np.array([k for k, _ in flat]),
        "train_touch_xy_mm": np.array([(one.x_mm, one.y_mm) for _, one in flat]),
        "train_touch_radius_mm": np.array([one.radius_mm for _, one in flat]),
        "train_touch_contrast": np.array([one.contrast for _, one in flat]),
    }


@dataclass(frozen=True, eq=False)
class ReturnedImages:
    """A method that was run by another program: the image of a frame is looked up.

    Attributes:
        name: what tables call it.
        dv: (K, m) the difference frames that the program was given.
        images: (K, n) what it made of them.
    """

    name: str
    dv: FloatArray
    images: FloatArray

    def reconstruct(self, dv: FloatArray) -> FloatArray:
        """Return the program's images (k, n) of difference frames (k, m).

        Raises:
            UsageError: the program was not given one of these frames.
        """
        frames = difference_frames(dv, self.dv.shape[1])
        return np.array([self.images[self._row_of(k, frame)] for k, frame in enumerate(frames)])

    def _row_of(self, number: int, frame: FloatArray) -> int:
        away = np.linalg.norm(self.dv - frame, axis=1)
        row = int(np.argmin(away))
        if away[row] > SAME * np.linalg.norm(frame):
            raise UsageError(
                f"--images: {self.name} has no image of frame {number} of this comparison; give"
                " --skin, --scenes, --train, --seed, --snr-db and --shape as with --give"
            )
        return row


def returned_family(setup: Setup, path: Path) -> Family:
    """The images in ``path``: ``dv`` (K, m) with ``images`` (K, n), or (K, n, V) for V settings, of
    which the best on the training scenes is taken. The method has the file's name.

    Raises:
        FileError, FrameError: the file cannot be read, or an array is missing or does not fit.
    """
    arrays = read_arrays(path)
    dv, images = (
        np.asarray(pick(arrays, name, "--images", str(path)), dtype=np.float64)
        for name in ("dv", "images")
    )
    dv = difference_frames(dv, setup.protocol.n_rows)
    pixels = setup.grid.n_pixels
    if images.ndim not in (2, 3) or images.shape[:2] != (len(dv), pixels):
        raise FrameError(
            f"{path}: images have the shape {images.shape}; make them ({len(dv)}, {pixels}), one"
            f" line for each frame of dv, or ({len(dv)}, {pixels}, V) for V settings"
        )
    settings = images.reshape(len(dv), pixels, -1)
    count = settings.shape[2]
    make = partial(_setting, path.stem, dv, settings)
    return Family("setting" if count > 1 else "", tuple(map(float, range(count))), make)


def _setting(name: str, dv: FloatArray, settings: FloatArray, value: float) -> ReturnedImages:
    return ReturnedImages(name, dv, np.ascontiguousarray(settings[:, :, int(value)]))
