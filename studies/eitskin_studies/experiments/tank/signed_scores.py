"""MIoU of images with both signs, places read off them, and how well the truth itself is known."""

from collections.abc import Sequence

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.scene.streams import stream
from eitskin.scoring import metrics
from eitskin.scoring.matching import Matching, match
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.harness.thresholds import THRESHOLDS


def signed_miou(
    conductive: BoolArray,
    resistive: BoolArray,
    true_conductive: BoolArray,
    true_resistive: BoolArray,
) -> float:
    """The mean IoU of the background and of those signs that the truth has; masks (p,). With one
    sign in truth and image it is the MIoU of ``metrics``; what is shown with a sign that is not
    there spoils the background's."""
    scores = [metrics.iou(~(conductive | resistive), ~(true_conductive | true_resistive))]
    for shown, true in ((conductive, true_conductive), (resistive, true_resistive)):
        if true.any():
            scores.append(metrics.iou(shown, true))
    return float(np.mean(scores))


def signed_curves(
    image_scorer: metrics.ImageScorer,
    images: FloatArray,
    conductive: BoolArray,
    resistive: BoolArray,
    thresholds: Sequence[float] = THRESHOLDS,
) -> FloatArray:
    """:func:`signed_miou` (k, T) of images (k, n) against truths (k, p) each, where x > t max|x|
    and where -x > t max|x|."""
    result = np.empty((len(images), len(thresholds)))
    for k, image in enumerate(images):
        shown, top = image_scorer.lookup.show(image), float(np.abs(image).max())
        for i, t in enumerate(thresholds):
            up, down = (shown > t * top) & (top > 0), (shown < -t * top) & (top > 0)
            result[k, i] = signed_miou(up, down, conductive[k], resistive[k])
    return result


def places(
    image: FloatArray, index: IntArray, centres_mm: FloatArray, threshold: float
) -> tuple[FloatArray, FloatArray]:
    """Conductive and resistive places (k, 2) mm that an image (n,) shows: groups of pixels beyond t
    max|x| of one sign."""
    top = float(np.abs(image).max())
    found = []
    for sign in (1, -1):
        own = float((sign * image).max())
        relative = threshold * top / own if own > 0 else 1.0
        shows = relative < 1
        found.append(
            touches_in_image(image, index, centres_mm, relative, sign)
            if shows
            else np.zeros((0, 2))
        )
    return found[0], found[1]


def match_signs(
    true_mm: tuple[FloatArray, FloatArray], found_mm: tuple[FloatArray, FloatArray], gate_mm: float
) -> tuple[Matching, Matching]:
    """Each sign for itself."""
    return match(true_mm[0], found_mm[0], gate_mm), match(true_mm[1], found_mm[1], gate_mm)


def jittered_truth(
    points_mm: FloatArray,
    truth: BoolArray,
    centres_mm: FloatArray,
    radii_mm: FloatArray,
    off_mm: float,
    seed: int,
    draws: int,
) -> float:
    """Mean MIoU of the true discs, each moved by ``off_mm`` in a random direction, against
    ``truth`` (p,): what a reconstruction without any error would have if the truth's places were
    that far off."""
    generator, scores = stream(seed, "truth's error"), []
    for _ in range(draws):
        angle = generator.uniform(0.0, 2 * np.pi, len(centres_mm))
        moved = centres_mm + off_mm * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        scores.append(metrics.miou(metrics.disc_mask(points_mm, moved, radii_mm), truth))
    return float(np.mean(scores))
