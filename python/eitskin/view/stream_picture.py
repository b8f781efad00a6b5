"""A board's frames as a picture: one frame at large, or a panel a frame."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.model.model import Model
from eitskin.scoring.stream_check import ComparedFrame, spread
from eitskin.view.film import MAX_FRAMES, draw_film
from eitskin.view.panels import draw_frame, draw_panels
from eitskin.view.pictures import Mark, Panel, found_mark

MAX_PANELS = 36
MAX_KEPT = 20 * MAX_PANELS


class Album:
    """Keeps frames for a picture: all of them, or of a long stream evenly spaced ones and the
    last."""

    def __init__(self) -> None:
        self._kept: list[ComparedFrame] = []
        self._step, self._count = 1, 0
        self._last: ComparedFrame | None = None

    def add(self, seen: ComparedFrame) -> None:
        if self._count % self._step == 0:
            self._kept.append(seen)
            if len(self._kept) >= MAX_KEPT:
                self._kept, self._step = self._kept[::2], 2 * self._step
        self._count += 1
        self._last = seen

    @property
    def frames(self) -> list[ComparedFrame]:
        """At most 36, the first and the last among them."""
        return self.spread(MAX_PANELS)

    def spread(self, most: int) -> list[ComparedFrame]:
        """At most ``most`` (up to 360), evenly spaced, the first and the last among them."""
        kept = (
            self._kept
            if self._last is None or self._kept[-1] is self._last
            else [*self._kept, self._last]
        )
        return spread(kept, most)

    @property
    def count(self) -> int:
        """How many were added."""
        return self._count


def draw_stream(path: str | Path, model: Model, album: Album, *, title: str) -> None:
    """The album as a PNG: circles are true touches, crosses what was found, dashed circles the
    found touches' sizes."""
    frames = album.frames
    if len(frames) == 1:
        seen = frames[0]
        values = (
            np.zeros(model.grid.n_pixels) if seen.frame.image is None else seen.frame.image.image
        )
        draw_frame(
            path,
            model.skin,
            model.grid,
            values,
            truth=_true_marks(model, seen),
            found=_found_marks(seen),
            title=title,
        )
        return
    panels = [_panel(model, seen) for seen in frames]
    thinned = album.count > len(frames)
    note = f"{len(frames)} of {album.count} frames" if thinned else ""
    draw_panels(path, model.skin, model.grid, panels, title=title, note=note, legend=True)


def film_stream(
    path: str | Path,
    model: Model,
    album: Album,
    *,
    progress: Callable[..., Iterable[Any]] = lambda items, _: items,
) -> None:
    """The album as a film. Raises as ``draw_stream``."""
    frames = album.spread(MAX_FRAMES)
    times_s = [seen.frame.time_us / 1e6 for seen in frames]
    draw_film(path, model, [_panel(model, seen) for seen in frames], times_s, progress=progress)


def _panel(model: Model, seen: ComparedFrame) -> Panel:
    return Panel(
        f"frame {seen.frame.number}, {seen.frame.time_us / 1e6:.2f} s",
        None if seen.frame.image is None else seen.frame.image.image,
        _true_marks(model, seen),
        _found_marks(seen),
    )


def _true_marks(model: Model, seen: ComparedFrame) -> tuple[Mark, ...]:
    conductivity = model.skin.conductivity_s_per_m
    return tuple(
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1) * conductivity) for t in seen.true or ()
    )


def _found_marks(seen: ComparedFrame) -> tuple[Mark, ...]:
    if seen.frame.touches is not None:
        return tuple(map(found_mark, seen.frame.touches.touches))
    places = seen.found_mm
    return () if places is None else tuple(Mark(float(x), float(y)) for x, y in places)
