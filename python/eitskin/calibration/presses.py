"""What a recording of known weights shows: a strength and a place for each press."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.calibration.weights import Weight
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import FrameError
from eitskin.frames.frames import Frames
from eitskin.solve.reconstructor import Reconstructor

NEAR_MM = 25.0  # a touch that far from where the weight is said to be is not it


@dataclass(frozen=True, eq=False)
class WeighedPresses:
    """k presses: ``force_n`` (k,) N as the list says; ``strength`` (k,) S/m mm^2, the median over
    the press's frames, and ``place_mm`` (k, 2) as found, medians too."""

    force_n: FloatArray
    strength: FloatArray
    place_mm: FloatArray

    def __len__(self) -> int:
        return len(self.force_n)

    def take(self, rows: IntArray | BoolArray) -> "WeighedPresses":
        return WeighedPresses(self.force_n[rows], self.strength[rows], self.place_mm[rows])


def joined(parts: Sequence[WeighedPresses]) -> WeighedPresses:
    """All of several recordings."""
    return WeighedPresses(
        np.concatenate([part.force_n for part in parts]),
        np.concatenate([part.strength for part in parts]),
        np.concatenate([part.place_mm for part in parts]),
    )


def find_presses(
    reconstructor: Reconstructor,
    frames: Frames,
    numbers: Sequence[int],
    weights: Sequence[Weight],
    where: str,
) -> tuple[WeighedPresses, list[str]]:
    """The presses of ``weights`` in ``frames``, whose frames are counted by ``numbers``; and a line
    for each that shows no touch."""
    at = {number: k for k, number in enumerate(numbers)}
    reconstructor.tare(frames.reference_voltage_v)
    seen: list[tuple[float, float, float, float]] = []
    unseen: list[str] = []
    for weight in weights:
        rows = [k for number, k in at.items() if weight.first <= number <= weight.last]
        name = f"{where}: frames {weight.first} to {weight.last}"
        if not rows:
            held = f"frames {min(numbers)} to {max(numbers)}" if numbers else "no frames"
            raise FrameError(f"{name} of the list of weights are not there; it has {held}")
        shown = (_pressed(reconstructor, frames.voltage_v[row], weight) for row in sorted(rows))
        touches = [touch for touch in shown if touch is not None]
        if 2 * len(touches) <= len(rows):
            unseen.append(f"{name}: {len(touches)} of {len(rows)} show the weight; left out")
            continue
        found = np.median([(abs(t.strength_s_per_m_mm2), t.x_mm, t.y_mm) for t in touches], axis=0)
        seen.append((weight.force_n, *found.tolist()))
    table = np.array(seen, dtype=np.float64).reshape(-1, 4)
    return WeighedPresses(table[:, 0], table[:, 1], table[:, 2:]), unseen


def _pressed(reconstructor: Reconstructor, frame_v: FloatArray, weight: Weight) -> Touch | None:
    """The touch that is the weight: the strongest, or where its place is known the nearest; None
    where there is none."""
    reconstructor.forget()
    try:
        touches = reconstructor.reconstruct(frame_v).touches
    except FrameError:
        return None
    if weight.place_mm is None or not touches:
        return touches[0] if touches else None
    x, y = weight.place_mm
    away = [float(np.hypot(t.x_mm - x, t.y_mm - y)) for t in touches]
    nearest = int(np.argmin(away))
    return touches[nearest] if away[nearest] <= NEAR_MM else None
