"""Searches and images on sets that nothing was chosen on; thresholds from tuning sets."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.results import Reconstruction
from eitskin.model.build import linearise, make_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.scene.random_touches import TouchScene, TouchSet, random_touches
from eitskin.scoring import metrics
from eitskin.scoring.matching import match
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.batch import reconstruct_many
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.levers.configurations import Ablation
from eitskin_studies.experiments.scored import session_in_parts
from eitskin_studies.harness.discs import spaced_touches
from eitskin_studies.harness.sessions import FrameSession, apparent_change_s_per_m_mm2
from eitskin_studies.harness.summary import summarise
from eitskin_studies.harness.thresholds import THRESHOLDS, best_threshold, miou_curves

RANDOM, SCENES, TUNING = "1 to 3 random", 160, 60
IMAGE_SNRS_DB = (40.0, 50.0, 60.0, 80.0)
# name: touches, spacing in radii, SNR in dB, scenes
COUNTED: dict[str, tuple[int, float, float, int]] = {
    "6 at 4 radii, 80 dB": (6, 4.0, 80.0, 60),
    "8 at 4 radii, 80 dB": (8, 4.0, 80.0, 60),
    "3 at 2.5 radii, 60 dB": (3, 2.5, 60.0, 60),
    "5 at 2.5 radii, 60 dB": (5, 2.5, 60.0, 60),
}
DIGITS = 6


class AblationRuns:
    """Scenes, models and judges, each made when it is first needed."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.skin, self.protocol = workspace, paper_skin(), adjacent(16)
        self._models: dict[str, Model] = {}
        self._sessions: dict[tuple[str, bool], FrameSession] = {}

    @cached_property
    def _solver(self) -> Any:
        return self.workspace.scenes(self.skin, self.protocol)

    @cached_property
    def _raster(self) -> metrics.Raster:
        return metrics.raster_inside(self.skin.outline)

    def searched(self, ablation: Ablation) -> dict[str, Any]:
        """How a search does on every set; by set."""
        found: dict[str, Any] = {}
        for name in (RANDOM, *COUNTED):
            snr_db = 60.0 if name == RANDOM else COUNTED[name][2]
            facts = self._facts("search", ablation, name, snr_db)
            found[name] = self.workspace.kept(facts, partial(self._search, ablation, name, snr_db))
        return found

    def imaged(self, ablation: Ablation) -> dict[str, Any]:
        """MIoU of the image and cost at every SNR, t chosen on tuning scenes at 60 dB; by SNR."""
        threshold = self.workspace.kept(
            self._facts("t", ablation, RANDOM, 60.0), partial(self._threshold, ablation)
        )
        found: dict[str, Any] = {"threshold": threshold}
        for snr_db in IMAGE_SNRS_DB:
            facts = self._facts("image", ablation, RANDOM, snr_db)
            found[f"{snr_db:g}"] = self.workspace.kept(
                facts, partial(self._image, ablation, snr_db, threshold)
            )
        return found

    def _facts(self, part: str, ablation: Ablation, name: str, snr_db: float) -> dict[str, Any]:
        return {
            "part": part,
            "set": name,
            "snr_db": snr_db,
            "share": self.workspace.settings.share,
            **ablation.facts(),
        }

    def session(self, name: str, tuning: bool = False) -> FrameSession:
        """The set ``name``, or its tuning twin."""
        if (name, tuning) not in self._sessions:
            drawn = self._draw(name, tuning)
            role = "tuning" if tuning else "test"
            self._sessions[name, tuning] = session_in_parts(
                self._solver, drawn, self.workspace.progress, f"{name}, {role}"
            )
        return self._sessions[name, tuning]

    def _draw(self, name: str, tuning: bool) -> TouchSet:
        how, outline = self.workspace.settings, self.skin.outline
        seed = how.tuning_seed if tuning else how.seed
        if name == RANDOM:
            return random_touches(outline, seed, how.count(TUNING if tuning else SCENES), "levers")
        touches, spacing, _, usual = COUNTED[name]
        return spaced_touches(outline, seed, how.count(usual), touches, spacing)

    def model(self, ablation: Ablation) -> Model:
        """Return the model of an ablation; ablations of equal settings share one."""
        key = repr(ablation.settings)
        if key not in self._models:
            linear = linearise(
                self.skin,
                self.protocol,
                pixels_across=ablation.settings.pixels_across,
                elements=MODEL_ELEMENTS,
            )
            self._models[key] = make_model(self.skin, self.protocol, linear, ablation.settings)
        return self._models[key]

    def _solve(
        self, ablation: Ablation, session: FrameSession, snr_db: float
    ) -> list[Reconstruction]:
        model, measured = self.model(ablation), session.measured(snr_db)
        options = replace(default_options(model), **ablation.options)
        return list(
            reconstruct_many(model, measured.frames_v[:, -1], measured.untouched_v, options=options)
        )

    def _curves(
        self, ablation: Ablation, session: FrameSession, results: Sequence[Reconstruction]
    ) -> FloatArray:
        grid = self.model(ablation).grid
        image_scorer = metrics.ImageScorer(
            self._raster, metrics.lookup_for(self._raster.points_mm, grid), grid.n_pixels
        )
        return miou_curves(
            image_scorer,
            np.array([one.solver_image for one in results], dtype=np.float64),
            session.truths(self._raster),
        )

    def _threshold(self, ablation: Ablation) -> float:
        session = self.session(RANDOM, tuning=True)
        return best_threshold(self._curves(ablation, session, self._solve(ablation, session, 60.0)))

    def _image(self, ablation: Ablation, snr_db: float, threshold: float) -> dict[str, Any]:
        session = self.session(RANDOM)
        results = self._solve(ablation, session, snr_db)
        values = self._curves(ablation, session, results)[:, THRESHOLDS.index(threshold)]
        return {
            "image": vars(summarise(values.round(DIGITS))),
            "macs": float(np.mean([_macs(one) for one in results])),
        }

    def _search(self, ablation: Ablation, name: str, snr_db: float) -> dict[str, Any]:
        session = self.session(name)
        results, scenes = self._solve(ablation, session, snr_db), session.touches.scenes
        discs = [self._disc_miou(one, scene) for one, scene in zip(results, scenes, strict=True)]
        matchings = [
            match(scene.centres_mm(), _places(one))
            for one, scene in zip(results, scenes, strict=True)
        ]
        errors = [d for m in matchings for d in m.distances_mm]
        strengths = np.array(
            [
                results[k].touches[found].strength_s_per_m_mm2
                / apparent_change_s_per_m_mm2(scenes[k].touches[true], session.sheet_s_per_m)
                for k, m in enumerate(matchings)
                for true, found in m.pairs
            ]
        )
        return {
            "discs": vars(summarise(np.round(discs, DIGITS))),
            "exact": [int(m.exact) for m in matchings],
            "position_mm": vars(summarise(np.round(errors, DIGITS), worst="high")),
            "strength_sd": (
                float(strengths.std() / strengths.mean()) if len(strengths) else float("nan")
            ),
            "unexplained": float(np.median([one.info.unexplained for one in results])),
            "touch_macs": float(np.mean([one.info.touch_macs for one in results])),
            "macs": float(np.mean([_macs(one) for one in results])),
        }

    def _disc_miou(self, one: Reconstruction, scene: TouchScene) -> float:
        points = self._raster.points_mm
        found = metrics.disc_mask(points, _places(one), [touch.radius_mm for touch in one.touches])
        return metrics.miou(found, metrics.disc_mask(points, scene.centres_mm(), scene.radii_mm()))


def _places(one: Reconstruction) -> FloatArray:
    return np.array([(touch.x_mm, touch.y_mm) for touch in one.touches], dtype=np.float64).reshape(
        -1, 2
    )


def _macs(one: Reconstruction) -> int:
    return one.info.macs + one.info.touch_macs
