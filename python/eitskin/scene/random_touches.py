"""Random touches: seeded sets of scenes for judging reconstructions, and rings with a given spacing
for counting.

A scene depends only on (seed, role, its number): the first 20 scenes of a set of 180 are the set of
20, and the training set of a seed is independent of its test set.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.config import nearest
from eitskin.errors import GeometryError, UsageError
from eitskin.scene.streams import stream
from eitskin.skin.outline import Outline

if TYPE_CHECKING:
    from eitskin.scene.touch_shape import TouchShape


TRIES = 20_000


@dataclass(frozen=True)
class TrueTouch:
    """A disc, or another shape, of different conductivity.

    Attributes:
        x_mm, y_mm: the centre.
        radius_mm: the radius; for another shape, that of the disc of equal area.
        contrast: the conductivity inside (for another shape, in the middle) over that of the skin;
            above 1 conductive, below 1 resistive.
        shape: the shape; None is an even disc.
    """

    x_mm: float
    y_mm: float
    radius_mm: float
    contrast: float
    shape: "TouchShape | None" = None

    def covers(self, x_mm: FloatArray, y_mm: FloatArray) -> BoolArray:
        """Return whether places at these distances from the centre, (...), lie inside."""
        if self.shape is None:
            return np.asarray(x_mm**2 + y_mm**2 <= self.radius_mm**2)
        return np.asarray(self.shape.rho2(x_mm, y_mm, self.radius_mm) <= 1)

    @property
    def reach_mm(self) -> float:
        """The greatest distance from the centre at which it changes anything."""
        return self.radius_mm * (1.0 if self.shape is None else self.shape.reach)

    def change_at(self, points_mm: FloatArray) -> FloatArray:
        """Return the change at ``points_mm`` (..., 2) relative to that in the middle, (...)."""
        x_mm, y_mm = points_mm[..., 0] - self.x_mm, points_mm[..., 1] - self.y_mm
        if self.shape is None:
            return self.covers(x_mm, y_mm).astype(np.float64)
        return self.shape.change_at(x_mm, y_mm, self.radius_mm)

    def outward(self, points_mm: FloatArray) -> FloatArray:
        """Return the directions, of any length, in which the change falls off at ``points_mm`` (k,
        2), (k, 2)."""
        offsets = points_mm - np.array([self.x_mm, self.y_mm])
        return offsets if self.shape is None else self.shape.outward(offsets)

    def rim_mm(self) -> FloatArray:
        """Return points (64, 2) on the edge."""
        if self.shape is not None:
            return np.asarray(self.shape.rim_mm(self.radius_mm) + np.array([self.x_mm, self.y_mm]))
        turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        edge = np.column_stack([np.cos(turn), np.sin(turn)])
        return np.asarray(self.radius_mm * edge + np.array([self.x_mm, self.y_mm]))


@dataclass(frozen=True)
class TouchScene:
    """Touches that exist at the same time; ``name`` states the set and the number."""

    name: str
    touches: tuple[TrueTouch, ...]

    def centres_mm(self) -> FloatArray:
        """Return the centres, (k, 2)."""
        return np.array([(t.x_mm, t.y_mm) for t in self.touches], dtype=np.float64).reshape(-1, 2)

    def radii_mm(self) -> FloatArray:
        """Return the radii, (k,)."""
        return np.array([t.radius_mm for t in self.touches], dtype=np.float64)

    def mask(self, points_mm: FloatArray) -> BoolArray:
        """Return which of ``points_mm`` (p, 2) lie in any touch; a Gaussian touch counts within
        half its height."""
        inside = np.zeros(len(points_mm), dtype=np.bool_)
        along_x, along_y = np.ascontiguousarray(points_mm.T)
        for touch in self.touches:
            inside |= touch.covers(along_x - touch.x_mm, along_y - touch.y_mm)
        return inside


@dataclass(frozen=True)
class TouchRules:
    """The rules by which touches are drawn: uniformly within each range, and uniformly over the
    skin.

    Attributes:
        count: least and greatest number of touches in a scene.
        radius_mm: range of the radius.
        contrast: range of the contrast.
        gap_mm: least distance between the edges of two touches. 12 mm is two pixels of a 32-pixel
            image of the 194 mm skin; closer touches appear as one even in a perfect image.
        rim_margin_mm: least distance from the edge of a touch to the rim.
        shape: "disc", or one of ``touch_shape.SHAPES``, whose angle is drawn too.
        aspect: range of the long over the short axis; None takes the shape's default.
    """

    count: tuple[int, int] = (1, 3)
    radius_mm: tuple[float, float] = (6.0, 12.0)
    contrast: tuple[float, float] = (3.0, 10.0)
    gap_mm: float = 12.0
    rim_margin_mm: float = 4.0
    shape: str = "disc"
    aspect: tuple[float, float] | None = None

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
        if self.shape == "disc":
            if self.aspect is not None:
                raise UsageError("random touches: a disc has no aspect; name a shape")
            return
        from eitskin.scene.touch_shape import SHAPES

        if self.shape not in SHAPES:
            known = ["disc", *SHAPES]
            raise UsageError(f"random touches: shape {self.shape!r}: {nearest(self.shape, known)}")
        if self.aspect is not None and not 1 <= self.aspect[0] <= self.aspect[1]:
            raise UsageError("random touches: aspect must be a range from 1 on, low first")


@dataclass(frozen=True)
class TouchSet:
    """Scenes drawn with one seed and one role ("train", "test", ...)."""

    role: str
    seed: int
    scenes: tuple[TouchScene, ...]

    @property
    def name(self) -> str:
        """Role, seed and count; with the rules they suffice to draw the set again."""
        return f"{self.role}-s{self.seed}-n{len(self.scenes)}"


def random_touches(
    outline: Outline, seed: int, count: int, role: str = "test", rules: TouchRules | None = None
) -> TouchSet:
    """Return ``count`` scenes of random touches.

    Raises:
        UsageError: the count is below 1 or the seed below 0.
        GeometryError: the touches do not fit on this skin.
    """
    if count < 1:
        raise UsageError(f"a set needs at least 1 scene, not {count}")
    drawn = TouchRules() if rules is None else rules
    scenes = tuple(
        TouchScene(
            f"{role}-s{seed}-{k}",
            _draw(
                outline,
                drawn,
                stream(seed, f"touches {role}", k),
                partial(stream, seed, f"touch shapes {role}", k),
            ),
        )
        for k in range(count)
    )
    return TouchSet(role, seed, scenes)


def rim_distance_mm(outline: Outline, points_mm: npt.ArrayLike) -> FloatArray:
    """Return how far inside the rim each of ``points_mm`` (k, 2) lies, (k,); below 0 outside."""
    points = np.asarray(points_mm, dtype=np.float64).reshape(-1, 2)
    if outline.diameter_mm is not None:
        return np.asarray(outline.diameter_mm / 2 - np.hypot(points[:, 0], points[:, 1]))
    start = np.asarray(outline.vertices_mm, dtype=np.float64)
    along = np.roll(start, -1, axis=0) - start
    offset = points[:, None, :] - start[None]
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.sqrt(((offset - share[:, :, None] * along) ** 2).sum(axis=2)).min(axis=1)
    return np.asarray(np.where(outline.contains(points), distance, -distance))


def _shapes(
    rules: TouchRules, number: int, shape_generator: Callable[[], np.random.Generator]
) -> "list[TouchShape | None]":
    """Return the shapes of the touches; for discs no random number is drawn."""
    if rules.shape == "disc":
        return [None] * number
    from eitskin.scene.touch_shape import SHAPES, named_shape

    generator, default = shape_generator(), SHAPES[rules.shape][1]
    aspects = generator.uniform(*(rules.aspect or (default, default)), size=number)
    angles = generator.uniform(0.0, 180.0, size=number)
    return [
        named_shape(rules.shape, float(a), float(deg))
        for a, deg in zip(aspects, angles, strict=True)
    ]


def _draw(
    outline: Outline,
    rules: TouchRules,
    generator: np.random.Generator,
    shape_generator: Callable[[], np.random.Generator],
) -> tuple[TrueTouch, ...]:
    """Draw one scene: sizes first, then places until all fit. After 200 misses for one touch all
    places are drawn again."""
    number = int(generator.integers(rules.count[0], rules.count[1], endpoint=True))
    radii = generator.uniform(*rules.radius_mm, size=number)
    contrasts = generator.uniform(*rules.contrast, size=number)
    shapes = _shapes(rules, number, shape_generator)
    halves = [  # half the long axis
        radius if shape is None else radius * math.sqrt(shape.aspect)
        for radius, shape in zip(radii, shapes, strict=True)
    ]
    x0, y0, x1, y1 = outline.bounding_box_mm
    places: list[tuple[float, float]] = []
    misses = 0
    for _ in range(TRIES):
        x, y = float(generator.uniform(x0, x1)), float(generator.uniform(y0, y1))
        radius = halves[len(places)]
        apart = all(
            math.hypot(x - u, y - v) >= radius + halves[j] + rules.gap_mm
            for j, (u, v) in enumerate(places)
        )
        if apart and rim_distance_mm(outline, (x, y))[0] >= radius + rules.rim_margin_mm:
            places.append((x, y))
            misses = 0
        else:
            misses += 1
        if len(places) == number:
            return tuple(
                TrueTouch(x, y, float(r), float(c), shape)
                for (x, y), r, c, shape in zip(places, radii, contrasts, shapes, strict=True)
            )
        if misses >= 200:
            places, misses = [], 0
    raise GeometryError(
        f"random touches: {number} touches of radius up to {radii.max():.3g} mm, {rules.gap_mm:g}"
        " mm apart, do not fit on this skin; use fewer, smaller or nearer ones"
    )
