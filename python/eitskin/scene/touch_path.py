"""The place and strength of a touch at any time: straight lines between keyframes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.scene.laws import Law, ShortCircuit
from eitskin.scene.random_touches import TrueTouch

if TYPE_CHECKING:
    from eitskin.scene.touch_shape import TouchShape


SLACK_S = 1e-9
ALWAYS_S = (float("-inf"), float("inf"))


@dataclass(frozen=True)
class Keyframe:
    """A touch at ``t_s`` after the first recorded frame; ``drive`` is press (0 to 1) or grams,
    depending on its law."""

    t_s: float
    x_mm: float
    y_mm: float
    radius_mm: float
    drive: float = 1.0


@dataclass(frozen=True)
class TouchTrack:
    """A touch that appears, moves, presses and lifts.

    It exists from its first keyframe to its last, both included; with ``hold`` it stays after the
    last. A track with a single keyframe at t_s = -inf always exists. Between keyframes everything
    changes linearly with time, except its ``shape`` (None: an even disc).
    """

    keyframes: tuple[Keyframe, ...]
    law: Law = field(default_factory=ShortCircuit)
    hold: bool = False
    shape: "TouchShape | None" = None

    @property
    def moves(self) -> bool:
        """Return whether its place, size or force changes."""
        return len({(k.x_mm, k.y_mm, k.radius_mm, k.drive) for k in self.keyframes}) > 1


@dataclass(frozen=True, eq=False)
class TrackSamples:
    """One track at given times, all (n,). If ``there`` is False, the other numbers have no meaning.

    ``there`` is also False if the touch presses so little that it changes nothing.
    """

    there: BoolArray
    x_mm: FloatArray
    y_mm: FloatArray
    radius_mm: FloatArray
    contrast: FloatArray
    shape: "TouchShape | None" = None


def always(x_mm: float, y_mm: float, radius_mm: float, law: Law | None = None) -> TouchTrack:
    """Return a touch that stays in place through all recorded frames."""
    frame = Keyframe(ALWAYS_S[0], x_mm, y_mm, radius_mm)
    return TouchTrack((frame,), ShortCircuit() if law is None else law, hold=True)


def sample(track: TouchTrack, times_s: FloatArray) -> TrackSamples:
    """Return ``track`` at ``times_s`` (n,), which need not ascend."""
    keys = track.keyframes
    start, end = keys[0].t_s, keys[-1].t_s
    there = (times_s >= start - SLACK_S) & (track.hold | (times_s <= end + SLACK_S))
    at = np.array([k.t_s for k in keys]) if len(keys) > 1 else np.zeros(1)

    def line(name: str) -> FloatArray:
        return np.asarray(np.interp(times_s, at, [getattr(k, name) for k in keys]))

    contrast = track.law.contrast_at(line("drive"))
    there &= contrast != 1.0
    places = line("x_mm"), line("y_mm"), line("radius_mm")
    return TrackSamples(there, *places, contrast, track.shape)


def touches_of(tracks: Sequence[TouchTrack], time_s: float) -> tuple[TrueTouch, ...]:
    """Return the touches that exist at ``time_s``, in the order of the tracks."""
    at = np.array([time_s])
    near = [
        track
        for track in tracks
        if track.keyframes[0].t_s <= time_s + SLACK_S
        and (track.hold or time_s <= track.keyframes[-1].t_s + SLACK_S)
    ]
    return touches_at([sample(track, at) for track in near], 0)


def touches_at(samples: Sequence[TrackSamples], frame: int) -> tuple[TrueTouch, ...]:
    """Return the touches that exist in ``frame``, in the order of the tracks."""
    return tuple(
        TrueTouch(x_mm=float(s.x_mm[frame]), y_mm=float(s.y_mm[frame]),
                  radius_mm=float(s.radius_mm[frame]), contrast=float(s.contrast[frame]),
                  shape=s.shape)
        for s in samples if s.there[frame]
    )  # fmt: skip
