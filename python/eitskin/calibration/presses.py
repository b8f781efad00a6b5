"""Find the presses of known weights in a recording: a strength and a place for each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.calibration.weights import Weight
from eitskin.core.diagnostics_table import Touch
from eitskin.errors import FrameError
from eitskin.frames.frames import Frames
from eitskin.solve.reconstructor import Reconstructor

NEAR_MM = 25.0  # a touch further than this from the stated place is not the weight


@dataclass(frozen=True, eq=False)
class WeighedPresses:
    """Presses of known force: ``force_n`` (k,) in N as listed; ``strength`` (k,) in S/m mm^2 and
    ``place_mm`` (k, 2) as found, both the median over the frames of a press."""

    force_n: FloatArray
    strength: FloatArray
    place_mm: FloatArray

    def __len__(self) -> int:
        return len(self.force_n)

    def take(self, rows: IntArray | BoolArray) -> "WeighedPresses":
        """Return the presses that ``rows`` selects, by number or as a mask."""
        return WeighedPresses(self.force_n[rows], self.strength[rows], self.place_mm[rows])


def joined(parts: Sequence[WeighedPresses]) -> WeighedPresses:
    """Return the presses of several recordings together."""
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
    """Find the presses of ``weights`` in ``frames``, which have the ``numbers``. Return them, and a
    line for each weight that too few frames show.

    Raises:
        FrameError: the recording does not have the frames of a weight.
    """
    places = {number: k for k, number in enumerate(numbers)}
    reconstructor.tare(frames.reference_voltage_v)
    seen: list[tuple[float, float, float, float]] = []
    unseen: list[str] = []
    for weight in weights:
        rows = [k for number, k in places.items() if weight.first <= number <= weight.last]
        name = f"{where}: frames {weight.first} to {weight.last}"
        if not rows:
            existing = f"frames {min(numbers)} to {max(numbers)}" if numbers else "no frames"
            raise FrameError(
                f"{name} of the list of weights do not exist; the recording has {existing}"
            )
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
    """Return the touch of the weight: the nearest to the weight's place if that is known, otherwise
    the strongest. Return None if there is none."""
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
