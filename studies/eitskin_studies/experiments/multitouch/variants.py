"""The methods that count: this project's core in some variants, and two usual ones whose images are
read by one rule."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.errors import FrameError
from eitskin.model.build import BuildSettings
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.solve.batch import Batch
from eitskin.solve.image_touches import touches_in_image
from eitskin_studies.compare.families import Family, Method
from eitskin_studies.harness.sessions import MeasuredFrames
from eitskin_studies.harness.thresholds import best_touch_threshold, match_all

TOUCH_THRESHOLDS = tuple(round(0.1 * k, 1) for k in range(1, 10))
DIGITS = 5


@dataclass(frozen=True)
class TouchVariant:
    """The core with a model of ``settings``, and ``options`` that differ from the model's own."""

    name: str
    settings: BuildSettings = field(default_factory=BuildSettings)
    options: Mapping[str, Any] = field(default_factory=dict)

    def facts(self) -> dict[str, Any]:
        """All that a result depends on."""
        return {
            "variant": self.name,
            "settings": repr(self.settings),
            "options": repr(sorted(self.options.items())),
        }


# the first is what is usual: pictures and the doubt are of it
VARIANTS = (
    TouchVariant("default"),
    TouchVariant("peaks alone", options={"touch_fit": 0}),
    TouchVariant("log-ratio", BuildSettings(data_kind="log-ratio")),
)


@dataclass(frozen=True)
class SeenFrame:
    """The core's result for a frame: a list's place k is found touch k. ``clear``: max(S'y) over
    that of noise."""

    x_mm: list[float]
    y_mm: list[float]
    radius_mm: list[float]
    strength: list[float]
    explained: list[float]
    said: bool
    unexplained: float
    clear: float
    solve_macs: int
    touch_macs: int

    @property
    def places_mm(self) -> FloatArray:
        """(t, 2)."""
        return np.array([self.x_mm, self.y_mm], dtype=np.float64).T.reshape(-1, 2)

    @property
    def macs(self) -> int:
        """In all."""
        return self.solve_macs + self.touch_macs


def solve(model: Model, variant: TouchVariant, measured: MeasuredFrames) -> list[SeenFrame]:
    """Each frame by itself, in float32, as on the board.

    Raises:
        FrameError: a frame cannot be used.
    """
    from dataclasses import replace

    batch = Batch(model, threads=1, options=replace(default_options(model), **variant.options))
    batch.tare(measured.untouched_v)
    seen = []
    for result in batch.each(measured.frames_v[:, -1]):
        if isinstance(result, FrameError):
            raise result
        info, touches = result.info, result.touches
        clear = info.lambda_max / info.lambda_noise if info.lambda_noise > 0 else 0.0
        seen.append(SeenFrame(
            [round(t.x_mm, DIGITS) for t in touches],
            [round(t.y_mm, DIGITS) for t in touches],
            [round(t.radius_mm, DIGITS) for t in touches],
            [round(abs(t.strength_s_per_m_mm2), DIGITS) for t in touches],
            [float(f"{t.explained:.5g}") for t in touches],
            "crowded" in info.diagnostics_by_name,
            float(f"{info.unexplained:.5g}"),
            float(f"{clear:.5g}"),
            info.macs,
            info.touch_macs,
        ))  # fmt: skip
    return seen


@dataclass(frozen=True)
class TrainedMethod:
    """The settings that tuning scenes chose for a classical method: its parameter, and t' of the
    rule that reads touches off its image."""

    value: float
    threshold: float


def differences_v(measured: MeasuredFrames) -> FloatArray:
    """Frames less the mean of the untouched ones, (k, m)."""
    return np.asarray(measured.frames_v[:, -1] - measured.untouched_v.mean(axis=0))


def train(
    family: Family,
    frames_v: FloatArray,
    truths_mm: Sequence[FloatArray],
    index: IntArray,
    centres_mm: FloatArray,
) -> TrainedMethod:
    """The parameter and the threshold that together count most scenes exactly; of equals, most hits
    less false touches."""
    best, best_score = TrainedMethod(family.values[0], TOUCH_THRESHOLDS[0]), (-1, 0)
    for value in family.values:
        images = np.asarray(family.make(value).reconstruct(frames_v), dtype=np.float64)
        threshold = best_touch_threshold(images, truths_mm, index, centres_mm, TOUCH_THRESHOLDS)
        found = [touches_in_image(image, index, centres_mm, threshold) for image in images]
        matchings = match_all(truths_mm, found)
        score = (sum(m.exact for m in matchings), sum(m.hits - m.false_touches for m in matchings))
        if score > best_score:
            best, best_score = TrainedMethod(value, threshold), score
    return best


def read_images(
    method: Method,
    frames_v: FloatArray,
    threshold: float,
    index: IntArray,
    centres_mm: FloatArray,
) -> list[FloatArray]:
    """Places (t, 2) in mm that a method's images show."""
    images = np.asarray(method.reconstruct(frames_v), dtype=np.float64)
    return [touches_in_image(image, index, centres_mm, threshold) for image in images]
