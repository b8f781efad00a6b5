"""Score how well a reconstruction agrees with the truth that its frames hold."""

from dataclasses import dataclass

import numpy as np

from eitskin.arrays import AnyArray, BoolArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Reconstruction
from eitskin.frames.frames import Frames
from eitskin.model.model import Model
from eitskin.scoring import metrics
from eitskin.scoring.matching import GATE_MM, WANTED_SIGNS, Matching, match
from eitskin.skin.skin import size_to_paper


@dataclass(frozen=True)
class FrameScore:
    """The score of a frame: the MIoU of the mask x > t max(x) of the image that shows it and of the
    solver's image, interpolated bilinearly; the MIoU of the touches as discs; and the matching of
    found and true touches. For the solver's image t is the model's own, for drawn touches
    ``DRAWN_THRESHOLD``."""

    miou_image: float
    miou_solver: float
    miou_touches: float
    matching: Matching

    @property
    def errors_mm(self) -> dict[int, float]:
        """The position error of each found touch that matches a true one, by the number of the
        found touch."""
        found = (k for _, k in self.matching.pairs)
        return dict(zip(found, self.matching.distances_mm, strict=True))


@dataclass(frozen=True, eq=False)
class Scorer:
    """Scores the frames of one model. ``gate_mm`` is the greatest distance from a touch to its true
    one."""

    model: Model
    image_scorer: metrics.ImageScorer
    gate_mm: float

    def score(
        self, frames: Frames, number: int, result: Reconstruction, sign: str
    ) -> FrameScore | None:
        """Return the score of frame ``number`` of ``frames``, or None if no truth of the wanted
        ``sign`` is known."""
        wanted = WANTED_SIGNS[sign]
        places = [i for i in frames.touches_in(number) if _sign_of(frames, i) in wanted]
        truth = self._truth(frames, number, wanted, places)
        if truth is None:
            return None
        solved = self._miou(result.solver_image, truth, sign, self.model.defaults.mask_threshold)
        shown = solved
        if result.touch_image is not None:
            shown = self._miou(result.touch_image, truth, sign, metrics.DRAWN_THRESHOLD)
        discs = self._discs(result.touches)
        true_mm = np.zeros((0, 2)) if frames.touch_xy_mm is None else frames.touch_xy_mm[places]
        found_mm = [(touch.x_mm, touch.y_mm) for touch in result.touches]
        return FrameScore(
            shown,
            solved,
            metrics.miou(discs, truth),
            match(true_mm, np.array(found_mm), self.gate_mm),
        )

    def _miou(self, image: AnyArray, truth: BoolArray, sign: str, threshold: float) -> float:
        values = np.asarray(image, dtype=np.float64)
        values = np.abs(values) if sign == "both" else values * WANTED_SIGNS[sign][0]
        mask = metrics.touch_mask(self.image_scorer.lookup.show(values), threshold)
        return float(metrics.miou(mask, truth))

    def _discs(self, touches: tuple[Touch, ...]) -> BoolArray:
        centres = np.array([(touch.x_mm, touch.y_mm) for touch in touches]).reshape(-1, 2)
        radii = np.array([touch.radius_mm for touch in touches])
        return metrics.disc_mask(self.image_scorer.raster.points_mm, centres, radii)

    def _truth(
        self, frames: Frames, number: int, wanted: tuple[int, ...], places: list[int]
    ) -> BoolArray | None:
        points = self.image_scorer.raster.points_mm
        if frames.truth_mask is not None and frames.truth_mask_extent_mm is not None:
            mask = np.isin(frames.truth_mask[number], wanted)
            if not mask.any():
                return None
            return metrics.mask_on_points(points, mask, frames.truth_mask_extent_mm)
        xy_mm, radius_mm = frames.touch_xy_mm, frames.touch_radius_mm
        if xy_mm is None or radius_mm is None or not places:
            return None
        return metrics.disc_mask(points, xy_mm[places], radius_mm[places])


def _sign_of(frames: Frames, touch: int) -> int:
    """Return the sign of a touch; an unknown sign counts as conductive, the usual one."""
    sign = 0 if frames.touch_sign is None else int(frames.touch_sign[touch])
    return sign or 1


def scorer_for(model: Model) -> Scorer:
    """Return the scorer on the model's own skin: a raster of 1.5 mm and a gate of 10 mm on the
    paper's skin, in proportion to the size of other skins."""
    outline = model.skin.outline
    scale = size_to_paper(outline)
    image_scorer = metrics.judge_for(outline, model.grid, metrics.RASTER_MM * scale)
    return Scorer(model, image_scorer, GATE_MM * scale)
