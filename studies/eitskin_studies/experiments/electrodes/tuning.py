"""A scan's model with the regularisation, lambda, iterations and t that do best on the tuning
scenes:
patterns differ in how fast their singular values fall, and what suits one starves another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.build import LIPSCHITZ_MARGIN
from eitskin.model.model import Model
from eitskin.model.reduction import DEFAULT_REGULARISATION, noise_gain, spectral_norm_squared
from eitskin.model.row_form import row_form
from eitskin.model.storage import store
from eitskin.scene.random_touches import TouchScene
from eitskin.scoring import metrics
from eitskin.solve.batch import reconstruct_many
from eitskin_studies.experiments.scored import Evaluator
from eitskin_studies.harness.thresholds import best_threshold, miou_curves

REGULARISATIONS, LAMBDAS, ITERATIONS = (
    (0.1, DEFAULT_REGULARISATION, 1e-3),
    (0.03, 0.01, 0.003),
    (60, 150),
)


@dataclass(frozen=True)
class ChosenSettings:
    """The chosen settings: mu of the whitening, least lambda over lambda_max, iterations, t of the
    mask."""

    regularisation: float
    lambda_rel: float
    iterations: int
    t: float


def with_regularisation(model: Model, regularisation: float) -> Model:
    """``model``, made with the default regularisation, as it is with another: its singular vectors
    stay, only rows are scaled.

    A row of S has the norm a = s / sqrt(s^2 + mu s_1^2), which says s / s_1.
    """
    norm = np.linalg.norm(model.sensitivity, axis=1)
    square = np.minimum(norm**2, 1 - 1e-9)
    relative = DEFAULT_REGULARISATION * square / (1 - square)
    scale = np.sqrt((relative + DEFAULT_REGULARISATION) / (relative + regularisation))
    projection = (scale[:, None] * model.projection).astype(np.float32)
    stored = store(scale[:, None] * model.sensitivity, model.stored.storage)
    decoded = stored.decode(model.rank)
    return replace(
        model,
        projection=projection,
        stored=stored,
        row_form=row_form(projection, stored),
        lipschitz=float(np.float32(spectral_norm_squared(decoded) * (1 + LIPSCHITZ_MARGIN))),
        noise_gain=float(np.float32(noise_gain(projection, decoded))),
    )


def tuned(
    model: Model,
    image_scorer: metrics.ImageScorer,
    scenes: Sequence[TouchScene],
    untouched_v: FloatArray,
    frames_v: FloatArray,
) -> tuple[Evaluator, ChosenSettings]:
    """The best of all settings on tuning scenes with their frames, untouched (q, m) and touched (k,
    m): by the sum of image MIoU, disc MIoU and exactly counted share; the first of equals."""
    best: tuple[float, Evaluator, ChosenSettings] | None = None
    for regularisation in REGULARISATIONS:
        regularised = with_regularisation(model, regularisation)
        for lambda_rel, iterations in product(LAMBDAS, ITERATIONS):
            defaults = replace(model.defaults, lambda_rel=lambda_rel, iterations=iterations)
            evaluator = Evaluator(replace(regularised, defaults=defaults), image_scorer)
            truths = evaluator.truths(scenes)
            results = reconstruct_many(evaluator.model, frames_v, untouched_v, threads=1)
            curves = miou_curves(
                image_scorer,
                np.array([one.solver_image for one in results], dtype=np.float64),
                truths,
            )
            t = best_threshold(curves)
            discs = [
                metrics.miou(evaluator.discs(one), truth)
                for one, truth in zip(results, truths, strict=True)
            ]
            exact = [
                evaluator.matched(scene, one).exact
                for scene, one in zip(scenes, results, strict=True)
            ]
            value = round(float(curves.mean(axis=0).max() + np.mean(discs) + np.mean(exact)), 9)
            if best is None or value > best[0]:
                best = value, evaluator, ChosenSettings(regularisation, lambda_rel, iterations, t)
    assert best is not None
    return best[1:]
