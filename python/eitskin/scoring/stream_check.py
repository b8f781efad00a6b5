"""Summarise the frames of a board and compare them with the truth if it is known: touches, places
in images, and raw rows."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics import words
from eitskin.core.results import force_text, solve_text
from eitskin.device.known_model import KnownModel
from eitskin.device.live_frames import LiveFrame
from eitskin.device.wire.explain import quality_text
from eitskin.errors import MissingExtraError
from eitskin.scene.random_touches import TrueTouch
from eitskin.scoring.image_touches import touches_in_image
from eitskin.scoring.scene_truth import SceneTruth, TruthScore


@dataclass(frozen=True, eq=False)
class ImageView:
    """The summary of an image: its ``peak`` in S/m at ``peak_mm``, and ``places_mm`` (k, 2), the
    centroids of its components, strongest first.

    They are found by ``image_touches`` with the model's threshold for touches, or are None if scipy
    is not installed.
    """

    peak: float
    peak_mm: tuple[float, float]
    places_mm: FloatArray | None


@dataclass(frozen=True, eq=False)
class ComparedFrame:
    """A frame compared with the truth.

    ``true`` are the touches that were there, or None if no truth is known. ``errors_mm`` are the
    position errors by the number of the found touch, or of the image's place in a frame without
    touches.
    """

    frame: LiveFrame
    view: ImageView | None = None
    true: tuple[TrueTouch, ...] | None = None
    errors_mm: dict[int, float] | None = None

    @property
    def found_mm(self) -> FloatArray | None:
        """The found places (k, 2), or None if the frame has none."""
        if self.frame.touches is not None:
            return np.array(
                [(t.x_mm, t.y_mm) for t in self.frame.touches.touches], dtype=np.float64
            ).reshape(-1, 2)
        return None if self.view is None else self.view.places_mm


class Watcher:
    """Compares frames with the truth, and sums the errors in ``score``."""

    def __init__(self, known: KnownModel | None, truth: SceneTruth | None) -> None:
        self.known, self._truth = known, truth
        self.score = TruthScore()

    def see(self, frame: LiveFrame) -> ComparedFrame:
        """Return ``frame`` compared with the truth."""
        view = None
        if frame.image is not None and self.known is not None and not frame.refused:
            view = image_view(self.known, frame.image.image)
        seen = ComparedFrame(frame, view)
        found = seen.found_mm
        if self._truth is None or found is None or frame.refused:
            return seen
        true = self._truth.touches(frame.board_us)
        matching = self._truth.matching(true, found)
        self.score.add(matching)
        errors = {
            number: d for (_, number), d in zip(matching.pairs, matching.distances_mm, strict=True)
        }
        return ComparedFrame(frame, view, true, errors)


def image_view(known: KnownModel, image: npt.NDArray[np.float32]) -> ImageView:
    """Return the summary of an image (n,)."""
    grid, model = known.model.grid, known.model
    values, centres = np.asarray(image, dtype=np.float64), grid.centres_mm()
    top = int(np.argmax(np.abs(values)))
    places: FloatArray | None = np.zeros((0, 2))
    if values[top] != 0:
        try:
            sign = 1 if values[top] > 0 else -1
            places = touches_in_image(
                values, grid.index, centres, model.defaults.touch_threshold, sign
            )
        except MissingExtraError:
            places = None
    return ImageView(float(values[top]), (float(centres[top, 0]), float(centres[top, 1])), places)


def line(seen: ComparedFrame, *, solver: bool = True) -> str:
    """Return a line of text for a frame, with the solver's information if ``solver`` is set."""
    frame = seen.frame
    parts = [_touches_text(seen), _image_text(seen), _raw_text(frame)]
    if solver:
        parts.append(_solve_text(frame))
    if frame.refused:
        parts = [f"refused: {frame.refused}", _raw_text(frame)]
    text = "; ".join(part for part in (*parts, _found_text(frame)) if part)
    return f"{frame.number:7d} {frame.time_us / 1e6:9.3f} s  {text}"


def _solve_text(frame: LiveFrame) -> str:
    solved = frame.solved
    if solved is None:
        return ""
    macs, time_us = solved.macs + solved.touch_macs, solved.solve_us + solved.touch_us
    return solve_text(solved.iterations, solved.stop, solved.gap_rel, macs, time_us)


def _found_text(frame: LiveFrame) -> str:
    return "" if frame.solved is None else ", ".join(words(frame.solved))


def _error(seen: ComparedFrame, number: int) -> str:
    if seen.errors_mm is None:
        return ""
    return f", off by {seen.errors_mm[number]:.2f} mm" if number in seen.errors_mm else ", false"


def _touches_text(seen: ComparedFrame) -> str:
    if seen.frame.touches is None:
        return ""
    found = [
        f"#{t.id} ({t.x_mm:.1f}, {t.y_mm:.1f}) mm, radius {t.radius_mm:.1f} mm,"
        f" {t.strength_s_per_m_mm2:.2f} S/m"
        f" mm2{', ' + force_text(t.force_n) if t.force_n else ''}{_error(seen, k)}"
        for k, t in enumerate(seen.frame.touches.touches)
    ]
    return " | ".join(found) or "no touch"


def _image_text(seen: ComparedFrame) -> str:
    if seen.frame.image is None:
        return ""
    if seen.view is None:
        return f"image of {len(seen.frame.image.image)} pixels"
    view = seen.view
    if view.peak == 0:
        return "image: flat"
    text = f"image: peak {view.peak:.4f} S/m at ({view.peak_mm[0]:.1f}, {view.peak_mm[1]:.1f}) mm"
    if view.places_mm is None or seen.frame.touches is not None:
        return text
    places = (f"({x:.1f}, {y:.1f}) mm{_error(seen, k)}" for k, (x, y) in enumerate(view.places_mm))
    return f"{text}; places " + " | ".join(places)


def _raw_text(frame: LiveFrame) -> str:
    if frame.raw is None:
        return ""
    volts = frame.raw.voltage_v.astype(np.float64)
    usable = volts[np.isfinite(volts)]
    rms = 1e3 * float(np.sqrt(np.mean(usable**2))) if len(usable) else 0.0
    text = f"raw: {len(volts)} rows in {frame.raw.scan_us / 1e3:.2f} ms, rms {rms:.3f} mV"
    if len(usable) < len(volts):
        text += f", {len(volts) - len(usable)} not usable"
    reasons = Counter(quality_text(int(quality)) for quality in frame.raw.quality if quality)
    return text + "".join(f", {count} {what}" for what, count in reasons.items())


def spread(frames: Sequence[ComparedFrame], most: int) -> list[ComparedFrame]:
    """Return at most ``most`` of ``frames``, evenly spaced, including the first and the last."""
    if len(frames) <= most:
        return list(frames)
    return [frames[round(k * (len(frames) - 1) / (most - 1))] for k in range(most)]
