"""Measure how well a predicted frame explains the reference, and find the short circuit that
explains it best."""

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
    """Two electrodes ``pair`` joined by a wire: the transfer matrix (n, n) in ohm with the wire,
    and the ``misfit`` that remains."""

    pair: tuple[int, int]
    transfer_ohm: FloatArray
    misfit: float


def misfits(
    measured: FloatArray, predicted: FloatArray, use: BoolArray, magnitude: bool
) -> FloatArray:
    """Return the relative rms (h,) of the residual when each of ``predicted`` (h, m) is scaled to
    fit ``measured`` (m,).

    Only rows in ``use`` (m,) count, and a second fit leaves out the TRIMMED worst rows of the
    first. With ``magnitude`` signs are ignored. The result is 1 if nothing can be fitted.
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
    """Return the misfit of the case's own prediction over the rows in ``use`` (m,)."""
    return float(misfits(case.reference, case.predicted[None], use, magnitude)[0])


def best_joined(case: Case, magnitude: bool) -> Joined:
    """Find the two electrodes whose short circuit explains the reference best.

    How far an electrode's own potential rises above its neighbours' depends on its width and
    contact impedance, which are not well known. So several values are tried: the predicted one plus
    CONTACTS times the median rise.
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
