"""A learned method: a network with one hidden layer, from a difference frame to an image, which is
trained on a folder that ``eitskin dataset`` made.

Its input is the frame over its norm, its target the part of each pixel that is touched. On a round
skin whose scan looks the same from every electrode, each scene is also used turned by one electrode
after the other.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from eitskin.arrays import AnyArray, FloatArray, IntArray
from eitskin.errors import FileError, UsageError
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import Protocol
from eitskin_studies.compare.baselines import difference_frames
from eitskin_studies.compare.families import Family, Setup
from eitskin_studies.datasets.dataset import load_chunk
from eitskin_studies.harness.extras import missing_studies_extra

HIDDEN, EPOCHS, SEED = 128, 60, 0
PENALTIES = (1e-5, 1e-3)
POINTS_A_PIXEL = 6  # squared: of the targets


@dataclass(frozen=True, eq=False)
class Network:
    """``first`` (m, h) with ``first_bias`` (h,), then max(0, .), then ``second`` (h, n) with
    ``second_bias`` (n,)."""

    first: FloatArray
    first_bias: FloatArray
    second: FloatArray
    second_bias: FloatArray
    name: str = f"small network, {HIDDEN} hidden"

    def reconstruct(self, dv: FloatArray) -> FloatArray:
        """Images (k, n) of difference frames (k, m): the part of each pixel that is touched."""
        frames = unit(difference_frames(dv, len(self.first)))
        hidden = np.maximum(frames @ self.first + self.first_bias, 0.0)
        return np.asarray(np.maximum(hidden @ self.second + self.second_bias, 0.0))

    @property
    def macs(self) -> int:
        """Multiply-accumulates of a frame, which are also the weights that a board would store."""
        return self.first.size + self.second.size


def unit(dv: FloatArray) -> FloatArray:
    """Frames (k, m) over the rms of their rows; a frame of zeros stays."""
    rms = np.sqrt((dv**2).mean(axis=1, keepdims=True))
    return np.asarray(dv / np.where(rms > 0, rms, 1.0))


def learned_family(setup: Setup, folder: Path) -> Family:
    """The network over penalties of its weights, trained on the dataset in ``folder``.

    Raises:
        FileError: the folder holds no chunk, or a chunk cannot be read.
        UsageError: the dataset was scanned with another protocol.
        MissingExtraError: scikit-learn is not installed.
    """
    training = _Training(setup, folder)
    training.chunks  # noqa: B018 (what cannot be read is refused before the other methods run)
    return Family("penalty", PENALTIES, training.network)


@dataclass(eq=False)
class _Training:
    """Frames and targets of a dataset, read when they are needed."""

    setup: Setup
    folder: Path

    @cached_property
    def chunks(self) -> list[dict[str, AnyArray]]:
        paths = sorted(self.folder.glob("chunk_*.npz"))
        if not paths:
            raise FileError(f"{self.folder}: holds no chunk of a dataset; run  eitskin dataset")
        chunks = [load_chunk(path) for path in paths]
        for path, chunk in zip(paths, chunks, strict=True):
            if not np.array_equal(chunk["drive_measure"], self.setup.protocol.drive_measure):
                raise UsageError(f"{path}: scanned with another protocol than this skin's")
        return chunks

    @cached_property
    def pairs(self) -> tuple[FloatArray, FloatArray]:
        """Frames (k, m) and their targets (k, n)."""
        grid, count = self.setup.grid, self.setup.protocol.n_electrodes
        round_skin = self.setup.skin.outline.diameter_mm is not None
        turns = turned_rows(self.setup.protocol) if round_skin else {}
        frames, targets = [], []
        for chunk in self.chunks:
            dv = chunk["voltage_v"][:, 0] - chunk["reference_v"]
            for k, frame in enumerate(dv):
                own = chunk["touch_scene"] == k
                places, radii = chunk["touch_xy_mm"][own], chunk["touch_radius_mm"][own]
                for turn, rows in (turns or {0: np.arange(len(frame))}).items():
                    turned = np.empty_like(frame)
                    turned[rows] = frame
                    angle = 2 * math.pi * turn / count
                    cosine, sine = math.cos(angle), math.sin(angle)
                    x, y = places.T
                    at = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
                    frames.append(turned)
                    targets.append(pixel_cover(grid, at, radii, POINTS_A_PIXEL))
        return unit(np.array(frames)), np.array(targets)

    def network(self, penalty: float) -> Network:
        """The network, trained with ``penalty`` on the squares of its weights."""
        try:
            from sklearn.neural_network import MLPRegressor
        except ModuleNotFoundError:
            raise missing_studies_extra("peers", "scikit-learn") from None
        made = MLPRegressor(
            hidden_layer_sizes=(HIDDEN,),
            alpha=penalty,
            max_iter=EPOCHS,
            early_stopping=True,
            random_state=SEED,
        )
        made.fit(*self.pairs)
        (first, second), (first_bias, second_bias) = made.coefs_, made.intercepts_
        return Network(first, first_bias, second, second_bias)


def turned_rows(protocol: Protocol) -> dict[int, IntArray]:
    """For each number of electrodes by which a scan can be turned, the row that each row becomes;
    empty if it is another scan when it is turned by one."""
    rows = {tuple(row): k for k, row in enumerate(protocol.drive_measure.tolist())}
    count, turns = protocol.n_electrodes, {}
    for turn in range(count):
        turned = ((protocol.drive_measure + turn) % count).tolist()
        if any(tuple(row) not in rows for row in turned):
            return {}
        turns[turn] = np.array([rows[tuple(row)] for row in turned])
    return turns
