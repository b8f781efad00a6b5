"""Sets solved in parts, and models judged scene by scene: what experiments on skins and scans
share."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.results import Reconstruction
from eitskin.model.model import Model
from eitskin.progress import Progress
from eitskin.scene.random_touches import TouchScene, TouchSet
from eitskin.scoring import metrics
from eitskin.scoring.matching import GATE_MM, Matching, match
from eitskin.solve.batch import reconstruct_many
from eitskin_studies.harness.sessions import FrameSession, SceneSolver
from eitskin_studies.harness.summary import Summary
from eitskin_studies.harness.thresholds import best_threshold, miou_curves

PART = 20  # scenes that are solved and kept at once: some seconds
DIGITS = 5


def session_in_parts(
    solver: SceneSolver, drawn: TouchSet, progress: Progress, name: str
) -> FrameSession:
    """``solver.session`` of ``drawn``, kept every few scenes, so that a run that is killed loses no
    more than those.

    Raises:
        GeometryError, MissingExtraError: from meshing and solving.
    """
    parts = [
        solver.session(
            TouchSet(drawn.role, drawn.seed, drawn.scenes[k : k + PART]),
            progress,
            f"{name} {k // PART}",
        )
        for k in range(0, len(drawn.scenes), PART)
    ]
    exact_v = np.concatenate([part.exact_v for part in parts])
    first = parts[0]
    return FrameSession(
        name, first.protocol, first.sheet_s_per_m, drawn, exact_v, first.exact_untouched_v
    )


@dataclass(frozen=True, eq=False)
class Evaluator:
    """A model and how it is judged: images by ``image_scorer``, touches as found within
    ``gate_mm``."""

    model: Model
    image_scorer: metrics.ImageScorer
    gate_mm: float = GATE_MM

    def truths(self, scenes: Sequence[TouchScene]) -> BoolArray:
        """The true discs on the scorer's cells, (k, p)."""
        points = self.image_scorer.raster.points_mm
        return np.array(
            [metrics.disc_mask(points, scene.centres_mm(), scene.radii_mm()) for scene in scenes]
        )

    def discs(self, one: Reconstruction) -> BoolArray:
        """The touches found, as discs on the scorer's cells, (p,)."""
        places = np.array([(touch.x_mm, touch.y_mm) for touch in one.touches]).reshape(-1, 2)
        return metrics.disc_mask(
            self.image_scorer.raster.points_mm, places, [touch.radius_mm for touch in one.touches]
        )

    def matched(self, scene: TouchScene, one: Reconstruction) -> Matching:
        """The touches found paired with the true ones."""
        return match(
            scene.centres_mm(), [(touch.x_mm, touch.y_mm) for touch in one.touches], self.gate_mm
        )

    def threshold(
        self, scenes: Sequence[TouchScene], untouched_v: FloatArray, frames_v: FloatArray
    ) -> float:
        """t of the mask x > t max(x) with the best mean MIoU of these scenes; for sets of the
        tuning seed."""
        results = reconstruct_many(self.model, frames_v, untouched_v, threads=1, touches=False)
        images = np.array([one.solver_image for one in results], dtype=np.float64)
        return best_threshold(miou_curves(self.image_scorer, images, self.truths(scenes)))

    def scores(
        self, scenes: Sequence[TouchScene], untouched_v: FloatArray, frames_v: FloatArray, t: float
    ) -> dict[str, list[Any]]:
        """Lists fit for JSON: a scene's image and disc MIoU, exact count, false touches, kMAC; of
        each true touch its scene and place, and the distance of the found one, None if it was
        missed; a scene's found touches [x, y, radius]."""
        results = reconstruct_many(self.model, frames_v, untouched_v, threads=1)
        truths = self.truths(scenes)
        images = np.array([one.solver_image for one in results], dtype=np.float64)
        scored: dict[str, list[Any]] = {
            "image": miou_curves(self.image_scorer, images, truths, [t])[:, 0]
            .round(DIGITS)
            .tolist()
        }
        scored |= {
            name: []
            for name in (
                "discs",
                "exact",
                "false",
                "kmac",
                "scene",
                "place_mm",
                "error_mm",
                "found",
            )
        }
        for scene, truth, one in zip(scenes, truths, results, strict=True):
            pairs = self.matched(scene, one)
            distance = {i: d for (i, _), d in zip(pairs.pairs, pairs.distances_mm, strict=True)}
            scored["discs"].append(round(metrics.miou(self.discs(one), truth), DIGITS))
            scored["exact"].append(int(pairs.exact))
            scored["false"].append(pairs.false_touches)
            scored["kmac"].append(round((one.info.macs + one.info.touch_macs) / 1e3, 1))
            scored["scene"] += [len(scored["found"])] * len(scene.touches)
            scored["place_mm"] += scene.centres_mm().round(2).tolist()
            scored["error_mm"] += [
                None if i not in distance else round(distance[i], 3)
                for i in range(len(scene.touches))
            ]
            scored["found"].append(
                [[round(float(v), 2) for v in (t.x_mm, t.y_mm, t.radius_mm)] for t in one.touches]
            )
        return scored


def hits_mm(scored: Mapping[str, list[Any]]) -> FloatArray:
    """Position errors of the touches that were found, (h,)."""
    return np.array([value for value in scored["error_mm"] if value is not None], dtype=np.float64)


def share_text(values: npt.ArrayLike) -> str:
    """A share of zeros and ones with its 95 % interval after Wilson (J. Am. Stat. Assoc. 22, 1927),
    in percent: unlike a bootstrap's it has a width where all agree."""
    data = np.asarray(values, dtype=np.float64).reshape(-1)
    count, share, z = len(data), float(data.mean()), 1.96
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * math.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return f"{100 * share:.0f} % ({100 * (middle - half):.0f} to {100 * (middle + half):.0f})"


def score_text(one: Summary) -> str:
    """A mean with its 95 % interval: .858 (.848 to .867)."""
    return f"{number_text(one.mean)} ({number_text(one.low)} to {number_text(one.high)})"


def number_text(value: float) -> str:
    """A score to three digits, without a leading 0."""
    return f"{value:.3f}".replace("0.", ".", 1) if value < 1 else f"{value:.3f}"
