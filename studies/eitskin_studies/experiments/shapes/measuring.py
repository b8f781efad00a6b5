"""The measurement of one shape: its model, random touches on it, and the touches that were
found."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eitskin.model.build import BuildSettings, Linearisation, linearise, make_model
from eitskin.scene.random_touches import TouchScene, TouchSet, random_touches, rim_distance_mm
from eitskin.scoring import metrics
from eitskin.scoring.matching import GATE_MM
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.solve.batch import reconstruct_many
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.scored import Evaluator, session_in_parts
from eitskin_studies.experiments.shapes.variants import ShapeVariant
from eitskin_studies.harness.sessions import FrameSession, SceneSolver
from eitskin_studies.harness.thresholds import miou_curves

SNR_DB = 60.0
TUNING, TEST = 40, 160
RANKS = {16: 64, 32: 128}


@dataclass(eq=False)
class Maker:
    """A variant's meshes, model and frames, each made when first asked for: a run that finds every
    result makes none."""

    workspace: Workspace
    variant: ShapeVariant

    @cached_property
    def protocol(self) -> Protocol:
        """Adjacent drive and measurement."""
        return adjacent(self.variant.skin.electrodes.count)

    @cached_property
    def linear(self) -> Linearisation:
        """The model's Jacobian."""
        return linearise(self.variant.skin, self.protocol, elements=MODEL_ELEMENTS)

    @cached_property
    def evaluator(self) -> Evaluator:
        """The model and its judge, lengths in proportion to the skin."""
        settings = BuildSettings(
            rank=RANKS[self.variant.skin.electrodes.count], elements=MODEL_ELEMENTS
        )
        model, scale = (
            make_model(self.variant.skin, self.protocol, self.linear, settings),
            self.variant.scale,
        )
        image_scorer = metrics.judge_for(
            self.variant.skin.outline, model.grid, metrics.RASTER_MM * scale
        )
        return Evaluator(model, image_scorer, GATE_MM * scale)

    @cached_property
    def tuning(self) -> TouchSet:
        """Scenes to choose t on."""
        return self._drawn("shapes train", self.workspace.settings.tuning_seed, TUNING)

    @cached_property
    def test(self) -> TouchSet:
        """Scenes to report."""
        return self._drawn("shapes test", self.workspace.settings.seed, TEST)

    def _drawn(self, role: str, seed: int, usual: int) -> TouchSet:
        count = self.workspace.settings.count(usual)
        return random_touches(self.variant.skin.outline, seed, count, role, self.variant.rules)

    def session(self, drawn: TouchSet) -> FrameSession:
        """Its frames."""
        return session_in_parts(
            self._solver,
            drawn,
            self.workspace.progress,
            f"{self.variant.name.replace(',', '')} {drawn.role}",
        )

    @cached_property
    def _solver(self) -> SceneSolver:
        return self.workspace.scenes(self.variant.skin, self.protocol)

    def measured(self) -> dict[str, Any]:
        """Everything of the shape in plain values: ``t``, ``scores`` of the test scenes, and
        ``about`` skin and model."""
        workspace = self.workspace
        t = workspace.kept(self._facts("threshold", self.tuning), self._threshold)
        scores = workspace.kept(
            {**self._facts("scores", self.test), "t": t}, lambda: self._scores(t)
        )
        return {
            "t": t,
            "scores": scores,
            "about": workspace.kept(self._facts("about", self.test), self._about),
        }

    def _facts(self, what: str, drawn: TouchSet) -> dict[str, Any]:
        skin = self.variant.skin
        place = {
            "skin": skin.name,
            "outline": repr(skin.outline),
            "electrodes": repr(skin.electrodes),
        }
        return {
            "shapes": what,
            **place,
            "set": drawn.name,
            "rules": repr(self.variant.rules),
            "snr_db": SNR_DB,
        }

    def _variety(self, scene: TouchScene) -> tuple[int, int]:
        """In how many regions a scene's touches lie, and how many they are; the picture shows the
        first of the richest."""
        return len(set(self.variant.regions(scene.centres_mm(), 50.0 * self.variant.scale))), len(
            scene.touches
        )

    def _threshold(self) -> float:
        measured = self.session(self.tuning).measured(SNR_DB)
        return self.evaluator.threshold(
            self.tuning.scenes, measured.untouched_v, measured.frames_v[:, -1]
        )

    def _scores(self, t: float) -> dict[str, Any]:
        measured = self.session(self.test).measured(SNR_DB)
        return self.evaluator.scores(
            self.test.scenes, measured.untouched_v, measured.frames_v[:, -1], t
        )

    def _about(self) -> dict[str, Any]:
        model, image_scorer, scenes = (
            self.evaluator.model,
            self.evaluator.image_scorer,
            self.test.scenes,
        )
        norm = np.linalg.norm(self.linear.jacobian, axis=0)
        perfect = np.array(
            [pixel_cover(model.grid, scene.centres_mm(), scene.radii_mm()) for scene in scenes]
        )
        session = self.session(self.test)
        chosen = max(range(len(scenes)), key=lambda k: self._variety(scenes[k]))
        measured = session.measured(SNR_DB)
        one = reconstruct_many(
            model, measured.frames_v[chosen : chosen + 1, -1], measured.untouched_v, threads=1
        )[0]
        return {
            "rms_v0_mv": 1e3 * float(np.sqrt(np.mean(session.exact_untouched_v**2))),
            "pixels": model.grid.n_pixels,
            "pixel_mm": model.grid.pixel_mm,
            "rank": model.rank,
            "deepest_mm": float(
                rim_distance_mm(self.variant.skin.outline, model.grid.centres_mm()).max()
            ),
            "sensitivity_log10": np.log10(norm / norm.max()).round(3).tolist(),
            "ceiling": float(
                miou_curves(image_scorer, perfect, self.evaluator.truths(scenes), [0.5]).mean()
            ),
            "scene_image": [float(f"{value:.4g}") for value in one.image],
            "scene_found": [[t.x_mm, t.y_mm, t.radius_mm] for t in one.touches],
            "scene_true": [[t.x_mm, t.y_mm, t.radius_mm] for t in scenes[chosen].touches],
        }
