"""Thresholds that are chosen on training scenes, for each method: of images, and of touches in
them.

The fraction t of touches is not the one that MIoU uses; it is that of the highest share of exactly
counted scenes.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.errors import UsageError
from eitskin.scoring.matching import GATE_MM, Matching, match
from eitskin.scoring.metrics import ImageScorer
from eitskin.solve.image_touches import touches_in_image

THRESHOLDS: tuple[float, ...] = tuple(round(0.02 * k, 2) for k in range(1, 50))


def miou_curves(
    image_scorer: ImageScorer,
    images: npt.ArrayLike,
    truths: BoolArray,
    thresholds: npt.ArrayLike = THRESHOLDS,
    sign: int = 1,
) -> FloatArray:
    """MIoU of images (k, n) against truths (k, p) at each of T ascending thresholds: (k, T).

    max(x) is that of the pixels. Each cell is counted once, at the highest threshold that it
    passes; sums over thresholds do the rest, so that the curve costs little more than one of
    its points.

    Raises:
        UsageError: shapes disagree, thresholds do not ascend, or an image has a value that is
            not finite.
    """
    values = np.asarray(images, dtype=np.float64)
    steps = np.asarray(thresholds, dtype=np.float64).reshape(-1)
    if values.ndim != 2 or values.shape != (len(truths), image_scorer.n_pixels):
        wanted = (len(truths), image_scorer.n_pixels)
        raise UsageError(
            f"images are {values.shape}, but {wanted} (frames, pixels) are to be judged"
        )
    if (np.diff(steps) <= 0).any():
        raise UsageError("thresholds of an MIoU curve must ascend")
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        raise UsageError(
            f"image {int(np.argmin(finite))} (from 0) has values that are not finite; cannot"
            " judge it"
        )
    result = np.empty((len(values), len(steps)))
    for k, image in enumerate(sign * values):
        top = max(float(image.max()), 0.0)
        passed = (
            np.searchsorted(steps * top, image_scorer.lookup.show(image), side="left") if top else 0
        )
        result[k] = _miou_of_passed(np.broadcast_to(passed, truths[k].shape), truths[k], len(steps))
    return result


def _miou_of_passed(passed: IntArray, truth: BoolArray, count: int) -> FloatArray:
    """MIoU (count,) where cell i (p,) is a touch at the first ``passed[i]`` thresholds."""
    claimed = np.cumsum(np.bincount(passed, minlength=count + 1)[::-1])[::-1][1:]
    hit = np.cumsum(np.bincount(passed[truth], minlength=count + 1)[::-1])[::-1][1:]
    true = np.count_nonzero(truth)
    either = claimed + true - hit
    background, not_both = len(truth) - either, len(truth) - hit
    touch = np.divide(hit, either, out=np.ones(count), where=either > 0)
    rest = np.divide(background, not_both, out=np.ones(count), where=not_both > 0)
    return np.asarray((touch + rest) / 2)


def best_threshold(curves: FloatArray, thresholds: npt.ArrayLike = THRESHOLDS) -> float:
    """The threshold with the highest mean of training ``curves`` (k, T); the lowest of equals."""
    steps = np.asarray(thresholds, dtype=np.float64).reshape(-1)
    return float(steps[int(np.argmax(curves.mean(axis=0).round(12)))])


def match_all(
    truths_mm: Sequence[FloatArray], founds_mm: Sequence[FloatArray], gate_mm: float = GATE_MM
) -> list[Matching]:
    """:func:`eitskin.scoring.matching.match` for each scene."""
    return [match(true, found, gate_mm) for true, found in zip(truths_mm, founds_mm, strict=True)]


def best_touch_threshold(
    images: FloatArray,
    truths_mm: Sequence[FloatArray],
    index: IntArray,
    centres_mm: FloatArray,
    thresholds: Sequence[float],
    sign: int = 1,
    gate_mm: float = GATE_MM,
) -> float:
    """The threshold that counts most training scenes exactly; of equals, more hits less false ones,
    then the lowest."""
    best, best_score = thresholds[0], (-1, 0)
    for threshold in thresholds:
        founds = [touches_in_image(image, index, centres_mm, threshold, sign) for image in images]
        matchings = match_all(truths_mm, founds, gate_mm)
        score = (sum(m.exact for m in matchings), sum(m.hits - m.false_touches for m in matchings))
        if score > best_score:
            best, best_score = threshold, score
    return best
