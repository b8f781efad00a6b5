"""Sources as people have them, made here: a disk skin with a touch that moves along it, in closed
form."""

from pathlib import Path

import numpy as np

from eitskin.frames.homogeneous import disk_touch_transfer, disk_transfer, voltages_of
from eitskin.skin.protocol import Protocol, adjacent

ANGLES = np.arange(16) * (2 * np.pi / 16)
SHEET_S = 0.003  # of the skin of the paper, about
CURRENT_A = 1e-3
UNTOUCHED, TOUCHED = 8, 4


def transfers() -> list[np.ndarray]:
    """Transfer matrices in ohm of UNTOUCHED quiet frames and TOUCHED with a touch, without
    noise."""
    quiet = disk_transfer(ANGLES, 0.08) / SHEET_S
    radii = np.full(1, 0.06)
    touched = [
        quiet
        + 3
        / SHEET_S
        * disk_touch_transfer(ANGLES, np.array([[x, 0.1]]), radii, np.ones(1, np.int8))
        / np.pi
        for x in np.linspace(-0.5, 0.5, TOUCHED)
    ]
    return [quiet] * UNTOUCHED + touched


def volts(rows: np.ndarray | None = None, seed: int = 1, snr_db: float = 60.0) -> np.ndarray:
    """Frames (12, rows) of the adjacent protocol or of ``rows``."""
    wanted = adjacent(16).drive_measure if rows is None else rows
    frames = np.array([voltages_of(one, np.asarray(wanted, dtype=np.int64)) for one in transfers()])
    return noisy(frames * CURRENT_A, seed, snr_db)


def potentials(
    protocol: Protocol | None = None, *, rotating: bool = False, seed: int = 1
) -> np.ndarray:
    """Frames (12, 256): for every drive the potential of each electrode, in V."""
    drives = np.unique(np.asarray((protocol or adjacent(16)).drive_measure)[:, :2], axis=0)
    frames = []
    for one in transfers():
        of_drives = [one[:, a] - one[:, b] for a, b in drives.tolist()]
        of_drives = [
            np.roll(v, -a) if rotating else v
            for v, (a, _) in zip(of_drives, drives.tolist(), strict=True)
        ]
        frames.append(np.concatenate(of_drives))
    return noisy(np.array(frames) * CURRENT_A, seed, 80.0) + 0.2


def noisy(frames: np.ndarray, seed: int, snr_db: float) -> np.ndarray:
    sigma = np.sqrt(np.mean(frames[0] ** 2)) * 10 ** (-snr_db / 20)
    return frames + np.random.default_rng(seed).normal(0, sigma, frames.shape)


def written(path: Path, frames: np.ndarray, delimiter: str = ",", form: str = "%.9g") -> Path:
    np.savetxt(path, np.atleast_2d(frames), delimiter=delimiter, fmt=form)
    return path
