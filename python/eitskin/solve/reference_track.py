"""Touches followed in time, in numpy terms: what csrc/src/track.c does, for tests and studies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitskin.core.results import MAX_TOUCHES, Options, Touch
from eitskin.fem.grid import Grid

SURE_SHARE = 0.05
NEWBORN_REACH = 0.6
SPEED_CHANGE = 0.028
FIRST_SPEED = 0.12
LEAST_DEVIATION = 0.01
KNOWN_FRAMES = 4


@dataclass(frozen=True)
class Followed:
    """A touch that is followed; its id is 0 until it is told of. Velocities in mm a frame, ``p`` the covariance of place and
    velocity along either axis: (place, both, speed)."""

    touch: Touch
    vx_mm: float
    vy_mm: float
    p: tuple[float, float, float]
    seen: int
    missed: int
    doubtful: bool


class Tracker:
    """Follows the touches of one stream on the skin of ``grid``."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._followed: list[Followed] = []
        self._next_id = 1

    def forget(self) -> None:
        """Nothing is followed any more; ids count on."""
        self._followed = []

    def step(self, found: Sequence[Touch], options: Options, lambda_max: float, lambda_noise: float) -> tuple[Touch, ...]:
        """What is told of a frame in which ``found`` were found, strongest first."""
        now = _Frame(options, lambda_max, lambda_noise, self._grid)
        before = [now.predicted(one) for one in self._followed]
        owner: dict[int, int] = {}
        _pair(before, found, True, options.follow_mm, owner)
        _pair(before, found, False, NEWBORN_REACH * options.follow_mm, owner)
        after = []
        for k, touch in enumerate(found):
            one = now.met(before[owner[k]], touch) if k in owner else now.newborn(touch)
            after.append(self._named(one, options))
        waited = [
            replace(one, missed=one.missed + 1, touch=replace(one.touch, confidence=0.0))
            for number, one in enumerate(before)
            if number not in owner.values() and one.touch.id and one.missed < options.track_hold
        ]
        self._followed = [*after, *waited][:MAX_TOUCHES]
        told = [one.touch for one in self._followed if one.touch.id and not one.missed]
        held = [one.touch for one in self._followed if one.missed and one.doubtful and one.seen >= KNOWN_FRAMES]
        told += held[: max(0, options.max_touches - len(told))]
        return tuple(sorted(told, key=lambda touch: -abs(touch.strength_s_per_m_mm2)))

    def _named(self, one: Followed, options: Options) -> Followed:
        sure = not one.doubtful and one.touch.confidence >= SURE_SHARE
        if one.touch.id or not (one.seen >= options.track_confirm or sure):
            return one
        self._next_id += 1
        return replace(one, touch=replace(one.touch, id=self._next_id - 1))


@dataclass(frozen=True)
class _Frame:
    options: Options
    lambda_max: float
    lambda_noise: float
    grid: Grid

    def on_skin(self, x_mm: float, y_mm: float) -> bool:
        """Whether a kept pixel is there or next to it."""
        cell = np.floor((np.array([x_mm, y_mm]) - self.grid.origin_mm) / self.grid.pixel_mm)
        return bool((np.abs(self.grid.index - cell) <= 1).all(axis=1).any())

    def newborn(self, touch: Touch) -> Followed:
        own = self.lambda_max * math.sqrt(touch.confidence)
        noise = self.lambda_noise / own if own > 0 else 0.0
        place = self.grid.pixel_mm**2 * ((self.options.track_smooth * noise) ** 2 + LEAST_DEVIATION**2)
        speed = (FIRST_SPEED * self.options.follow_mm) ** 2
        return Followed(replace(touch, id=0), 0.0, 0.0, (place, 0.0, speed), 1, 0, own < self.lambda_noise)

    def predicted(self, one: Followed) -> Followed:
        """A frame on; one that would leave the skin stays."""
        x, y = one.touch.x_mm + one.vx_mm, one.touch.y_mm + one.vy_mm
        if not self.options.track_smooth > 0 or not self.on_skin(x, y):
            return one
        change, (place, both, speed) = (SPEED_CHANGE * self.options.follow_mm) ** 2, one.p
        p = place + 2 * both + speed + change / 4, both + speed + change / 2, speed + change
        return replace(one, touch=replace(one.touch, x_mm=x, y_mm=y), p=p)

    def met(self, before: Followed, found: Touch) -> Followed:
        """What is known, with what was found; off the skin it starts anew."""
        new, old = self.newborn(found), before.touch
        anew = replace(new, touch=replace(found, id=old.id), seen=before.seen + 1)
        if not self.options.track_smooth > 0:
            return anew
        place, both, speed = before.p
        gain, speed_gain = place / (place + new.p[0]), both / (place + new.p[0])
        dx, dy = found.x_mm - old.x_mm, found.y_mm - old.y_mm
        x, y = old.x_mm + gain * dx, old.y_mm + gain * dy
        if not self.on_skin(x, y):
            return anew
        radius = old.radius_mm + gain * (found.radius_mm - old.radius_mm)
        strength = old.strength_s_per_m_mm2 + gain * (found.strength_s_per_m_mm2 - old.strength_s_per_m_mm2)
        return replace(
            anew,
            touch=replace(found, id=old.id, x_mm=x, y_mm=y, radius_mm=radius, strength_s_per_m_mm2=strength),
            vx_mm=before.vx_mm + speed_gain * dx,
            vy_mm=before.vy_mm + speed_gain * dy,
            p=((1 - gain) * place, (1 - gain) * both, speed - speed_gain * both),
        )


def _pair(before: Sequence[Followed], found: Sequence[Touch], told: bool, reach_mm: float, owner: dict[int, int]) -> None:
    """Nearest pairs first within ``reach_mm``, among those that were told of or the others, into ``owner``: found to followed."""
    pairs = sorted(
        (math.hypot(touch.x_mm - one.touch.x_mm, touch.y_mm - one.touch.y_mm), k, number)
        for k, touch in enumerate(found)
        for number, one in enumerate(before)
        if k not in owner and (one.touch.id != 0) == told
    )
    taken: set[int] = set()
    for distance, k, number in pairs:
        if distance <= reach_mm and k not in owner and number not in taken:
            owner[k] = number
            taken.add(number)
