"""Draw reconstructed frames with the truth that they hold."""

from pathlib import Path

from eitskin.core.results import Reconstruction
from eitskin.frames.frames import Frames
from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.scoring.score import FrameScore
from eitskin.view.film import draw_film, thinned
from eitskin.view.panels import draw_panels
from eitskin.view.pictures import Mark, Panel, found_mark

MAX_PANELS = 36


def true_marks(frames: Frames, number: int) -> tuple[Mark, ...]:
    """Return marks for the true touches of frame ``number``. A mark's change is only the touch's
    sign."""
    if frames.touch_xy_mm is None or frames.touch_radius_mm is None:
        return ()
    own, signs = frames.touches_in(number), frames.touch_sign
    sizes = [None] * len(own) if signs is None else signs[own].astype(float).tolist()
    places, radii = frames.touch_xy_mm[own].tolist(), frames.touch_radius_mm[own].tolist()
    return tuple(
        Mark(x, y, radius, size) for (x, y), radius, size in zip(places, radii, sizes, strict=True)
    )


def found_marks(result: Reconstruction) -> tuple[Mark, ...]:
    """Return marks for the found touches."""
    return tuple(map(found_mark, result.touches))


def _panel(heading: str, frames: Frames, number: int, result: Reconstruction) -> Panel:
    return Panel(heading, result.image, true_marks(frames, number), found_marks(result))


def draw_results(
    path: str | Path,
    model: Model,
    frames: Frames,
    results: dict[int, Reconstruction],
    scores: dict[int, FrameScore],
) -> None:
    """Draw a panel for each of the first 36 frames: the image, circles for true touches, and
    crosses with dashed circles for found ones."""
    panels = []
    for number, result in list(results.items())[:MAX_PANELS]:
        heading = frames.frame_name[number]
        if number in scores:
            score = scores[number]
            heading += f"\nMIoU {score.miou_image:.2f}, touches {score.miou_touches:.2f}"
        panels.append(_panel(heading, frames, number, result))
    more = len(results) > MAX_PANELS
    note = f"the first {MAX_PANELS} of {len(results)} frames" if more else ""
    draw_panels(path, model.skin, model.grid, panels, note=note, legend=True)


def film_results(
    path: str | Path,
    model: Model,
    frames: Frames,
    results: dict[int, Reconstruction],
    *,
    progress: Progress = silent,
) -> None:
    """Write a film of images with true and found touches, at the frames' own times, or at ten
    frames per second if they have no times."""
    kept = [list(results)[k] for k in thinned(len(results))]
    panels = [_panel(frames.frame_name[k], frames, k, results[k]) for k in kept]
    times = frames.time_s
    shown = [0.1 * k if times is None else float(times[k]) for k in kept]
    draw_film(path, model, panels, shown, progress=progress)
