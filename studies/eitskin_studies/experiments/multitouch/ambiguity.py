"""Reporting uncertainty: the calibration of ``crowded``, and a linear score that may be better.

The score is w . f + b with features that the core can compute without a logarithm or an
exponential; it is fitted as a logistic regression (Cox 1958) on tuning scenes to whether a frame is
*exact* (every touch within 10 mm, and nothing else).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.constants_table import CROWD_CLEAR, CROWD_FAR, CROWD_STRONG
from eitskin.errors import missing_extra
from eitskin.scoring.matching import match
from eitskin_studies.experiments.multitouch.counts import Share, share_of
from eitskin_studies.experiments.multitouch.variants import SeenFrame

# what each feature is, in the order of the coefficients; none may thrive on touches of a scene
# being equal, as half of these are
FEATURES = (
    "found touches, of 16 electrodes",
    "nearest pair's distance / sum of its radii, at most 2",
    "widest radius / seed radius",
    "root of the share unexplained",
    "weakest touch over noise: root of what it explains times max(S'y) / that of noise, at most 10",
    "root of what the weakest touch explains / the share unexplained, at most 3",
)
RIDGE = 1e-3
AIM, BAR_DB = 0.95, 60.0
BINS = 10


@dataclass(frozen=True)
class ScoredFrame:
    """A frame, its result, and the features that could predict the result. ``found`` touches;
    ``nearest`` pair's distance over the sum of its radii (inf if there is none)."""

    snr_db: float
    true: int
    found: int
    exact: bool
    right: bool
    said: bool
    nearest: float
    features: tuple[float, ...]


def score_frame(
    seen: SeenFrame, truth_mm: FloatArray, snr_db: float, seed_radius_mm: float
) -> ScoredFrame:
    """One frame."""
    found, near = len(seen.x_mm), nearest(seen)
    return ScoredFrame(
        snr_db,
        len(truth_mm),
        found,
        match(truth_mm, seen.places_mm).exact,
        found == len(truth_mm),
        seen.said,
        near,
        features(seen, near, seed_radius_mm),
    )


def nearest(seen: SeenFrame) -> float:
    """The least distance of two found touches over the sum of their radii; inf of fewer than
    two."""
    places, radii = seen.places_mm, np.asarray(seen.radius_mm, dtype=np.float64)
    if len(radii) < 2:
        return math.inf
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) / (
        radii[:, None] + radii[None]
    )
    return float(apart[np.triu_indices(len(radii), 1)].min())


def features(seen: SeenFrame, near: float, seed_radius_mm: float) -> tuple[float, ...]:
    """As ``FEATURES`` says; of no touch those of one that is sure."""
    if not seen.x_mm:
        return 0.0, CROWD_FAR, 1.0, 0.0, CROWD_STRONG, CROWD_CLEAR
    weakest, left = min(seen.explained), seen.unexplained
    return (
        float(len(seen.x_mm)),
        min(CROWD_FAR, near),
        max(seen.radius_mm) / seed_radius_mm,
        math.sqrt(left),
        min(CROWD_STRONG, math.sqrt(weakest) * seen.clear) if seen.clear > 0 else CROWD_STRONG,
        math.sqrt(weakest / left) if weakest < CROWD_CLEAR**2 * left else CROWD_CLEAR,
    )


@dataclass(frozen=True)
class Rule:
    """Score = ``weights`` . features + ``offset``, the logarithm of the odds; doubt is said below
    ``bar``."""

    weights: tuple[float, ...]
    offset: float
    bar: float

    def scores(self, frames: Sequence[ScoredFrame]) -> FloatArray:
        """(k,)."""
        known = np.array([one.features for one in frames], dtype=np.float64).reshape(
            -1, len(self.weights)
        )
        return np.asarray(known @ self.weights + self.offset)

    def says(self, frames: Sequence[ScoredFrame]) -> BoolArray:
        """Doubt about each; none where nothing was found."""
        return np.asarray(
            (self.scores(frames) < self.bar)
            & np.array([one.found > 0 for one in frames], dtype=np.bool_)
        )

    def chances(self, frames: Sequence[ScoredFrame]) -> FloatArray:
        """Return the chance that each frame's count is exact, (k,)."""
        return np.asarray(1 / (1 + np.exp(-self.scores(frames))))


def fit_rule(frames: Sequence[ScoredFrame], aim: float = AIM) -> Rule:
    """On tuning frames in which something was found, at whatever SNR. The bar is the lowest at
    which a share ``aim`` of what is above is exact, of frames at 60 dB and more: below, noise hides
    touches that no feature knows of.

    Raises:
        MissingExtraError: scipy is absent.
    """
    try:
        from scipy.optimize import minimize
    except ImportError:
        raise missing_extra("model", "scipy") from None
    used = [one for one in frames if one.found > 0]
    x = np.array([one.features for one in used], dtype=np.float64)
    y = np.array([one.exact for one in used], dtype=np.float64)
    mean, spread = x.mean(axis=0), x.std(axis=0) + 1e-9
    z = np.column_stack([(x - mean) / spread, np.ones(len(x))])

    def loss(w: FloatArray) -> tuple[float, FloatArray]:
        score = z @ w
        flat = np.append(w[:-1], 0.0)
        value = float(np.mean(np.logaddexp(0, score) - y * score) + RIDGE * flat @ flat)
        return value, z.T @ (1 / (1 + np.exp(-score)) - y) / len(y) + 2 * RIDGE * flat

    w = np.asarray(minimize(loss, np.zeros(z.shape[1]), jac=True).x)
    weights = tuple(float(f"{one:.4g}") for one in w[:-1] / spread)
    offset = float(f"{w[-1] - np.dot(weights, mean):.4g}")
    calm = np.array([one.snr_db >= BAR_DB for one in used], dtype=np.bool_)
    return Rule(weights, offset, _bar((x @ weights + offset)[calm], y[calm] > 0, aim))


def _bar(scores: FloatArray, exact: BoolArray, aim: float) -> float:
    order = np.argsort(-scores, kind="stable")
    so_far = np.cumsum(exact[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(so_far >= aim)
    return float(f"{scores[order[good[-1]]] - 5e-4:.3f}") if len(good) else math.inf


@dataclass(frozen=True)
class ConfidenceCalibration:
    """The worth of flagging doubtful frames.

    Attributes:
        not_said: frames about which nothing was said.
        right_not_said, exact_not_said, right_said, exact_said: with the right count, and exact,
            where it was not said and was.
        wrong_said: frames with a wrong count about which it was said.
    """

    not_said: Share
    right_not_said: Share
    exact_not_said: Share
    right_said: Share
    exact_said: Share
    wrong_said: Share


def calibration(
    frames: Sequence[ScoredFrame], said: BoolArray | None = None
) -> ConfidenceCalibration:
    """Return the worth of the core's own ``crowded``, or of ``said`` (k,)."""
    says = np.array([one.said for one in frames], dtype=np.bool_) if said is None else said
    right, exact = (
        np.array([getattr(one, name) for one in frames], dtype=np.bool_)
        for name in ("right", "exact")
    )
    return ConfidenceCalibration(
        share_of(~says), share_of(right[~says]), share_of(exact[~says]), share_of(right[says]),
        share_of(exact[says]),
        share_of(says[~right]),
    )  # fmt: skip


@dataclass(frozen=True)
class Reliability:
    """The calibration of chances: mean chance and what came true in each bin (nan of an empty one),
    Brier's score (1950), and the expected calibration error: the mean over frames of their bin's
    |chance - truth|."""

    chance: tuple[float, ...]
    truth: tuple[Share, ...]
    brier: float
    error: float


def reliability(chances: FloatArray, exact: BoolArray) -> Reliability:
    """Ten equal bins of the chance."""
    bins = np.minimum((chances * BINS).astype(np.int64), BINS - 1)
    mean, truth, error = [], [], 0.0
    for k in range(BINS):
        mine = bins == k
        mean.append(float(chances[mine].mean()) if mine.any() else math.nan)
        truth.append(share_of(exact[mine]))
        error += float(abs(chances[mine].sum() - exact[mine].sum())) / max(len(chances), 1)
    return Reliability(tuple(mean), tuple(truth), float(np.mean((chances - exact) ** 2)), error)


@dataclass(frozen=True)
class TouchScores:
    """Found touches of many frames: whether each is a true one, and three scores of it."""

    true: BoolArray
    explained: FloatArray
    over_noise: FloatArray
    strength: FloatArray


def touch_scores(frames: Sequence[tuple[SeenFrame, FloatArray]]) -> TouchScores:
    """``explained``: its own; ``over_noise``: its root times max(S'y) / that of noise;
    ``strength``: of the greatest found."""
    true, columns = [], []
    for seen, truth_mm in frames:
        hit = {found for _, found in match(truth_mm, seen.places_mm).pairs}
        for k, explained in enumerate(seen.explained):
            true.append(k in hit)
            columns.append(
                (
                    explained,
                    math.sqrt(explained) * seen.clear,
                    seen.strength[k] / max(seen.strength),
                )
            )
    scores = np.array(columns, dtype=np.float64).reshape(-1, 3)
    return TouchScores(np.array(true, dtype=np.bool_), scores[:, 0], scores[:, 1], scores[:, 2])
