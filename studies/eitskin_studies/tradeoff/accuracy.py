"""How good a configuration is on a session: images and discs against the truth, counts, positions,
forces, and their cost."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.results import Reconstruction
from eitskin.scene.random_touches import TouchScene
from eitskin.scoring import metrics
from eitskin.scoring.matching import Matching, match
from eitskin.tuning.configuration import Configuration
from eitskin_studies.harness.sessions import (
    FrameSession,
    MeasuredFrames,
    apparent_change_s_per_m_mm2,
)
from eitskin_studies.harness.summary import Summary, summarise
from eitskin_studies.harness.thresholds import best_threshold, miou_curves
from eitskin_studies.tradeoff.engines import Built

DIGITS = 6


@dataclass(frozen=True)
class TrainedPoint:
    """The choices made on training scenes: ``threshold``, t of the mask x > t max(x) of the
    solver's image, ``drawn_threshold``, the same of the image that is shown, and ``force_scale``,
    by which the strengths of found touches are multiplied: the median of true over found."""

    threshold: float
    drawn_threshold: float
    force_scale: float


@dataclass(frozen=True, eq=False)
class SolvedSet:
    """Every scene of a session as a configuration sees it at its last frame."""

    results: tuple[Reconstruction, ...]
    matchings: tuple[Matching, ...]

    @property
    def images(self) -> FloatArray:
        """The solver's images, (k, n) S/m."""
        return np.array([one.solver_image for one in self.results], dtype=np.float64)

    @property
    def drawn(self) -> FloatArray:
        """The images that are shown, (k, n) S/m: of the touches where they explain the frame."""
        return np.array([one.image for one in self.results], dtype=np.float64)


def solve_session(
    one: Configuration, built: Built, session: FrameSession, snr_db: float
) -> SolvedSet:
    """Tare on the session's untouched frames, then reconstruct each scene: cold, or warm where held
    for some frames."""
    measured = session.measured(snr_db, one.samples, one.scan, one.held)
    return solve_frames(one, built, measured, session.touches.scenes)


def solve_frames(
    one: Configuration, built: Built, measured: MeasuredFrames, scenes: tuple[TouchScene, ...]
) -> SolvedSet:
    """The same of measured frames."""
    solver = built.reconstructor(one)
    solver.tare(measured.untouched_v)
    results, matchings = [], []
    for frames_v, scene in zip(measured.frames_v, scenes, strict=True):
        if not one.warm_start:
            solver.forget()
        for frame_v in frames_v[:-1]:
            solver.reconstruct(frame_v)
        result = solver.reconstruct(frames_v[-1])
        results.append(result)
        matchings.append(match(scene.centres_mm(), [(t.x_mm, t.y_mm) for t in result.touches]))
    return SolvedSet(tuple(results), tuple(matchings))


def train(built: Built, session: FrameSession, solved: SolvedSet) -> TrainedPoint:
    """For each kind of image t with the best mean MIoU, and the scale of force."""
    truths = session.truths(built.image_scorer.raster)
    threshold, drawn_threshold = (
        best_threshold(miou_curves(built.image_scorer, images, truths))
        for images in (solved.images, solved.drawn)
    )
    found, true = _forces(session, solved)
    usable = found > 0
    scale = float(np.median(true[usable] / found[usable])) if usable.any() else 1.0
    return TrainedPoint(threshold, drawn_threshold, round(scale, DIGITS))


def score(
    built: Built, session: FrameSession, solved: SolvedSet, trained: TrainedPoint
) -> dict[str, Any]:
    """Everything about the accuracy in plain values fit for JSON; ``studies/results/tradeoff.md``
    says what each is."""
    truths = session.truths(built.image_scorer.raster)
    image = miou_curves(built.image_scorer, solved.images, truths, [trained.threshold])[:, 0]
    drawn = miou_curves(built.image_scorer, solved.drawn, truths, [trained.drawn_threshold])[:, 0]
    discs = [
        metrics.miou(_discs(built, result), truth)
        for result, truth in zip(solved.results, truths, strict=True)
    ]
    found, true = _forces(session, solved)
    matchings, infos = solved.matchings, [result.info for result in solved.results]
    hits = sum(m.hits for m in matchings)
    return {
        "scenes": len(matchings),
        "image": _summary(summarise(image)),
        "drawn": _summary(summarise(drawn)),
        "discs": _summary(summarise(discs)),
        "exact_count": round(float(np.mean([m.exact for m in matchings])), DIGITS),
        "hit_share": round(hits / max(hits + sum(m.misses for m in matchings), 1), DIGITS),
        "false_per_scene": round(sum(m.false_touches for m in matchings) / len(matchings), DIGITS),
        "position_mm": _error([d for m in matchings for d in m.distances_mm]),
        "force_error": _error(np.abs(trained.force_scale * found / true - 1)),
        "solve_macs": [round(float(np.mean([i.macs for i in infos]))), max(i.macs for i in infos)],
        "touch_macs": [
            round(float(np.mean([i.touch_macs for i in infos]))),
            max(i.touch_macs for i in infos),
        ],
        "most_macs": max(i.macs + i.touch_macs for i in infos),
        "iterations": round(float(np.mean([i.iterations for i in infos])), 2),
        "gap_rel": float(f"{np.median([i.gap_rel for i in infos]):.4g}"),
        "stops": {
            stop: sum(i.stop == stop for i in infos) for stop in sorted({i.stop for i in infos})
        },
    }


def _summary(of: Summary) -> dict[str, float]:
    named = {"mean": of.mean, "worst_tenth": of.worst_tenth, "low": of.low, "high": of.high}
    return {name: round(value, DIGITS) for name, value in named.items()}


def _error(values: npt.ArrayLike) -> dict[str, float | None]:
    """Median and 95th percentile of errors; None if there is none to take them of."""
    data = np.asarray(values, dtype=np.float64).reshape(-1)
    if not len(data):
        return {"median": None, "p95": None}
    median, p95 = np.quantile(data, [0.5, 0.95])
    return {"median": round(float(median), DIGITS), "p95": round(float(p95), DIGITS)}


def _discs(built: Built, result: Reconstruction) -> BoolArray:
    places = np.array([(t.x_mm, t.y_mm) for t in result.touches]).reshape(-1, 2)
    return metrics.disc_mask(
        built.image_scorer.raster.points_mm, places, np.array([t.radius_mm for t in result.touches])
    )


def _forces(session: FrameSession, solved: SolvedSet) -> tuple[FloatArray, FloatArray]:
    """Strengths of all found touches and of their true ones, S/m mm2, (h,) each."""
    found, true = [], []
    for scene, result, matching in zip(
        session.touches.scenes, solved.results, solved.matchings, strict=True
    ):
        for i, j in matching.pairs:
            found.append(result.touches[j].strength_s_per_m_mm2)
            true.append(apparent_change_s_per_m_mm2(scene.touches[i], session.sheet_s_per_m))
    return np.array(found, dtype=np.float64), np.array(true, dtype=np.float64)
