"""One entry at a time: its parameter and thresholds from simulated scenes, then the measured
frames."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.fem.grid import Grid
from eitskin.frames.frames import Frames
from eitskin.scoring import metrics
from eitskin.scoring.matching import Matching
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.experiments.tank.imagers import Entry, Imager, Shown
from eitskin_studies.experiments.tank.scenes import Set
from eitskin_studies.experiments.tank.signed_scores import (
    match_signs,
    places,
    signed_curves,
    signed_miou,
)
from eitskin_studies.experiments.tank.tanks import Rods, objects_of, touch_like, truth_of
from eitskin_studies.harness.thresholds import THRESHOLDS, best_threshold, match_all, miou_curves

DIGITS = 5
PLACE_THRESHOLDS = THRESHOLDS[4::5]


@dataclass(frozen=True, eq=False)
class EvaluationSets:
    """The data on which entries are judged: sets to choose by (``metal``, ``mixed``), a set to
    report (``test``), the measured frames; ``noise_share`` is the simulated noise over the rms of a
    frame's change."""

    image_scorer: metrics.ImageScorer
    grid: Grid
    metal: Set
    mixed: Set
    test: Set
    phantoms: Frames
    rods: tuple[Rods, ...]
    gate_mm: float
    noise_share: float


def evaluate(entry: Entry, evaluation_sets: EvaluationSets) -> dict[str, Any]:
    """Everything about an entry in plain values, fit for JSON.

    The parameter is the one with the best mean MIoU on the metal set, each value at its own best
    threshold t. t for both signs and the thresholds of places are chosen after it, on the mixed and
    the metal set.
    """
    best: tuple[float, float, Imager, FloatArray, Shown] | None = None
    for value in entry.values:
        imager = entry.make(value)
        shown = imager.show(
            evaluation_sets.metal.untouched_v, evaluation_sets.metal.frames_v, False
        )
        curves = curves_of(shown, evaluation_sets.metal.conductive, evaluation_sets.image_scorer)
        score = float(curves.mean(axis=0).max())
        if best is None or score > best[0] + 1e-12:
            best = score, value, imager, curves, shown
    assert best is not None
    trained, value, imager, curves, metal = best
    threshold = best_threshold(curves)
    at = THRESHOLDS.index(threshold)
    test = imager.show(evaluation_sets.test.untouched_v, evaluation_sets.test.frames_v, False)
    test_curves = curves_of(test, evaluation_sets.test.conductive, evaluation_sets.image_scorer)
    chosen = touch_like(evaluation_sets.phantoms)
    frames = evaluation_sets.phantoms.voltage_v[chosen]
    measured = imager.show(evaluation_sets.phantoms.reference_voltage_v, frames, False)
    conductive, _ = truth_of(evaluation_sets.phantoms, evaluation_sets.image_scorer.raster)
    measured_curves = curves_of(measured, conductive[chosen], evaluation_sets.image_scorer)
    place_threshold = None
    if metal.touches is None:
        place_threshold = best_place_threshold(metal.images, evaluation_sets)
    found = increases(measured, place_threshold, evaluation_sets.grid)
    matchings = match_all(
        [places_of(evaluation_sets.phantoms, k, 1) for k in chosen], found, evaluation_sets.gate_mm
    )
    simulated = match_all(
        evaluation_sets.test.conductive_mm,
        increases(test, place_threshold, evaluation_sets.grid),
        evaluation_sets.gate_mm,
    )
    result = {
        "name": entry.name,
        "kind": entry.kind,
        "parameter": entry.parameter,
        "value": value,
        "threshold": threshold,
        "place_threshold": place_threshold,
        "macs": measured.macs,
        "tuned": trained,
        "tuned_curve": _plain(curves.mean(axis=0)),
        "simulated": _plain(test_curves[:, at]),
        "simulated_places": _counts(simulated),
        "touch_like": _plain(measured_curves[:, at]),
        "touch_like_curve": _plain(measured_curves.mean(axis=0)),
        "touch_like_places": _counts(matchings),
        "images": [_plain(image) for image in measured.images],
        "discs": _touches(measured),
    }
    return {
        **result,
        **(_both_signs(imager, place_threshold, evaluation_sets) if entry.both_signs else {}),
    }


def curves_of(shown: Shown, truth: BoolArray, image_scorer: metrics.ImageScorer) -> FloatArray:
    """MIoU (k, T) of increases; discs are judged as discs, the same at each threshold."""
    if shown.touches is None:
        return miou_curves(image_scorer, shown.images, truth)
    scores = [
        metrics.miou(_discs(touches, 1, image_scorer), true)
        for touches, true in zip(shown.touches, truth, strict=True)
    ]
    return np.repeat(np.array(scores)[:, None], len(THRESHOLDS), axis=1)


def signed_curves_of(
    shown: Shown, conductive: BoolArray, resistive: BoolArray, image_scorer: metrics.ImageScorer
) -> FloatArray:
    """The same of both signs."""
    if shown.touches is None:
        return signed_curves(image_scorer, shown.images, conductive, resistive)
    scores = [
        signed_miou(_discs(touches, 1, image_scorer), _discs(touches, -1, image_scorer), up, down)
        for touches, up, down in zip(shown.touches, conductive, resistive, strict=True)
    ]
    return np.repeat(np.array(scores)[:, None], len(THRESHOLDS), axis=1)


def _discs(touches: Sequence[Touch], sign: int, image_scorer: metrics.ImageScorer) -> BoolArray:
    own = [t for t in touches if t.strength_s_per_m_mm2 * sign > 0]
    return metrics.disc_mask(
        image_scorer.raster.points_mm, [(t.x_mm, t.y_mm) for t in own], [t.radius_mm for t in own]
    )


def best_place_threshold(images: FloatArray, evaluation_sets: EvaluationSets) -> float:
    """Return the best threshold for the metal set's ``images``: the one with most scenes counted
    exactly, then most hits less false ones."""
    best, best_score = PLACE_THRESHOLDS[0], (-1, 0)
    index, centres = evaluation_sets.grid.index, evaluation_sets.grid.centres_mm()
    for threshold in PLACE_THRESHOLDS:
        found = [touches_in_image(image, index, centres, threshold) for image in images]
        matchings = match_all(evaluation_sets.metal.conductive_mm, found, evaluation_sets.gate_mm)
        score = (sum(m.exact for m in matchings), sum(m.hits - m.false_touches for m in matchings))
        if score > best_score:
            best, best_score = threshold, score
    return best


def _both_signs(
    imager: Imager, place_threshold: float | None, evaluation_sets: EvaluationSets
) -> dict[str, Any]:
    """All nine frames and the rods, with both signs."""
    mixed, frames = evaluation_sets.mixed, evaluation_sets.phantoms
    tuned = imager.show(mixed.untouched_v, mixed.frames_v, True)
    curves = signed_curves_of(
        tuned, mixed.conductive, mixed.resistive, evaluation_sets.image_scorer
    )
    threshold = best_threshold(curves)
    shown = imager.show(frames.reference_voltage_v, frames.voltage_v, True)
    truths = truth_of(frames, evaluation_sets.image_scorer.raster)
    scores = signed_curves_of(shown, *truths, evaluation_sets.image_scorer)[
        :, THRESHOLDS.index(threshold)
    ]
    matchings: list[Matching] = []
    for k, found in enumerate(_both(shown, place_threshold, evaluation_sets.grid)):
        matchings += match_signs(
            (places_of(frames, k, 1), places_of(frames, k, -1)), found, evaluation_sets.gate_mm
        )
    at_rods, rod_images, rod_discs = [], [], []
    for one in evaluation_sets.rods:
        seen = imager.show(one.frames.reference_voltage_v, one.frames.voltage_v, True)
        found = _both(seen, place_threshold, evaluation_sets.grid)[0]
        metal, plastic = match_signs((one.metal_mm, one.plastic_mm), found, evaluation_sets.gate_mm)
        at_rods.append({"metal": _counts([metal]), "plastic": _counts([plastic])})
        rod_images.append(_plain(seen.images[0]))
        rod_discs += _touches(seen)
    return {
        "tuned_both": float(curves.mean(axis=0).max()),
        "threshold_both": threshold,
        "nine": _plain(scores),
        "nine_places": _counts(matchings),
        "images_both": [_plain(image) for image in shown.images],
        "discs_both": _touches(shown),
        "rods": at_rods,
        "rod_images": rod_images,
        "rod_discs": rod_discs,
    }


def places_of(frames: Frames, number: int, sign: int) -> FloatArray:
    """Centres (t, 2) mm of the objects of one sign."""
    assert frames.touch_xy_mm is not None
    return frames.touch_xy_mm[objects_of(frames, number, sign)]


def increases(shown: Shown, threshold: float | None, grid: Grid) -> list[FloatArray]:
    """Return the increases that are found in each image, (t, 2) mm: touches if there are, else
    groups of pixels beyond ``threshold``."""
    if shown.touches is not None:
        return [_centres(touches, 1) for touches in shown.touches]
    assert threshold is not None
    return [
        touches_in_image(image, grid.index, grid.centres_mm(), threshold) for image in shown.images
    ]


def _both(shown: Shown, threshold: float | None, grid: Grid) -> list[tuple[FloatArray, FloatArray]]:
    if shown.touches is not None:
        return [(_centres(touches, 1), _centres(touches, -1)) for touches in shown.touches]
    assert threshold is not None
    return [places(image, grid.index, grid.centres_mm(), threshold) for image in shown.images]


def _centres(touches: Sequence[Touch], sign: int) -> FloatArray:
    return np.array(
        [(t.x_mm, t.y_mm) for t in touches if t.strength_s_per_m_mm2 * sign > 0]
    ).reshape(-1, 2)


def _counts(matchings: Sequence[Matching]) -> dict[str, Any]:
    return {
        "true": sum(m.hits + m.misses for m in matchings),
        "found": sum(m.hits for m in matchings),
        "false": sum(m.false_touches for m in matchings),
        "distances_mm": [round(d, DIGITS) for m in matchings for d in m.distances_mm],
    }


def _touches(shown: Shown) -> list[list[list[float]]]:
    """x, y, radius (mm) and sign of each touch."""
    return [
        [
            [
                round(t.x_mm, 3),
                round(t.y_mm, 3),
                round(t.radius_mm, 3),
                float(np.sign(t.strength_s_per_m_mm2)),
            ]
            for t in touches
        ]
        for touches in shown.touches or ()
    ]


def _plain(values: FloatArray) -> list[float]:
    top = float(np.abs(values).max()) or 1.0
    return [float(f"{value:.{DIGITS}g}") if abs(value) > 1e-6 * top else 0.0 for value in values]
