"""The reference that follows the untouched skin, in numpy terms: what csrc/src/frame/follow.c and
eits_check_drift do, for tests and studies."""

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin_reference.constants_table import (
    DRIFT_CLEAR,
    DRIFT_UNEXPLAINED,
    REFERENCE_TRACKING_GAIN,
    REFERENCE_TRACKING_LEFT,
    REFERENCE_TRACKING_PARTS,
    REFERENCE_TRACKING_TOUCH,
)
from eitskin_reference.problem import orthonormal, project


class Follower:
    """What is known of the frames since the reference was taken. ``frames``: ``reference_frames``,
    the time constant; 0: it does not follow."""

    def __init__(self, frames: int = 0) -> None:
        self.frames = frames
        self.begin()

    def begin(self) -> None:
        """A reference was taken."""
        self._seen = self._rest = self._means = 0
        self._touches: int | None = 0
        self._level = self._gain = 0.0
        self._differences: list[FloatArray] = []
        self._open = False

    @property
    def _apart(self) -> int:
        return self.frames // REFERENCE_TRACKING_PARTS

    @property
    def follows(self) -> bool:
        """Whether frames follow one another, for long enough to be told from single ones."""
        return self.frames > 0 and self._seen > self._apart

    def add(self, frame: FloatArray, v0: FloatArray, unusable: BoolArray) -> None:
        """One frame (m,) more was solved against the reference ``v0`` (m,)."""
        if self.frames == 0:
            return
        if self._open:
            self.let_go()
        self._differences.append(np.where(unusable, np.nan, frame - v0))
        self._open, self._seen = True, self._seen + 1

    def let_go(self) -> None:
        """What comes has nothing to do with the frames at hand."""
        self._differences, self._open = self._differences[:0], False
        self._rest, self._means = self._apart, 0

    def drifts(self, unexplained: float, lambda_max: float, threshold: float | None) -> bool:
        """Whether touches of a taught model that leave the share ``unexplained`` of |y|^2 are the
        skin's own change; ``threshold`` None: the reference tells no noise."""
        level = self._level if threshold is None else threshold
        clear = lambda_max / level if level > 0 else DRIFT_CLEAR
        little = unexplained > DRIFT_UNEXPLAINED * (1 + clear)
        return self.follows and clear <= DRIFT_CLEAR and little

    def mean(self, touches: int | None, v0: FloatArray) -> FloatArray | None:
        """The mean frame (m,) of those at hand, once there are enough; the last one shows so many
        ``touches``, None for a frame of no use."""
        if not self._open:
            return None
        last = self._differences[-1]
        if touches != self._touches:
            self.let_go()
            self._differences = [last]
        self._touches, self._open = touches, False
        if self._rest > 0:
            self._rest, self._differences = self._rest - 1, []
            return None
        if len(self._differences) < self._apart:
            return None
        mean = np.mean(self._differences, axis=0)
        self._differences = []
        return None if touches is None else v0 + np.where(np.isfinite(mean), mean, 0.0)

    def moved(
        self, mean: FloatArray, v0: FloatArray, lambda_max: float, match: float
    ) -> FloatArray | None:
        """Of an untouched skin: the reference (m,) on the way to ``mean``; ``match``: how much of
        its |y|^2 the best column has."""
        if not self._level > 0:
            self._level = lambda_max
        if match > REFERENCE_TRACKING_TOUCH:
            return None
        share = max(1, self._apart) / self.frames
        return np.asarray(v0 + min(1.0, share) * (mean - v0))

    def grown(self, v0: FloatArray, gain: float) -> FloatArray | None:
        """Under touches: the reference (m,) by so much larger as ``gain``, beside the touches, has
        become since the first mean."""
        self._means += 1
        if self._means == 1:
            self._gain = gain
        by, frames = gain - self._gain, max(1, self._apart)
        if 4 * self._means * frames <= self.frames or not 0 < abs(by) < REFERENCE_TRACKING_GAIN:
            return None
        return np.asarray(v0 + by * v0)


def gain_beside(u: FloatArray, y: FloatArray, columns: FloatArray) -> float:
    """How much of ``y`` (r,) is ``u`` (r,), beside what ``columns`` (r, k) give; 0 where they may
    give all of it."""
    left = project(u, orthonormal(columns.T, len(u), REFERENCE_TRACKING_LEFT))
    return (
        float(left @ y / (left @ left)) if left @ left > REFERENCE_TRACKING_LEFT * (u @ u) else 0.0
    )
