"""How the default reconstruction counts touches in worlds that its model knows nothing of."""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from eitskin.errors import FrameError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scoring.matching import match
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.other_worlds.ellipses import (
    DISCS,
    ELLIPSES,
    ellipses_of,
    ellipses_table,
)
from eitskin_studies.experiments.other_worlds.images import image_scores
from eitskin_studies.experiments.other_worlds.tables import (
    conditions,
    fails_table,
    headline_table,
    holds_table,
    images_table,
    summary,
)
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.worlds_pictures import draw_examples, draw_shares
from eitskin_studies.worlds.score import CoreFinder, score_set
from eitskin_studies.worlds.simulate import WorldFactory, WorldScenes
from eitskin_studies.worlds.worlds import WORLDS

TITLE = "Other worlds: touches where the model is wrong"
FAMILY = "judging"
USUAL = 200
BARE = {"row_gains": False, "touch_test": False}
SHOWN = (
    "drift_2_percent_light",
    "five_at_2_5_radii",
    "misplaced_3_mm",
    "ellipses",
    "two_fingers_12_to_16_mm",
    "two_fingers_16_to_24_mm",
)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Every set, by the C core in float32 with the prebuilt model: with default options, and
    without what guards against the model's own errors."""
    settings = workspace.settings
    model, blob = load_prebuilt()
    finder, bare = (CoreFinder(Reconstructor(model, blob=blob)) for _ in range(2))
    bare.solver.set_options(**BARE)
    factory = WorldFactory(model.skin, model.protocol, workspace.folder / "frames")
    count, seed = settings.count(USUAL), settings.seed
    facts = {"model": hashlib.sha256(blob).hexdigest()[:16], "scenes": count, "family": FAMILY}

    def scenes(name: str) -> WorldScenes:
        return factory.scenes(name, count, seed, family=FAMILY, progress=workspace.progress)

    def of_set(name: str, what: str, make: Any) -> Any:
        world = repr(WORLDS[name])
        return workspace.kept({**facts, "set": name, "world": world, "what": what}, make)

    def scored(name: str) -> dict[str, Any]:
        drawn = scenes(name)
        without = score_set(bare, drawn).as_dict()
        images = image_scores(finder, drawn)
        return {**score_set(finder, drawn).as_dict(), "without": without, "images": images}

    scores = [
        of_set(name, "score", lambda name=name: scored(name))
        for name in workspace.progress(list(WORLDS), "sets")
    ]
    examples = {
        name: of_set(name, "example", lambda name=name: _first_wrong(finder, scenes(name)))
        for name in SHOWN
    }
    ellipses = {
        name: of_set(name, "ellipses", lambda name=name: ellipses_of(finder, scenes(name)))
        for name in (*ELLIPSES, *DISCS)
    }
    return ExperimentOutcome(
        tables=(
            images_table(scores),
            fails_table(scores),
            ellipses_table(ellipses),
            holds_table(scores),
            headline_table(scores),
        ),
        data={
            "scores": scores,
            "examples": examples,
            "ellipses": ellipses,
            "seed": seed,
            "scenes": count,
        },
        pictures={
            "shares.svg": Drawing(draw_shares, _shares(scores)),
            "examples.svg": Drawing(
                draw_examples, {"rim_mm": _rim_mm(model.skin), "examples": examples}
            ),
        },
        words={
            "conditions": conditions(settings, count, model.model_errors is not None),
            "summary": summary(scores),
        },
    )


def _shares(scores: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: one[key] for key in ("name", "exact", "false_per_scene")} for one in scores]


def _rim_mm(skin: Skin) -> list[list[float]]:
    places = np.linspace(0, skin.outline.perimeter_mm, 181)
    rim: list[list[float]] = skin.outline.points_at(places).round(1).tolist()
    return rim


def _first_wrong(finder: CoreFinder, of: WorldScenes) -> dict[str, Any]:
    """The first scene that is not exact, or the last: true touches' rims and found discs."""
    example: dict[str, Any] = {}
    for scene, *measured in zip(of.scenes, of.untouched_v, of.frames_v, of.step_v, strict=True):
        try:
            found = finder(*measured)
        except FrameError:
            found = ()
        discs = [(t.x_mm, t.y_mm, t.radius_mm) for t in found]
        example = {
            "name": scene.name,
            "rims_mm": [touch.rim_mm().round(1).tolist() for touch in scene.touches],
            "found_mm": [[round(float(value), 1) for value in disc] for disc in discs],
        }
        if not match(scene.centres_mm(), [disc[:2] for disc in discs]).exact:
            break
    return example
