"""Touches that move during a scan: a few states are solved, and each row is interpolated between
two of them.

Between two keyframes of any touch every touch moves in a straight line; such a stretch of time is a
leg. The change during a leg is a sum over its touches: the length of the path in steps of
``STEP_MM``, the change of the radius in steps of ``STEP_RADIUS_MM``, and the change of (contrast -
1) / (contrast + 1), to which a disc's voltages are nearly proportional, in steps of
``STEP_CONTRAST``. States are placed evenly over this change, at most a step apart, and a row's
voltage is interpolated over it between the two states around its instant. If nothing changes, there
is one state, and nothing is interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.scene.random_touches import TrueTouch
from eitskin.scene.touch_path import TouchTrack, touches_at, touches_of
from eitskin.scene.touch_path import sample as sample_track

Touches = tuple[TrueTouch, ...]

STEP_MM = 1.0  # of a touch's path, on a skin of the paper's size
STEP_RADIUS_MM = 0.5
STEP_CONTRAST = 0.1
SAME_S = 1e-9  # instants closer than this count as equal
FINE = 256  # pieces per step of a leg in which the instants of its states are searched


@dataclass(frozen=True, eq=False)
class Mix:
    """Instants (k,), each between two states: v = v[lower] + part (v[upper] - v[lower])."""

    lower: IntArray
    upper: IntArray
    part: FloatArray

    @property
    def still(self) -> bool:
        """Return whether all instants have the same state."""
        first = self.lower[0]
        return bool((self.lower == first).all() and (self.upper == first).all())


@dataclass(frozen=True, eq=False)
class _Leg:
    """One leg: the ``numbers`` of its touches, the instants (n,) of its states, and the change up
    to each of them."""

    numbers: tuple[int, ...]
    start_s: float
    end_s: float
    state_s: FloatArray
    changed: FloatArray


class Motion:
    """The touches of ``tracks`` at any instant, as states and the mixes between them. States are
    numbered in the order in which they are first asked for. ``size`` is that of the skin over the
    paper's."""

    def __init__(self, tracks: Sequence[TouchTrack], size: float = 1.0) -> None:
        self._tracks, self._size = tuple(tracks), size
        times = {k.t_s for track in tracks for k in track.keyframes if np.isfinite(k.t_s)}
        self._breaks = np.array(sorted(times))
        self._legs: dict[int, _Leg] = {}
        self._number: dict[Touches, int] = {}
        self._places: dict[tuple[int, int], int] = {}
        self.states: list[Touches] = []

    def touches_at(self, time_s: float) -> Touches:
        """Return the touches at ``time_s``."""
        return touches_of(self._tracks, time_s)

    def at(self, times_s: FloatArray) -> Mix:
        """Return the states between which the instants (k,) lie; the instants need not ascend."""
        lower = np.empty(len(times_s), np.int64)
        upper, part = lower.copy(), np.zeros(len(times_s))
        legs = np.searchsorted(self._breaks, times_s)
        for number in np.unique(legs):
            here = np.flatnonzero(legs == number)
            lower[here], upper[here], part[here] = self._in_leg(int(number), times_s[here])
        if len(self._breaks):
            near = [legs.clip(max=len(self._breaks) - 1), (legs - 1).clip(min=0)]
            off_s = np.array([np.abs(self._breaks[one] - times_s) for one in near])
            for k in np.flatnonzero(off_s.min(axis=0) <= SAME_S):
                at = float(self._breaks[near[int(off_s[:, k].argmin())][k]])
                lower[k] = upper[k] = self._of(self.touches_at(at))
                part[k] = 0.0
        return Mix(lower, upper, part)

    def _in_leg(self, number: int, times_s: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        leg = self._leg(number)
        last = len(leg.state_s) - 1
        if last == 0:
            only = np.full(len(times_s), self._state(number, 0))
            return only, only, np.zeros(len(times_s))
        changed = self._changed(leg.numbers, leg.start_s, leg.end_s, times_s)
        below = np.searchsorted(leg.changed, changed, side="right").clip(1, last) - 1
        part = (changed - leg.changed[below]) / (leg.changed[below + 1] - leg.changed[below])
        used = {int(k): self._state(number, int(k)) for k in {*below, *(below + 1)}}
        lower = np.array([used[int(k)] for k in below])
        return lower, np.array([used[int(k) + 1] for k in below]), np.asarray(part.clip(0, 1))

    def _leg(self, number: int) -> _Leg:
        """Return the leg before break ``number``; the last leg comes after all breaks."""
        if number not in self._legs:
            self._legs[number] = self._make_leg(number)
        return self._legs[number]

    def _make_leg(self, number: int) -> _Leg:
        breaks, inside = self._breaks, 0.0
        if not len(breaks):
            start_s = end_s = inside
        else:
            start_s = float(breaks[number - 1] if number else breaks[0] - 1.0)
            end_s = float(breaks[number] if number < len(breaks) else breaks[-1] + 1.0)
            inside = (start_s + end_s) / 2
        numbers = tuple(
            k
            for k, track in enumerate(self._tracks)
            if track.keyframes[0].t_s <= inside
            and (track.hold or inside <= track.keyframes[-1].t_s)
        )
        ends_s = np.array([start_s, end_s])
        most = float(self._changed(numbers, start_s, end_s, ends_s)[-1])
        steps = int(np.ceil(most - 1e-9))
        if steps == 0:
            return _Leg(numbers, start_s, end_s, ends_s[:1], np.zeros(1))
        fine_s = np.linspace(start_s, end_s, FINE * steps + 1)
        changed = self._changed(numbers, start_s, end_s, fine_s)
        state_s = np.interp(np.linspace(0, most, steps + 1), changed, fine_s)
        state_s[0], state_s[-1] = start_s, end_s
        return _Leg(
            numbers, start_s, end_s, state_s, self._changed(numbers, start_s, end_s, state_s)
        )

    def _changed(
        self, numbers: Sequence[int], start_s: float, end_s: float, times_s: FloatArray
    ) -> FloatArray:
        """Return the change since the start of the leg, in steps, at each instant (k,)."""
        total = np.zeros(len(times_s))
        for number in numbers:
            track = self._tracks[number]
            ends = sample_track(track, np.array([start_s, end_s]))
            way_mm = float(np.hypot(np.diff(ends.x_mm), np.diff(ends.y_mm))[0])
            radius_mm = float(np.abs(np.diff(ends.radius_mm))[0])
            steps = (way_mm / STEP_MM + radius_mm / STEP_RADIUS_MM) / self._size
            if steps:
                total += steps * (times_s - start_s) / (end_s - start_s)
            if ends.contrast[0] != ends.contrast[1]:
                now = _signal(sample_track(track, times_s).contrast)
                total += np.abs(now - _signal(ends.contrast)[0]) / STEP_CONTRAST
        return total

    def _state(self, number: int, place: int) -> int:
        if (number, place) not in self._places:
            leg = self._leg(number)
            at = leg.state_s[place : place + 1]
            samples = [sample_track(self._tracks[k], at) for k in leg.numbers]
            self._places[number, place] = self._of(touches_at(samples, 0))
        return self._places[number, place]

    def _of(self, touches: Touches) -> int:
        if touches not in self._number:
            self._number[touches] = len(self.states)
            self.states.append(touches)
        return self._number[touches]


def _signal(contrast: FloatArray) -> FloatArray:
    """Return the quantity to which a disc's voltages are nearly proportional: the response of a
    disc in an infinite sheet."""
    return np.asarray((contrast - 1.0) / (contrast + 1.0))
