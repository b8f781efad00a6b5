"""Image MIoU in other worlds: of the image that is shown, and of the solver's."""

from typing import Any

import numpy as np

from eitskin.errors import FrameError
from eitskin.scoring.metrics import DRAWN_THRESHOLD, judge_for
from eitskin_studies.harness.summary import summarise
from eitskin_studies.harness.thresholds import miou_curves
from eitskin_studies.worlds.score import CoreFinder
from eitskin_studies.worlds.simulate import WorldScenes

DIGITS = 4


def image_scores(finder: CoreFinder, of: WorldScenes) -> dict[str, dict[str, float]] | None:
    """Mean MIoU, its 95 % interval and the mean of the worst 10 % of the images "shown" and
    "solver" over the scenes of a set; None if nothing touches the skin. A rejected frame shows
    nothing. The threshold of an image that is drawn of touches is DRAWN_THRESHOLD, that of a
    solver's image is the model's own."""
    if not any(scene.touches for scene in of.scenes):
        return None
    model = finder.solver.model
    scorer, usual = judge_for(model.skin.outline, model.grid), model.defaults.mask_threshold
    nothing = np.zeros(model.grid.n_pixels)
    finder.look_for(of.world.sign)
    found: dict[str, list[float]] = {"shown": [], "solver": []}
    for scene, *measured in zip(of.scenes, of.untouched_v, of.frames_v, of.step_v, strict=True):
        truth = scene.mask(scorer.raster.points_mm)[None]
        sign = -1 if scene.touches and scene.touches[0].contrast < 1 else 1
        images = {"shown": (nothing, usual), "solver": (nothing, usual)}
        try:
            finder(*measured)
        except FrameError:
            pass
        else:
            result = finder.result
            drawn = result.image_is == "touches"
            images["shown"] = (np.asarray(result.image), DRAWN_THRESHOLD if drawn else usual)
            images["solver"] = (np.asarray(result.solver_image), usual)
        for name, (image, t) in images.items():
            found[name].append(float(miou_curves(scorer, image[None], truth, [t], sign)[0, 0]))
    return {name: _numbers(values) for name, values in found.items()}


def _numbers(values: list[float]) -> dict[str, float]:
    of = summarise(values)
    named: dict[str, Any] = {
        "mean": of.mean, "low": of.low, "high": of.high, "worst_tenth": of.worst_tenth,
    }  # fmt: skip
    return {name: round(float(value), DIGITS) for name, value in named.items()}
