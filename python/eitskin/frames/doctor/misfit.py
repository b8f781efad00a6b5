"""How badly a predicted frame explains the reference, and which short circuit explains it best."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.frames.doctor.case import Case
from eitskin.frames.homogeneous import shorted, shorted_frames

TRIMMED = 0.04
CONTACTS = (0.0, -0.35, -0.2, 0.2, 0.4)


@dataclass(frozen=True, eq=False)
class Joined:
    """Electrodes ``pair`` joined by a wire: the transfer matrix (n, n) in ohm with it, and the
    ``misfit`` it leaves."""

    pair: tuple[int, int]
    transfer_ohm: FloatArray
    misfit: float


def misfits(
    measured: FloatArray, predicted: FloatArray, use: BoolArray, magnitude: bool
) -> FloatArray:
    """Relative rms (h,) of what the best multiple of each of ``predicted`` (h, m) leaves of
    ``measured`` (m,).

    Over ``use`` (m,), and the TRIMMED worst channels of a first fit left out of the second.
    ``magnitude``: signs do not enter. 1 where nothing can be fitted.
    """
    y, p = measured[use], predicted[:, use]
    if magnitude:
        y, p = np.abs(y), np.abs(p)
    keep = np.ones(p.shape, dtype=bool)
    result = np.ones(len(p))
    least = int(np.floor(TRIMMED * len(y)))
    for _ in range(2):
        power, whole = (keep * p**2).sum(axis=1), (keep * y**2).sum(axis=1)
        if not len(y) or not (whole > 0).all():
            return np.ones(len(p))
        factor = np.divide((keep * p * y).sum(axis=1), power, out=np.zeros(len(p)), where=power > 0)
        residual = np.abs(y - p * factor[:, None])
        result = np.sqrt((keep * residual**2).sum(axis=1) / whole)
        limit = np.partition(residual, len(y) - 1 - least, axis=1)[:, len(y) - 1 - least]
        keep = residual <= limit[:, None]
    return np.asarray(result)


def misfit(case: Case, use: BoolArray, magnitude: bool) -> float:
    """The misfit of the case's own prediction over the channels ``use`` (m,)."""
    return float(misfits(case.reference, case.predicted[None], use, magnitude)[0])


def best_joined(case: Case, magnitude: bool) -> Joined:
    """The two electrodes whose joining explains the reference best.

    How far an electrode's own potential rises above its neighbours' depends on its width and
    contact, which are not known well: several values are tried, CONTACTS times the median rise more
    than predicted.
    """
    pairs = np.array(list(combinations(sorted(set(case.rows.ravel().tolist())), 2)))
    own = np.diag(case.transfer_ohm)
    beside = (
        np.roll(case.transfer_ohm, -1, axis=1).diagonal()
        + np.roll(case.transfer_ohm, -1, axis=0).diagonal()
    )
    rise = float(np.median((own + np.roll(own, -1) - beside) / 2))
    found = []
    for share in CONTACTS:
        contact = case.transfer_ohm + share * rise * np.eye(len(own))
        left = misfits(
            case.reference, shorted_frames(contact, pairs, case.rows), case.trusted, magnitude
        )
        best = int(np.argmin(left))
        found.append((float(left[best]), share, best))
    least, share, best = min(found)
    i, j = (int(electrode) for electrode in pairs[best])
    return Joined((i, j), shorted(case.transfer_ohm + share * rise * np.eye(len(own)), i, j), least)
