"""The sets of single presses: along four radii, over laws, all over the skin to tune and to report,
and light ones."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.scene.random_touches import TouchScene, TouchSet
from eitskin.scene.streams import stream
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.force.law import NOMINAL, WEIGHTS_G, PressLaw
from eitskin_studies.harness.sessions import FrameSession, SceneSolver

RADIUS_SHARES = (0.0, 0.3, 0.6, 0.85)  # of the skin's radius: from the centre to near the rim
ANGLES_DEG = (
    12.0,
    131.0,
    258.0,
)  # at different distances from electrodes, which are 22.5 degrees apart
OUTERMOST = 0.87  # of the radius: weights are put no nearer to the rim
LIGHT_G = (0.4, 120.0)  # least and greatest of the light weights
SHEET_SHARES = (0.0, 0.28, 0.56, 0.84)  # at equal distances from the centre to the boundary
SHEET_G = (2.0, 209.0)  # under the sheet; the greatest presses with what the gel stands
AT_ONCE = 20


@dataclass(frozen=True, eq=False)
class PressSet:
    """k single presses: ``grams`` (k,), ``place_mm`` (k, 2), ``law`` and ``group`` (k,), numbers of
    the law and of the radius or place; their solved frames."""

    session: FrameSession
    grams: FloatArray
    place_mm: FloatArray
    law: IntArray
    group: IntArray

    @property
    def facts(self) -> list[str]:
        """Return what tells this set from any other: its name and its discs."""
        discs = [
            list(vars(touch).values())
            for scene in self.session.touches.scenes
            for touch in scene.touches
        ]
        return [
            self.session.touches.name,
            hashlib.sha256(json.dumps(discs).encode()).hexdigest()[:16],
        ]


def at_radius(share: float, angle_deg: float, radius_mm: float) -> tuple[float, float]:
    """A place on the skin."""
    angle = math.radians(angle_deg)
    return share * radius_mm * math.cos(angle), share * radius_mm * math.sin(angle)


def spiral(seed: int, count: int, radius_mm: float) -> FloatArray:
    """``count`` places (k, 2) spread evenly to ``OUTERMOST``, turned by the seed (a sunflower's
    spiral)."""
    k = np.arange(count)
    angle = k * math.pi * (3 - math.sqrt(5)) + stream(seed, "force spiral").uniform(0, 2 * math.pi)
    away = OUTERMOST * radius_mm * np.sqrt((k + 0.5) / count)
    return np.column_stack([away * np.cos(angle), away * np.sin(angle)])


def solved(
    workspace: Workspace, solver: SceneSolver, role: str, seed: int,
    rows: Sequence[tuple[float, tuple[float, float], int, int]],
    laws: Sequence[PressLaw] = (NOMINAL,),
) -> PressSet:  # fmt: skip
    """The set of ``rows``: grams, place, number of the law, group. Solved in parts, each kept."""
    scenes = [
        TouchScene(f"{role}-s{seed}-{k}", (laws[law].touch(grams, place),))
        for k, (grams, place, law, _) in enumerate(rows)
    ]
    volts = []
    for start in range(0, len(scenes), AT_ONCE):
        part = solver.session(
            TouchSet(role, seed, tuple(scenes[start : start + AT_ONCE])), workspace.progress
        )
        volts.append(part.exact_v)
    whole = TouchSet(role, seed, tuple(scenes))
    session = FrameSession(
        role,
        solver.protocol,
        solver.skin.conductivity_s_per_m,
        whole,
        np.concatenate(volts),
        part.exact_untouched_v,
    )
    grams, places, law, group = zip(*rows, strict=True)
    return PressSet(session, np.array(grams), np.array(places), np.array(law), np.array(group))


def radius_places(
    radius_mm: float, angles: Sequence[float], shares: Sequence[float] = RADIUS_SHARES
) -> list[tuple[tuple[float, float], int]]:
    """Places at the four radii with the radius's number; the centre once."""
    return [
        (at_radius(share, angle, radius_mm), number)
        for number, share in enumerate(shares)
        for angle in (angles if share > 0 else angles[:1])
    ]


def curve_rows(
    radius_mm: float, shares: Sequence[float] = RADIUS_SHARES
) -> list[tuple[float, tuple[float, float], int, int]]:
    """Each of the paper's weights at the four radii, at three angles."""
    return [
        (grams, place, 0, number)
        for place, number in radius_places(radius_mm, ANGLES_DEG, shares)
        for grams in WEIGHTS_G
    ]


def law_rows(radius_mm: float, laws: int) -> list[tuple[float, tuple[float, float], int, int]]:
    """The same at one angle, under each law."""
    places = radius_places(radius_mm, ANGLES_DEG[:1])
    return [
        (grams, place, law, number)
        for law in range(laws)
        for place, number in places
        for grams in WEIGHTS_G
    ]


def spread_rows(places: FloatArray) -> list[tuple[float, tuple[float, float], int, int]]:
    """Every weight at each of ``places``."""
    return [
        (grams, (float(x), float(y)), 0, k)
        for k, (x, y) in enumerate(places)
        for grams in WEIGHTS_G
    ]


def light_rows(
    radius_mm: float,
    count: int,
    shares: Sequence[float] = RADIUS_SHARES,
    loads_g: tuple[float, float] = LIGHT_G,
) -> list[tuple[float, tuple[float, float], int, int]]:
    """A ladder of ``count`` weights by equal factors at the four radii, at two angles."""
    places, ladder = radius_places(radius_mm, ANGLES_DEG[:2], shares), np.geomspace(*loads_g, count)
    return [(float(grams), place, 0, number) for place, number in places for grams in ladder]
