"""Checks that reject presses from which nothing can be learned, before any work; the error states
which ones and what to do."""

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import FrameError
from eitskin.skin.skin import Skin
from eitskin.teaching.presses import Presses

MIN_PRESSES = 5
FAINT = 0.1  # relative to the median change; a smaller change does not count as a press
UNITS = {"cm": 10.0, "m": 1000.0, "inches": 25.4, "µm": 0.001}
LEAST_COVER, FAIR_COVER = 0.02, 0.4


def check_presses(presses: Presses, skin: Skin | None) -> list[str]:
    """Check that ``presses`` can teach; return notes about smaller problems.

    Raises:
        FrameError: there are too few presses, some are too faint, or their places are wrong.
    """
    if len(presses) < MIN_PRESSES:
        raise FrameError(
            f"teach: {len(presses)} presses are too few; record at least {MIN_PRESSES}, better 20"
            " (eitskin teach plan chooses the places)"
        )
    notes: list[str] = []
    size = np.linalg.norm(presses.difference, axis=1)
    faint = np.flatnonzero(size < FAINT * np.median(size))
    if not np.median(size) > 0:
        raise FrameError(
            "teach: no press differs from its untouched frame; take that before the finger is down"
        )
    if len(faint):
        listed = ", ".join(map(str, faint[:8]))
        raise FrameError(
            f"teach: presses {listed} (from 0) hardly differ from their untouched frame; leave them"
            " out, or take the untouched frame before the finger is down"
        )
    if skin is None:
        return notes
    centre = np.array(skin.outline.centre_mm)
    corners = np.array(skin.outline.vertices_mm) - centre
    reach = float(np.linalg.norm(corners, axis=1).max())
    furthest = float(np.linalg.norm(presses.place_mm - centre, axis=1).max())
    if not 0.25 * reach <= furthest <= 1.15 * reach:
        for unit, factor in UNITS.items():
            if 0.5 * reach <= factor * furthest <= 1.1 * reach:
                raise FrameError(
                    f"teach: the places reach {furthest:g} mm from the middle of a skin of"
                    f" {reach:g} mm; they look like {unit}: multiply place_mm by {factor:g}"
                )
    if furthest > 1.15 * reach:
        far = int(np.argmax(np.linalg.norm(presses.place_mm - centre, axis=1)))
        raise FrameError(
            f"teach: press {far} (from 0) lies {furthest:.0f} mm from the middle of a skin that"
            f" reaches {reach:.0f} mm; correct its place, or the skin's description"
        )
    cover = hull_area(presses.place_mm) / skin.outline.area_mm2
    if cover < LEAST_COVER:
        raise FrameError(
            f"teach: the presses cover {100 * cover:.1f} % of the skin; press all over it"
            " (eitskin teach plan chooses the places)"
        )
    if cover < FAIR_COVER:
        notes.append(
            f"the presses cover {100 * cover:.0f} % of the skin; elsewhere the model is only an"
            " extrapolation by physics: press there too"
        )
    return notes


def hull_area(place_mm: FloatArray) -> float:
    """Return the area of the convex hull of places in mm², 0 for places on a line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(place_mm).volume)
    except (QhullError, ValueError):
        return 0.0
