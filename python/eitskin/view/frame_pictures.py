"""Pictures of reconstructed frames, with the truth that they carry."""

from __future__ import annotations

from math import ceil, sqrt
from pathlib import Path

from eitskin.core.results import Reconstruction
from eitskin.frames.frames import Frames
from eitskin.model.model import Model
from eitskin.scoring.score import FrameScore
from eitskin.view.pictures import Mark, Panel, draw_panels, found_mark

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
    dashed circles.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FileError: the file cannot be written.
    """
    panels = []
    for number, result in list(results.items())[:MAX_PANELS]:
        heading = frames.frame_name[number]
        if number in scores:
            heading += (
                f"\nMIoU {scores[number].miou_image:.2f}, touches {scores[number].miou_touches:.2f}"
            )
        panels.append(Panel(heading, result.image, true_marks(frames, number), found_marks(result)))
    note = "circles: true touches; crosses and dashed circles: found; ellipses: places, 90 %"
    if len(results) > MAX_PANELS:
        note += f"; the first {MAX_PANELS} of {len(results)} frames"
    draw_panels(
        path, model.skin, model.grid, panels, ceil(sqrt(len(panels))), title=title, note=note
    )
