"""Equal discs with a least distance."""

from eitskin.errors import UsageError
from eitskin.scene.random_touches import TouchRules, TouchSet, random_touches
from eitskin.skin.outline import Outline


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
