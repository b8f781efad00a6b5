"""Draw a board's frames: one frame at large, or a panel per frame."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from eitskin.model.model import Model
from eitskin.progress import Progress, silent
from eitskin.session.frame import Frame
from eitskin.view.film import MAX_FRAMES, draw_film
from eitskin.view.panels import draw_frame, draw_panels
from eitskin.view.pictures import Mark, Panel, found_mark

MAX_PANELS = 36
MAX_KEPT = 20 * MAX_PANELS


class Album:
    """Keeps frames for a picture: all of them, or for a long stream evenly spaced ones and the
    last."""

    def __init__(self) -> None:
        self._kept: list[Frame] = []
        self._step, self.count = 1, 0  # every how many frames one is kept; how many were added
        self._last: Frame | None = None

    def add(self, frame: Frame) -> None:
        if self.count % self._step == 0:
            self._kept.append(frame)
            if len(self._kept) >= MAX_KEPT:
                self._kept, self._step = self._kept[::2], 2 * self._step
        self.count += 1
        self._last = frame

    def spread(self, most: int = MAX_PANELS) -> list[Frame]:
        """Return at most ``most`` (up to 360) frames, evenly spaced, including the first and the
        last."""
        if self._last is None or self._kept[-1] is self._last:
            return _spread(self._kept, most)
        return _spread([*self._kept, self._last], most)


def draw_stream(path: str | Path, model: Model, album: Album, *, title: str) -> None:
    """Write the album as a picture: circles are true touches, crosses found ones, and dashed
    circles the sizes of found touches.

    Raises:
        UsageError: the suffix is not that of a picture.
        MissingExtraError: matplotlib is not installed.
    """
    frames = album.spread()
    panels = [_panel(model, frame) for frame in frames]
    if len(panels) == 1:
        one = panels[0]
        values = np.zeros(model.grid.n_pixels) if one.values is None else one.values
        skin, grid = model.skin, model.grid
        draw_frame(path, skin, grid, values, truth=one.truth, found=one.found, title=title)
        return
    thinned = album.count > len(frames)
    note = f"{len(frames)} of {album.count} frames" if thinned else ""
    draw_panels(path, model.skin, model.grid, panels, title=title, note=note, legend=True)


def film_stream(
    path: str | Path,
    model: Model,
    album: Album,
    *,
    progress: Progress = silent,
) -> None:
    """Write the album as a film.

    Raises:
        UsageError: the suffix is not that of a film.
        MissingExtraError: matplotlib or pillow is not installed.
    """
    frames = album.spread(MAX_FRAMES)
    times_s = [frame.time_s for frame in frames]
    draw_film(path, model, [_panel(model, frame) for frame in frames], times_s, progress=progress)


def _panel(model: Model, frame: Frame) -> Panel:
    return Panel(
        f"frame {frame.number}, {frame.time_s:.2f} s",
        frame.image,
        _true_marks(model, frame),
        _found_marks(frame),
    )


def _true_marks(model: Model, frame: Frame) -> tuple[Mark, ...]:
    conductivity = model.skin.conductivity_s_per_m
    return tuple(
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1) * conductivity) for t in frame.true or ()
    )


def _found_marks(frame: Frame) -> tuple[Mark, ...]:
    if frame.has_touches:
        return tuple(map(found_mark, frame.touches))
    places = frame.places_mm
    return () if places is None else tuple(Mark(float(x), float(y)) for x, y in places)


def _spread(frames: Sequence[Frame], most: int) -> list[Frame]:
    """Return at most ``most`` of ``frames``, evenly spaced, including the first and the last."""
    if len(frames) <= most:
        return list(frames)
    return [frames[round(k * (len(frames) - 1) / (most - 1))] for k in range(most)]
