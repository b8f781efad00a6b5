"""The numpy reference of csrc/src/touch/split_merge.c: discs that are one touch are joined, those
that are two are parted."""

from dataclasses import replace

import numpy as np

from eitskin.core.results import Options
from eitskin_reference.constants_table import (
    DIRECTIONS_OF_NOISE,
    FIT_MOVES,
    MERGE_LEFT,
    MERGE_NEAR,
    MERGE_SWEEPS,
    MERGE_TOTAL,
    PARALLEL,
    SPLIT_CROWD,
    SPLIT_DIRECTIONS,
    SPLIT_DISTANCE,
    SPLIT_FALL,
    SPLIT_FIRST,
    SPLIT_FIRST_OF_CROWD,
    SPLIT_GAIN,
    SPLIT_NOISE,
    SPLIT_OFFSET,
    SPLIT_RADIUS,
    SPLIT_SWEEPS,
    SPLIT_TOTAL,
)
from eitskin_reference.disc_fit import Disc, Fit


def edge_distance(a: Disc, b: Disc) -> float:
    """How far apart two discs' edges are, in the smaller radius."""
    distance = float(np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm))
    return (distance - a.radius_mm - b.radius_mm) / min(a.radius_mm, b.radius_mm)


def join(fit: Fit) -> bool:
    """Join near pairs of one sign, the nearest first, where one disc explains as much; whether any
    were."""
    any_joined = False
    while pairs := _near_pairs(fit.discs):
        joined = any(fit.moves < FIT_MOVES and _try_join(fit, i, j) for _, i, j in pairs)
        if not joined:
            break
        any_joined = True
    return any_joined


def _near_pairs(discs: list[Disc]) -> list[tuple[float, int, int]]:
    pairs = [
        (edge_distance(a, discs[j]), i, j)
        for i, a in enumerate(discs)
        for j in range(i + 1, len(discs))
    ]
    return sorted(
        p for p in pairs if p[0] < MERGE_NEAR and discs[p[1]].polarity == discs[p[2]].polarity
    )


def merged(options: Options, a: Disc, b: Disc) -> Disc:
    """One disc in the place of two, of their area; without strength."""
    of_a, of_b = abs(a.change) * a.radius_mm**2, abs(b.change) * b.radius_mm**2
    w = of_a / (of_a + of_b) if of_a + of_b > 0 else 0.5
    radius = min(float(np.hypot(a.radius_mm, b.radius_mm)), options.touch_max_radius_mm)
    return Disc(
        w * a.x_mm + (1 - w) * b.x_mm, w * a.y_mm + (1 - w) * b.y_mm, radius, 0.0, a.polarity
    )


def _try_join(fit: Fit, i: int, j: int) -> bool:
    before, left, a, b = list(fit.discs), fit.left(), fit.discs[i], fit.discs[j]
    one = merged(fit.options, a, b)
    fit.discs[i] = one
    del fit.discs[j]
    fit.discs[i] = replace(one, change=fit.best_change(one, fit.answers(one)[0], fit.residual()))
    fit.settle([i], MERGE_SWEEPS)
    fit.move_all(1)
    if (
        fit.left()
        <= left + MERGE_TOTAL * fit.whole + MERGE_LEFT * left + DIRECTIONS_OF_NOISE * fit.noise
    ):
        return True
    fit.discs = before
    return False


def part(fit: Fit) -> bool:
    """Part discs, the largest first, where two explain clearly more; whether any were."""
    enough = SPLIT_TOTAL * fit.whole + SPLIT_NOISE * fit.noise * fit.model.rank
    any_parted = False
    left_to_look = list(range(len(fit.discs)))
    while left_to_look and len(fit.discs) < fit.options.max_touches and fit.left() >= enough:
        if fit.moves >= FIT_MOVES:
            break
        k = max(left_to_look, key=lambda i: (fit.discs[i].radius_mm, -i))
        left_to_look.remove(k)
        if not fit.discs[k].whole:
            any_parted |= _try_part(fit, k)
    return any_parted


def _try_part(fit: Fit, k: int) -> bool:
    before, left, last = list(fit.discs), fit.left(), len(fit.discs)
    best = min(_pairs_for(fit, k), key=lambda found: found[0], default=None)
    first = SPLIT_FIRST if last < SPLIT_CROWD else SPLIT_FIRST_OF_CROWD
    if best is None or best[0] > first * left:
        return False
    fit.discs[k] = best[1]
    fit.discs.append(best[2])
    hopeful = _settle_two(fit, k, last, SPLIT_FALL * left)
    if hopeful:
        fit.move_all(1)
    now = fit.left()
    gained = (
        hopeful
        and now <= SPLIT_GAIN * left
        and left - now >= SPLIT_TOTAL * fit.whole + DIRECTIONS_OF_NOISE * fit.noise
    )
    if gained and edge_distance(fit.discs[k], fit.discs[last]) > SPLIT_DISTANCE:
        return True
    fit.discs = before
    fit.discs[k] = replace(before[k], whole=True)
    return False


def _settle_two(fit: Fit, k: int, last: int, limit: float) -> bool:
    """The sweeps of two discs; false where they are given up: were each sweep that is left to gain
    as much as this one, they would still leave more than ``limit``."""
    before = 0.0
    for sweep in range(SPLIT_SWEEPS):
        fit.settle([k], 1)
        fit.settle([last], 1)
        left = fit.left()
        if sweep > 0 and left - (SPLIT_SWEEPS - sweep) * (before - left) > limit:
            return False
        before = left
    return True


def _pairs_for(fit: Fit, k: int) -> list[tuple[float, Disc, Disc]]:
    """Pairs that could take the place of disc k, with what they would leave, squared."""
    one, target = fit.discs[k], fit.residual(leave_out=k)
    radius = max(SPLIT_RADIUS * one.radius_mm, fit.options.touch_min_radius_mm)
    found = []
    for angle in np.arange(SPLIT_DIRECTIONS) * np.pi / SPLIT_DIRECTIONS:
        dx, dy = (
            SPLIT_OFFSET * one.radius_mm * np.cos(angle),
            SPLIT_OFFSET * one.radius_mm * np.sin(angle),
        )
        two = [
            replace(one, x_mm=one.x_mm + s * dx, y_mm=one.y_mm + s * dy, radius_mm=radius)
            for s in (1, -1)
        ]
        if not all(fit.on_skin(disc) for disc in two):
            continue
        atoms = np.array([fit.answers(disc)[0] for disc in two])
        gram = atoms @ atoms.T
        if not np.linalg.det(gram) > PARALLEL * gram[0, 0] * gram[1, 1]:
            continue
        change = np.linalg.solve(gram, atoms @ target)
        if (change * one.polarity > 0).all():
            rest = target - change @ atoms
            found.append(
                (
                    float(rest @ rest),
                    *(replace(d, change=float(c)) for d, c in zip(two, change, strict=True)),
                )
            )
    return found  # type: ignore[return-value]
