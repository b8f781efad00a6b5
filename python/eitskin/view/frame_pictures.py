"""Pictures of reconstructed frames, with the truth that they carry."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from eitskin.core.results import Reconstruction
from eitskin.frames.frames import Frames
from eitskin.model.model import Model
from eitskin.scoring.score import FrameScore
from eitskin.view.film import draw_film, thinned
from eitskin.view.panels import draw_panels
from eitskin.view.pictures import Mark, Panel, found_mark

MAX_PANELS = 36


def true_marks(frames: Frames, number: int) -> tuple[Mark, ...]:
    """The true touches of frame ``number``; their change is drawn by sign."""
    if frames.touch_xy_mm is None or frames.touch_radius_mm is None:
        return ()
    signs = frames.touch_sign
    return tuple(
        Mark(
            float(frames.touch_xy_mm[i, 0]),
            float(frames.touch_xy_mm[i, 1]),
            float(frames.touch_radius_mm[i]),
            None if signs is None else float(signs[i]),
        )
        for i in frames.touches_in(number)
    )


def found_marks(result: Reconstruction) -> tuple[Mark, ...]:
    """What was found."""
    return tuple(map(found_mark, result.touches))


def draw_results(
    path: str | Path,
    model: Model,
    frames: Frames,
    results: dict[int, Reconstruction],
    scores: dict[int, FrameScore],
    *,
    title: str = "",
) -> None:
    """A panel a frame, the first 36: image, true touches as circles, found ones as crosses and
    dashed circles."""
    panels = []
    for number, result in list(results.items())[:MAX_PANELS]:
        heading = frames.frame_name[number]
        if number in scores:
            heading += (
                f"\nMIoU {scores[number].miou_image:.2f}, touches {scores[number].miou_touches:.2f}"
            )
        panels.append(Panel(heading, result.image, true_marks(frames, number), found_marks(result)))
    more = len(results) > MAX_PANELS
    note = f"the first {MAX_PANELS} of {len(results)} frames" if more else ""
    draw_panels(path, model.skin, model.grid, panels, title=title, note=note, legend=True)


def film_results(
    path: str | Path,
    model: Model,
    frames: Frames,
    results: dict[int, Reconstruction],
    *,
    progress: Callable[..., Iterable[Any]] = lambda items, _: items,
) -> None:
    """Image, true and found touches frame by frame, in the frames' time, or ten a second where they
    have none."""
    kept = [list(results)[k] for k in thinned(len(results))]
    panels = [
        Panel(
            frames.frame_name[number],
            results[number].image,
            true_marks(frames, number),
            found_marks(results[number]),
        )
        for number in kept
    ]
    times = frames.time_s
    shown = [0.1 * k if times is None else float(times[k]) for k in kept]
    draw_film(path, model, panels, shown, progress=progress)
