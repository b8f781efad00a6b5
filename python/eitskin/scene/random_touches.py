"""Random touches: seeded sets of scenes for judging reconstructions, and rings of a given spacing
for counting.

A scene depends on (seed, role, its number) only: the first 20 scenes of a set of 180 are the set of
20, and the training set of a seed is independent of its test set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from eitskin.errors import GeometryError, UsageError
from eitskin.scene.streams import stream
from eitskin.skin.outline import Outline

if TYPE_CHECKING:
    from eitskin.scene.touch_shape import TouchShape

FloatArray = npt.NDArray[np.float64]

TRIES = 20_000


@dataclass(frozen=True)
class TrueTouch:
    """A disc of another conductivity, or another shape.

    Attributes:
        x_mm, y_mm: its centre.
        radius_mm: its radius; of another shape that of the disc of equal area.
        contrast: conductivity inside (of another shape in the middle) / the sheet's; above 1
            conductive, below 1 resistive.
        shape: None is an even disc.
    """

    x_mm: float
    y_mm: float
    radius_mm: float
    contrast: float
    shape: TouchShape | None = None


@dataclass(frozen=True)
class TouchScene:
    """Touches that are there at one time; ``name`` says set and number."""

    name: str
    touches: tuple[TrueTouch, ...]

    def centres_mm(self) -> FloatArray:
        """(k, 2)."""
        return np.array([(t.x_mm, t.y_mm) for t in self.touches], dtype=np.float64).reshape(-1, 2)

    def radii_mm(self) -> FloatArray:
        """(k,)."""
        return np.array([t.radius_mm for t in self.touches], dtype=np.float64)


@dataclass(frozen=True)
class TouchRules:
    """How touches are drawn: each range uniformly, the place uniformly over the skin.

    Attributes:
        count: least and most touches of a scene.
        radius_mm: range of the radius.
        contrast: range of the contrast.
        gap_mm: least distance between the edges of two touches. 12 mm is two pixels of a 32-pixel
            image of the 194 mm skin: nearer touches are one even in a perfect image.
        rim_margin_mm: least distance from a touch's edge to the rim.
    """

    count: tuple[int, int] = (1, 3)
    radius_mm: tuple[float, float] = (6.0, 12.0)
    contrast: tuple[float, float] = (3.0, 10.0)
    gap_mm: float = 12.0
    rim_margin_mm: float = 4.0

    def __post_init__(self) -> None:
        for name in ("count", "radius_mm", "contrast"):
            low, high = getattr(self, name)
            if not 0 < low <= high:
                raise UsageError(
                    f"random touches: {name} = ({low:g}, {high:g}) must be a range above 0, low"
                    " first"
                )
        if not (self.gap_mm >= 0 and self.rim_margin_mm >= 0):
            raise UsageError("random touches: gap_mm and rim_margin_mm must be at least 0")


@dataclass(frozen=True)
class TouchSet:
    """Scenes drawn under one seed and one role ("train", "test", ...)."""

    role: str
    seed: int
    scenes: tuple[TouchScene, ...]

    @property
    def name(self) -> str:
        """Role, seed and count: with the rules, all that is needed to draw the set again."""
        return f"{self.role}-s{self.seed}-n{len(self.scenes)}"


def random_touches(
    outline: Outline, seed: int, count: int, role: str = "test", rules: TouchRules | None = None
) -> TouchSet:
    """``count`` scenes of random touches.

    Raises:
        UsageError: the count is below 1 or the seed below 0.
        GeometryError: the touches do not fit on this skin.
    """
    if count < 1:
        raise UsageError(f"a set needs at least 1 scene, not {count}")
    drawn = TouchRules() if rules is None else rules
    scenes = tuple(
        TouchScene(f"{role}-s{seed}-{k}", _draw(outline, drawn, stream(seed, f"touches {role}", k)))
        for k in range(count)
    )
    return TouchSet(role, seed, scenes)


def spaced_touches(
    outline: Outline,
    seed: int,
    count: int,
    touches: int,
    spacing_radii: float = 4.0,
    radius_mm: float = 9.0,
    contrast: float = 5.0,
    rim_margin_mm: float = 4.0,
) -> TouchSet:
    """``count`` scenes of ``touches`` equal touches whose centres are at least ``spacing_radii``
    radii apart.

    The harder cousin of a ring, for counting: places are random, and the nearest neighbour is at
    the stated distance.

    Raises:
        UsageError: a count below 1, a seed below 0, or a spacing below 2 radii (touches would
            overlap).
        GeometryError: that many do not fit on this skin.
    """
    if spacing_radii < 2:
        raise UsageError(f"touches {spacing_radii:g} radii apart would overlap; use 2 or more")
    rules = TouchRules(
        (touches, touches),
        (radius_mm, radius_mm),
        (contrast, contrast),
        (spacing_radii - 2) * radius_mm,
        rim_margin_mm,
    )
    return random_touches(outline, seed, count, f"{touches} at {spacing_radii:g} radii", rules)


def rim_distance_mm(outline: Outline, points_mm: npt.ArrayLike) -> FloatArray:
    """How far inside the rim each of ``points_mm`` (k, 2) is: (k,); below 0 outside."""
    points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
    if outline.diameter_mm is not None:
        return np.asarray(outline.diameter_mm / 2 - np.hypot(points[:, 0], points[:, 1]))
    start = np.asarray(outline.vertices_mm, dtype=np.float64)
    along = np.roll(start, -1, axis=0) - start
    offset = points[:, None, :] - start[None]
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.sqrt(((offset - share[:, :, None] * along) ** 2).sum(axis=2)).min(axis=1)
    return np.asarray(np.where(outline.contains(points), distance, -distance))


def _draw(
    outline: Outline, rules: TouchRules, generator: np.random.Generator
) -> tuple[TrueTouch, ...]:
    """One scene: sizes first, then places until all fit; after 200 misses for one touch all places
    are drawn again."""
    number = int(generator.integers(rules.count[0], rules.count[1], endpoint=True))
    radii = generator.uniform(*rules.radius_mm, size=number)
    contrasts = generator.uniform(*rules.contrast, size=number)
    x0, y0, x1, y1 = outline.bounding_box_mm
    places: list[tuple[float, float]] = []
    misses = 0
    for _ in range(TRIES):
        x, y = float(generator.uniform(x0, x1)), float(generator.uniform(y0, y1))
        radius = radii[len(places)]
        apart = all(
            math.hypot(x - u, y - v) >= radius + radii[j] + rules.gap_mm
            for j, (u, v) in enumerate(places)
        )
        if apart and rim_distance_mm(outline, (x, y))[0] >= radius + rules.rim_margin_mm:
            places.append((x, y))
            misses = 0
        else:
            misses += 1
        if len(places) == number:
            return tuple(
                TrueTouch(x, y, float(r), float(c))
                for (x, y), r, c in zip(places, radii, contrasts, strict=True)
            )
        if misses >= 200:
            places, misses = [], 0
    raise GeometryError(
        f"random touches: {number} touches of radius up to {radii.max():.3g} mm, {rules.gap_mm:g}"
        " mm apart, do not fit on this skin; use fewer, smaller or nearer ones"
    )
