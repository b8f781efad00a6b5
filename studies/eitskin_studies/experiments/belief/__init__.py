"""Check the core's statements about its touches: the confidence of each, its place, and whether the
count is uncertain."""

import hashlib
from typing import Any

from eitskin.errors import FrameError
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scoring.matching import match
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.belief.tables import (
    HIGH,
    LOW,
    Sets,
    conditions,
    counts_table,
    coverage,
    curve,
    curve_table,
    places_table,
    summary,
)
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.multitouch.counts import Share
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.belief_picture import draw_belief
from eitskin_studies.worlds.score import CoreFinder
from eitskin_studies.worlds.simulate import WorldFactory, WorldScenes
from eitskin_studies.worlds.worlds import WORLDS

TITLE = "Belief: is what the core says of its touches true?"
FAMILY = "judging"
USUAL = 100
DIGITS = 5


def run(workspace: Workspace) -> ExperimentOutcome:
    """Every set of other worlds, by the C core in float32 with the prebuilt model."""
    settings = workspace.settings
    model, blob = load_prebuilt()
    finder = CoreFinder(Reconstructor(model, blob=blob))
    factory = WorldFactory(model.skin, model.protocol, workspace.folder / "frames")
    count, seed = settings.count(USUAL), settings.seed
    facts = {"model": hashlib.sha256(blob).hexdigest()[:16], "scenes": count, "family": FAMILY}

    def seen(name: str) -> list[dict[str, Any]]:
        drawn = factory.scenes(name, count, seed, family=FAMILY, progress=workspace.progress)
        return frames_of(finder, drawn)

    def kept(name: str) -> Any:
        return workspace.kept(
            {**facts, "set": name, "world": repr(WORLDS[name])}, lambda: seen(name)
        )

    sets = {name: kept(name) for name in workspace.progress(list(WORLDS), "sets")}
    return ExperimentOutcome(
        tables=(curve_table(sets), places_table(sets), counts_table(sets)),
        data={"sets": sets, "seed": seed, "scenes": count},
        pictures={"belief.svg": Drawing(draw_belief, _drawn(sets))},
        words={"conditions": conditions(settings, count), "summary": summary(sets)},
    )


def _drawn(sets: Sets) -> dict[str, Any]:
    """Return the content of the picture: the curve, and the coverage of sets in which touches were
    found."""
    shares = {name: coverage(frames) for name, frames in sets.items()}
    return {
        "curve": [[part.said, _numbers(part.true)] for part in curve(sets)],
        "covered": {name: _numbers(one) for name, one in shares.items() if one.count},
        "band": [LOW, HIGH],
    }


def _numbers(of: Share) -> list[float]:
    return [of.mean, of.low, of.high]


def frames_of(finder: CoreFinder, of: WorldScenes) -> list[dict[str, Any]]:
    """Return for each scene that was not rejected how many touches there are (``true``), whether it
    is said to be crowded, and of each found touch whether it is a true one, its confidence, its
    distance from the true place in mm and that over what it is said to be (Mahalanobis, squared);
    None if that is not known."""
    finder.look_for(of.world.sign)
    frames = []
    for scene, *measured in zip(of.scenes, of.untouched_v, of.frames_v, of.step_v, strict=True):
        try:
            found = finder(*measured)
        except FrameError:
            continue
        pairs = match(scene.centres_mm(), [(t.x_mm, t.y_mm) for t in found]).pairs
        owner = {j: scene.touches[i] for i, j in pairs}
        touches = []
        for j, touch in enumerate(found):
            distance = deviation = None
            if j in owner:
                x, y = owner[j].x_mm - touch.x_mm, owner[j].y_mm - touch.y_mm
                distance = round(float(x * x + y * y) ** 0.5, DIGITS)
                xx, xy, yy = touch.x_variance_mm2, touch.xy_covariance_mm2, touch.y_variance_mm2
                if xx is not None and xy is not None and yy is not None:
                    square = (yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
                    deviation = round(float(square), DIGITS)
            sure = None if touch.confidence is None else round(touch.confidence, DIGITS)
            touches.append([j in owner, sure, distance, deviation])
        crowded = "crowded" in finder.diagnostics
        frames.append({"true": len(scene.touches), "crowded": crowded, "touches": touches})
    return frames
