"""Touches followed in time, in numpy terms: what csrc/src/touch/tracker.c does, for tests and
studies."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.options_table import MAX_TOUCHES
from eitskin.core.results import Options
from eitskin.fem.grid import Grid
from eitskin_reference.constants_table import (
    FIRST_SPEED,
    KNOWN_FRAMES,
    MIN_DEVIATION,
    SPEED_CHANGE,
    SURE_CLEARNESS,
    SURE_FRACTION,
    TENTATIVE_REACH,
)

Pairing: TypeAlias = Callable[[FloatArray, float], list[tuple[int, int]]]


@dataclass(frozen=True)
class Followed:
    """A touch that is followed; its id is 0 until it is reported. Velocities in mm a frame, ``p``
    the covariance of place and velocity along either axis: (place, both, speed); ``own_lambda`` its
    share of max(S'y) when it was last found, ``faint`` where that is below noise's."""

    touch: Touch
    vx_mm: float
    vy_mm: float
    p: tuple[float, float, float]
    seen: int
    missed: int
    own_lambda: float
    faint: bool


class Tracker:
    """Follows the touches of one stream on the skin of ``grid``; ``pairing`` says who is who (None:
    as the C core)."""

    def __init__(self, grid: Grid, pairing: Pairing | None = None) -> None:
        self._grid, self._pairing = grid, nearest_pairs if pairing is None else pairing
        self._followed: list[Followed] = []
        self.next_id = 1

    @property
    def count(self) -> int:
        """How many touches are followed, reported or not."""
        return len(self._followed)

    def forget(self) -> None:
        """Nothing is followed any more; ids count on."""
        self._followed = []

    def step(
        self, found: Sequence[Touch], options: Options, lambda_max: float, lambda_noise: float
    ) -> tuple[Touch, ...]:
        """What is reported of a frame in which ``found`` were found, strongest first."""
        now = _Frame(options, lambda_max, lambda_noise, self._grid)
        before = [now.predicted(one) for one in self._followed]
        owner: dict[int, int] = {}
        for known, reach_mm in (
            (True, options.follow_mm),
            (False, TENTATIVE_REACH * options.follow_mm),
        ):
            numbers = [number for number, one in enumerate(before) if (one.touch.id != 0) == known]
            free = [k for k in range(len(found)) if k not in owner]
            for row, column in self._pairing(_distances(found, free, before, numbers), reach_mm):
                owner[free[row]] = numbers[column]
        after = []
        for k, touch in enumerate(found):
            one = now.met(before[owner[k]], touch) if k in owner else now.newborn(touch)
            after.append(self._named(one, options, lambda_noise))
        waited = [
            replace(
                one, missed=one.missed + 1, touch=replace(one.touch, explained=0.0, confidence=None)
            )
            for number, one in enumerate(before)
            if number not in owner.values() and one.touch.id and one.missed < options.track_hold
        ]
        self._followed = [*after, *waited][:MAX_TOUCHES]
        told = [one.touch for one in self._followed if one.touch.id and not one.missed]
        held = [
            one.touch
            for one in self._followed
            if one.missed and one.faint and one.seen >= KNOWN_FRAMES
        ]
        told += held[: max(0, options.max_touches - len(told))]
        return tuple(sorted(told, key=lambda touch: -abs(touch.strength_s_per_m_mm2)))

    def _named(self, one: Followed, options: Options, lambda_noise: float) -> Followed:
        sure = (
            one.own_lambda >= SURE_CLEARNESS * lambda_noise and one.touch.explained >= SURE_FRACTION
        )
        if one.touch.id or not (one.seen >= options.track_confirm or sure):
            return one
        self.next_id += 1
        return replace(one, touch=replace(one.touch, id=self.next_id - 1))


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
        own = self.lambda_max * math.sqrt(touch.explained)
        noise = self.lambda_noise / own if own > 0 else 0.0
        place = self.grid.pixel_mm**2 * (
            (self.options.track_smooth * noise) ** 2 + MIN_DEVIATION**2
        )
        speed = (FIRST_SPEED * self.options.follow_mm) ** 2
        return Followed(
            replace(touch, id=0), 0.0, 0.0, (place, 0.0, speed), 1, 0, own, own < self.lambda_noise
        )

    def predicted(self, one: Followed) -> Followed:
        """A frame on; one that would leave the skin stays."""
        x, y = one.touch.x_mm + one.vx_mm, one.touch.y_mm + one.vy_mm
        if not self.options.track_smooth > 0 or not self.on_skin(x, y):
            return one
        change, (place, both, speed) = (SPEED_CHANGE * self.options.follow_mm) ** 2, one.p
        p = place + 2 * both + speed + change / 4, both + speed + change / 2, speed + change
        return replace(one, touch=replace(one.touch, x_mm=x, y_mm=y), p=p)

    def met(self, before: Followed, found: Touch) -> Followed:
        """What is known, with what was found; off the skin it starts again."""
        new, old = self.newborn(found), before.touch
        fresh = replace(new, touch=replace(found, id=old.id), seen=before.seen + 1)
        if not self.options.track_smooth > 0:
            return fresh
        place, both, speed = before.p
        gain, speed_gain = place / (place + new.p[0]), both / (place + new.p[0])
        dx, dy = found.x_mm - old.x_mm, found.y_mm - old.y_mm
        x, y = old.x_mm + gain * dx, old.y_mm + gain * dy
        if not self.on_skin(x, y):
            return fresh
        radius = old.radius_mm + gain * (found.radius_mm - old.radius_mm)
        strength = old.strength_s_per_m_mm2 + gain * (
            found.strength_s_per_m_mm2 - old.strength_s_per_m_mm2
        )
        return replace(
            fresh,
            touch=replace(
                found, id=old.id, x_mm=x, y_mm=y, radius_mm=radius, strength_s_per_m_mm2=strength
            ),
            vx_mm=before.vx_mm + speed_gain * dx,
            vy_mm=before.vy_mm + speed_gain * dy,
            p=((1 - gain) * place, (1 - gain) * both, speed - speed_gain * both),
        )


def _distances(
    found: Sequence[Touch], rows: list[int], before: Sequence[Followed], columns: list[int]
) -> FloatArray:
    here = np.array([(found[k].x_mm, found[k].y_mm) for k in rows]).reshape(-1, 1, 2)
    there = np.array(
        [(before[number].touch.x_mm, before[number].touch.y_mm) for number in columns]
    ).reshape(1, -1, 2)
    return np.asarray(np.hypot(*np.moveaxis(here - there, 2, 0)))


def nearest_pairs(distance_mm: FloatArray, reach_mm: float) -> list[tuple[int, int]]:
    """Pairs (row, column) within ``reach_mm``, the nearest first, each row and column once."""
    pairs: list[tuple[int, int]] = []
    for place in np.argsort(distance_mm, axis=None, kind="stable"):
        row, column = (int(one) for one in np.unravel_index(place, distance_mm.shape))
        free = all(row != i and column != k for i, k in pairs)
        if free and distance_mm[row, column] <= reach_mm:
            pairs.append((row, column))
    return pairs
