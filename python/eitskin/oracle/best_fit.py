"""The best fit of discs to a frame of a round skin, over many starts: the definition of what a fit
of touches should find. docs/design/oracle.md, "Round skins", has the formulas.

The model of a frame is exact (``round_skin``), and nothing is saved: this takes seconds for a
frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import UsageError, missing_extra
from eitskin.oracle.round_skin import RoundSkin
from eitskin.scene.random_touches import TrueTouch

try:
    from scipy.optimize import least_squares
except ModuleNotFoundError as error:
    raise missing_extra("model", "scipy") from error

EDGE_POINTS = 24
CLEARANCE_MM = 0.5
"""Discs closer to each other or to the rim than this are pushed apart."""
PUSH_PER_MM = 30.0
"""The residual that a missing millimetre of clearance adds, in deviations of the noise."""
AMPLITUDES = (-1.9, 1.96)
RADII_MM = (2.0, 30.0)
STEP = 1e-4  # of the parameters, which are mm, ln(mm) and amplitudes, for slopes


@dataclass(frozen=True)
class Prior:
    """The knowledge of a disc before it is measured: mean and deviation of ln(radius / mm), and of
    the amplitude 2 (c - 1) / (c + 1) of a disc of contrast c. None: nothing is known."""

    log_radius: tuple[float, float] | None = None
    amplitude: tuple[float, float] | None = None


@dataclass(frozen=True)
class Fit:
    """Discs and their cost."""

    touches: tuple[TrueTouch, ...]
    cost: float


@dataclass(frozen=True, eq=False)
class DiscCost:
    """The cost of discs that are to explain ``change_v`` (m,), a frame less the untouched one:

        |metric (change_v - change of the exact model)|^2 + the prior's squares.

    ``metric`` (k, m) turns voltages into deviations of the noise.
    """

    skin: RoundSkin
    change_v: FloatArray
    metric: FloatArray
    prior: Prior = field(default_factory=Prior)

    def cost(self, touches: Sequence[TrueTouch]) -> float:
        """Return the cost of ``touches``."""
        return float(np.sum(self._residuals(_numbers(touches)) ** 2))

    def refined(self, touches: Sequence[TrueTouch], places: bool = True) -> Fit:
        """Return the nearest minimum of the cost; without ``places``, the centres stay."""
        start = _numbers(touches)
        if not len(start):
            return Fit((), self.cost(()))
        reach = self._radius_mm
        low = np.tile([-reach, -reach, np.log(RADII_MM[0]), AMPLITUDES[0]], len(start))
        high = np.tile([reach, reach, np.log(RADII_MM[1]), AMPLITUDES[1]], len(start))
        free = np.flatnonzero(np.tile([places, places, True, True], len(start)))
        whole = np.clip(start.ravel(), low + 1e-3, high - 1e-3)

        def residuals(values: FloatArray) -> FloatArray:
            numbers = whole.copy()
            numbers[free] = values
            return self._residuals(numbers.reshape(-1, 4))

        scale = np.tile([1.0, 1.0, 0.1, 0.1], len(start))[free]
        found = least_squares(
            residuals,
            whole[free],
            bounds=(low[free], high[free]),
            x_scale=scale,
            diff_step=STEP * scale / np.maximum(np.abs(whole[free]), scale),
            max_nfev=60,
        )
        whole[free] = found.x
        return Fit(_touches(whole.reshape(-1, 4)), 2 * float(found.cost))

    def best(
        self,
        count: int,
        *,
        starts: int = 6,
        draws: int = 200,
        seed: int = 0,
        first: Sequence[Sequence[TrueTouch]] = (),
    ) -> Fit:
        """Return the best of the minima from many starts with ``count`` discs: all of ``first``,
        and those ``starts`` of ``draws`` random ones that cost least.

        Raises:
            UsageError: a start of ``first`` has another number of discs, or there is no start.
        """
        if any(len(one) != count for one in first) or not (first or min(starts, draws) > 0):
            raise UsageError(f"best fit: give at least one start, each of {count} touches")
        generator = np.random.default_rng(seed)
        drawn = [self._drawn(count, generator) for _ in range(draws)]
        drawn.sort(key=self.cost)
        fits = [self.refined(one) for one in [*first, *drawn[:starts]]]
        return min(fits, key=lambda fit: fit.cost)

    @property
    def _radius_mm(self) -> float:
        return float(self.skin.skin.outline.diameter_mm or 0.0) / 2

    def _drawn(self, count: int, generator: np.random.Generator) -> tuple[TrueTouch, ...]:
        """Draw discs of 9 mm and contrast 5 within .9 of the skin's radius."""
        away = 0.9 * self._radius_mm * np.sqrt(generator.random(count))
        turn = 2 * np.pi * generator.random(count)
        places = zip(away * np.cos(turn), away * np.sin(turn), strict=True)
        return tuple(TrueTouch(float(x), float(y), 9.0, 5.0) for x, y in places)

    def _residuals(self, numbers: FloatArray) -> FloatArray:
        """Return the residuals whose squares are the cost for discs (n, 4): x, y in mm, ln(radius),
        amplitude."""
        allowed, push = self._apart(numbers)
        modelled = self.skin.voltages(_touches(allowed), EDGE_POINTS) - self._untouched_v
        parts = [self.metric @ (self.change_v - modelled), push]
        for column, known in ((2, self.prior.log_radius), (3, self.prior.amplitude)):
            if known is not None:
                parts.append((numbers[:, column] - known[0]) / known[1])
        return np.concatenate(parts)

    @property
    def _untouched_v(self) -> FloatArray:
        return self.skin.voltages(())

    def _apart(self, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the discs inside the rim that are nearest to ``numbers`` (n, 4), and residuals for
        missing clearance to the rim and to each other."""
        allowed = numbers.copy()
        radius_mm = np.exp(numbers[:, 2])
        away = np.hypot(numbers[:, 0], numbers[:, 1])
        most = np.maximum(self._radius_mm - radius_mm - CLEARANCE_MM, 0.0)
        allowed[:, :2] *= np.minimum(1.0, most / np.maximum(away, 1e-9))[:, None]
        first, second = np.triu_indices(len(numbers), 1)
        apart = np.hypot(*(allowed[first, :2] - allowed[second, :2]).T)
        gap = apart - radius_mm[first] - radius_mm[second]
        missing = np.concatenate([away - most, CLEARANCE_MM - gap])
        return allowed, PUSH_PER_MM * np.maximum(missing, 0.0)


def _numbers(touches: Sequence[TrueTouch]) -> FloatArray:
    """Return x, y, ln(radius) and amplitude of discs, (n, 4)."""
    rows = [
        (t.x_mm, t.y_mm, np.log(t.radius_mm), 2 * (t.contrast - 1) / (t.contrast + 1))
        for t in touches
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _touches(numbers: FloatArray) -> tuple[TrueTouch, ...]:
    """Return the discs with these numbers; the inverse of ``_numbers``."""
    return tuple(
        TrueTouch(float(x), float(y), float(np.exp(log)), float((2 + q) / (2 - q)))
        for x, y, log, q in numbers
    )
