"""Thresholds as they are chosen on training scenes, a method each: of images, and of touches in
them.

The fraction t of touches is not the one that MIoU uses; it is that of the highest share of exactly
counted scenes.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from eitskin.scoring.image_touches import touches_in_image
from eitskin.scoring.matching import GATE_MM, Matching, match
from eitskin.scoring.metrics import THRESHOLDS

FloatArray = npt.NDArray[np.float64]


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
    index: npt.NDArray[np.int64],
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
