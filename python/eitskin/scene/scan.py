"""The timing of a scan in the front end: when each row is read, on which channel, and what the
multiplexers do before it."""

import numpy as np

from eitskin.arrays import AnyArray, BoolArray, FloatArray, IntArray
from eitskin.scene.effect import EffectSession
from eitskin.skin.protocol import Protocol


def row_delays_s(session: EffectSession) -> FloatArray:
    """Return when each row (m,) is read, in s after the time of its frame: rows follow at equal
    intervals over the frame."""
    protocol = session.protocol
    return np.asarray(protocol.scan_places / (protocol.n_rows * session.rate_hz))


def channels(protocol: Protocol) -> tuple[IntArray, IntArray]:
    """Return the different measuring pairs (C, 2) [V+, V-], sorted, and the number of each row's
    pair among them (m,)."""
    pairs, number = np.unique(
        protocol.drive_measure[:, 2:].astype(np.int64), axis=0, return_inverse=True
    )
    return pairs, np.asarray(number).reshape(-1)


def switched(protocol: Protocol) -> BoolArray:
    """Return whether each of the four multiplexers [I+, I-, V+, V-] switches just before each row,
    (m, 4).

    The scan is periodic: the last row precedes the first.
    """
    rows = protocol.drive_measure[protocol.scan_rows]
    return np.asarray(rows != np.roll(rows, 1, axis=0))[protocol.scan_places]


def settled_from_the_row_before(target: AnyArray, left: float) -> AnyArray:
    """Return the value that first-order settling reaches in each row (m,) of a periodic scan, in
    the order of measurement.

    Row k starts from the value that row k - 1 reached, and ``left`` (0 to below 1) of the distance
    to ``target[k]`` remains: y_k = target_k + left (y_{k-1} - target_k), where row 0 follows the
    last row. The sum (1 - left) sum_j left^j target_{k-j} is doubled in length until the remainder
    is below 1e-17.
    """
    reached, factor, shift = (1.0 - left) * target, left, 1
    while factor > 1e-17:
        reached = reached + factor * np.roll(reached, shift)
        factor, shift = factor * factor, 2 * shift
    return np.asarray(reached)
