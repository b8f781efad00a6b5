"""The touches: rings as the paper's, random places, uneven touches, and mixed scenes for
judging the doubt."""

import math
from dataclasses import dataclass

from eitskin.errors import GeometryError
from eitskin.scene.random_touches import TouchRules, TouchScene, TouchSet, TrueTouch, random_touches
from eitskin.scene.streams import stream
from eitskin.skin.outline import Outline
from eitskin_studies.harness.discs import spaced_touches

RING, WIDE, NARROW, SINGLE, UNEVEN, MIXED = (
    "ring",
    "4 radii",
    "2.5 radii",
    "single",
    "uneven",
    "mixed",
)
SPACINGS = {WIDE: 4.0, NARROW: 2.5}
GEOMETRIES = (RING, WIDE, NARROW)
# the library's scene ring7
RING_MM, RING_TOUCH_MM, RING_CONTRAST = 60.0, 8.0, 9.0

MIN, MAX = 2, 12
USUAL_SCENES, TARGET_SCENES, SINGLE_SCENES, UNEVEN_SCENES = 24, 144, 144, 48
TARGETED = {(RING, 8), (RING, 10), (WIDE, 6), (WIDE, 8), (NARROW, 3), (NARROW, 5)}
UNEVEN_MAX = 6

MIXED_SCENES, MIXED_PARTS = 72, 5
EVEN = TouchRules(radius_mm=(9.0, 9.0), contrast=(5.0, 5.0))
TIGHTEST_RADII, LOOSEST_RADII, SQUEEZE_RADII = 2.2, 5.0, 0.25


@dataclass(frozen=True)
class Cell:
    """``touches`` at once, placed as ``geometry`` says, in ``usual`` scenes; of mixed scenes
    ``touches`` numbers the part."""

    geometry: str
    touches: int
    usual: int

    @property
    def name(self) -> str:
        """The name of the set and of its file."""
        return f"{self.geometry} {self.touches}"


def counting_cells() -> tuple[Cell, ...]:
    """2 to 12 touches in each geometry; more scenes where something is asked for."""
    return tuple(
        Cell(geometry, k, TARGET_SCENES if (geometry, k) in TARGETED else USUAL_SCENES)
        for geometry in GEOMETRIES
        for k in range(MIN, MAX + 1)
    )


def single_cell() -> Cell:
    """One touch anywhere, of radius 6 to 12 mm and contrast 3 to 10."""
    return Cell(SINGLE, 1, SINGLE_SCENES)


def uneven_cells() -> tuple[Cell, ...]:
    """Touches of many sizes and strengths at once."""
    return tuple(Cell(UNEVEN, k, UNEVEN_SCENES) for k in range(MIN, UNEVEN_MAX + 1))


def mixed_cells() -> tuple[Cell, ...]:
    """Parts of one large set of 1 to 12 touches."""
    return tuple(Cell(MIXED, part, MIXED_SCENES) for part in range(MIXED_PARTS))


def draw(cell: Cell, outline: Outline, seed: int, count: int) -> TouchSet:
    """``count`` scenes of ``cell``; each depends on seed and number only.

    Raises:
        GeometryError: so many touches do not fit on this skin.
    """
    if cell.geometry == RING:
        return _rings(seed, count, cell.touches)
    if cell.geometry in SPACINGS:
        return spaced_touches(outline, seed, count, cell.touches, SPACINGS[cell.geometry])
    if cell.geometry == MIXED:
        role = f"mixed {cell.touches}"
        return TouchSet(role, seed, tuple(_mixed(outline, seed, role, k) for k in range(count)))
    return random_touches(
        outline, seed, count, cell.name, TouchRules(count=(cell.touches, cell.touches))
    )


def _rings(seed: int, count: int, touches: int) -> TouchSet:
    role, scenes = f"{touches} on the ring", []
    for k in range(count):
        turn = stream(seed, f"touches {role}", k).uniform(0, 2 * math.pi)
        angles = [turn + 2 * math.pi * j / touches for j in range(touches)]
        placed = [(RING_MM * math.cos(angle), RING_MM * math.sin(angle)) for angle in angles]
        scenes.append(
            TouchScene(
                f"{role}-s{seed}-{k}",
                tuple(TrueTouch(x, y, RING_TOUCH_MM, RING_CONTRAST) for x, y in placed),
            )
        )
    return TouchSet(role, seed, tuple(scenes))


def _mixed(outline: Outline, seed: int, role: str, number: int) -> TouchScene:
    """1 to 12 touches in turn, a dozen equal and a dozen uneven; the spacing is drawn, and made
    less until they fit."""
    touches, uneven = number % MAX + 1, number // MAX % 2 == 1
    spacing = stream(seed, f"spacing {role}", number).uniform(TIGHTEST_RADII, LOOSEST_RADII)
    usual = TouchRules() if uneven else EVEN
    while True:
        gap_mm = (spacing - 2) * EVEN.radius_mm[0]
        rules = TouchRules((touches, touches), usual.radius_mm, usual.contrast, gap_mm)
        try:
            return random_touches(outline, seed, 1, f"{role}, {number}", rules).scenes[0]
        except GeometryError:
            if spacing <= TIGHTEST_RADII:
                raise
            spacing = max(TIGHTEST_RADII, spacing - SQUEEZE_RADII)
