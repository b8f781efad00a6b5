"""The numbers behind the pictures, which are stored with them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scoring import metrics
from eitskin_studies.experiments.algorithms.measure import Arrays
from eitskin_studies.experiments.algorithms.results import FIXED_THRESHOLD, AlgorithmResult, column
from eitskin_studies.experiments.algorithms.scenes import NUMBERS
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.summary import Summary
from eitskin_studies.harness.thresholds import THRESHOLDS
from eitskin_studies.pictures import algorithms_pictures as pictures


def drawings(results: Sequence[AlgorithmResult], seed: int) -> dict[str, Drawing]:
    """The pictures of the page; ``seed`` is that of the test scenes."""
    shown = [one for one in results if one.candidate.name in pictures.CURVES]
    rows = [
        {
            "title": f"fixed parameter and t = {FIXED_THRESHOLD:g}",
            "methods": [_mask(one, one.shown_fixed, FIXED_THRESHOLD) for one in shown],
        },
        {
            "title": "both chosen on tuning scenes",
            "methods": [_mask(one, one.shown, one.chosen.threshold) for one in shown],
        },
    ]
    return {
        "images.png": Drawing(
            pictures.draw_images, {"seed": seed, "methods": [_images(one) for one in shown]}
        ),
        "masks.png": Drawing(pictures.draw_masks, {"seed": seed, "rows": rows}),
        "curves.svg": Drawing(
            pictures.draw_curves,
            {
                "thresholds": list(THRESHOLDS),
                "fixed_threshold": FIXED_THRESHOLD,
                "methods": [_curves(one) for one in shown],
            },
        ),
        "bars.svg": Drawing(
            pictures.draw_bars,
            {"fixed_threshold": FIXED_THRESHOLD, "methods": [_bars(one) for one in results]},
        ),
    }


def _images(one: AlgorithmResult) -> dict[str, Any]:
    of, scenes = one.shown, range(len(NUMBERS))
    return {
        "short": one.candidate.short,
        "images": [_in_parts(of["images"][k], 100) for k in scenes],
        "found_mm": [of["found_mm"][of["found_in"] == k].round(1).tolist() for k in scenes],
        "miou": column(of[metrics.LOOKUP], one.chosen.threshold).round(4).tolist(),
    }


def _mask(one: AlgorithmResult, of: Arrays, t: float) -> dict[str, Any]:
    """The scene with three touches."""
    return {
        "short": one.candidate.short,
        "t": t,
        "image": _in_parts(of["images"][-1], 1000),
        "miou": round(float(column(of[metrics.LOOKUP], t)[-1]), 4),
    }


def _curves(one: AlgorithmResult) -> dict[str, Any]:
    return {
        "name": one.candidate.name,
        "threshold": one.chosen.threshold,
        "fixed_curve": one.curve(fixed=True).round(4).tolist(),
        "best_curve": one.curve(fixed=False).round(4).tolist(),
    }


def _bars(one: AlgorithmResult) -> dict[str, Any]:
    return {
        "name": one.candidate.name,
        "claimed": one.candidate.claimed,
        "fixed": _reach(one.at_fixed()),
        "best": _reach(one.at_best()),
    }


def _reach(of: Summary) -> list[float]:
    return [round(value, 4) for value in (of.mean, of.low, of.high)]


def _in_parts(image: FloatArray, parts: int) -> list[int]:
    """Values in so many parts of the largest size."""
    most = float(np.abs(image).max()) or 1.0
    whole: list[int] = np.rint(parts * image / most).astype(np.int64).tolist()
    return whole
