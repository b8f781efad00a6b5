"""Touches that are hard to see, on the paper's skin, solved on another mesh than the model's;
simulated once a session."""

from functools import cache
from math import cos, pi, sin

import numpy as np

from eitskin.fem.mesh import mesh_for_elements
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch
from eitskin.scene.simulate import Measurement, Simulated, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin

RIM_MM = 97.0
ELEMENTS = 5000
CONTRASTS = (1.01, 1.1, 1.5, 3.0, 10.0, 100.0, 1000.0)
INSULATING = (0.9, 0.5, 0.1, 0.001)
PRESSES = (1.002, 1.005, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5)
APART_MM = (80.0, 60.0, 40.0, 30.0, 24.0, 18.0, 24.0, 30.0, 40.0, 60.0, 80.0)
PRESS_PLACES = 8
UNTOUCHED_TRIALS = 200


def ring(count: int, ring_mm: float, radius_mm: float, turn: float = 0.0) -> tuple[TrueTouch, ...]:
    """Equal touches on a circle."""
    angles = [turn + 2 * pi * k / count for k in range(count)]
    return tuple(TrueTouch(ring_mm * cos(a), ring_mm * sin(a), radius_mm, 5.0) for a in angles)


def at(
    distance_mm: float, angle_deg: float, radius_mm: float = 9.0, contrast: float = 5.0
) -> tuple[TrueTouch, ...]:
    """One touch, by its distance from the centre."""
    a = angle_deg * pi / 180
    return (TrueTouch(distance_mm * cos(a), distance_mm * sin(a), radius_mm, contrast),)


def crowds() -> dict[str, tuple[TrueTouch, ...]]:
    """More touches than can be separated: many, and close ones."""
    return {
        "10 on a ring": ring(10, 70.0, 9.0),
        "14 on two rings": (*ring(9, 78.0, 7.0), *ring(5, 38.0, 7.0, 0.3)),
        "12 and one in the middle": (*ring(12, 72.0, 8.0), *at(0.0, 0.0)),
        "5 within 30 mm": (*ring(4, 20.0, 6.0), *at(0.0, 0.0, 6.0)),
        "a row of 6, a millimetre apart": tuple(
            TrueTouch(-42.5 + 17.0 * k, 10.0, 8.0, 5.0) for k in range(6)
        ),
    }


def entangled() -> dict[str, tuple[TrueTouch, ...]]:
    """Touches that change each other's field more than two dipoles describe, or hide each other's
    peaks."""
    return {
        "two that overlap": (*at(6.0, 30.0), *at(6.0, 210.0)),
        "two that touch, of opposite change": (*at(9.0, 80.0), *at(9.0, 260.0, 9.0, 0.1)),
        "three metals in a row": tuple(TrueTouch(x, 0.0, 12.0, 1000.0) for x in (-25.0, 0.0, 25.0)),
        "12 metals on a ring": tuple(
            TrueTouch(t.x_mm, t.y_mm, t.radius_mm, 1000.0) for t in ring(12, 70.0, 12.0)
        ),
        "a pair at the rim": (*at(88.0, 5.0), *at(88.0, 17.0)),
        "one of half the skin": at(20.0, 130.0, 60.0),
    }


def groups() -> dict[str, list[tuple[TrueTouch, ...]]]:
    """Touches of every scene, by what is hard."""
    return {
        "on an electrode": [at(RIM_MM - 9.0, 90.0 + 22.5 * k) for k in range(4)],
        "between electrodes": [at(RIM_MM - 9.0, 101.25 + 22.5 * k) for k in range(4)],
        "merging": [(*at(d / 2, 20.0), *at(d / 2, 200.0)) for d in APART_MM],
        "centre": [at(0.0, 0.0)],
        "radius 3 mm": [at(55.0, 40.0 + 90.0 * k, 3.0, 10.0) for k in range(4)],
        "radius 40 mm": [at(45.0, 10.0 + 90.0 * k, 40.0, 5.0) for k in range(4)],
        "contrasts": [at(50.0, 200.0, 9.0, c) for c in CONTRASTS],
        "insulating": [at(50.0, 200.0, 9.0, c) for c in INSULATING],
        "presses": [at(50.0, 45.0 * k, 9.0, c) for c in PRESSES for k in range(PRESS_PLACES)],
        "crowds": list(crowds().values()),
        "entangled": list(entangled().values()),
    }


@cache
def simulated() -> Simulated:
    """All scenes at 60 dB and 12 bits, 64 untouched frames."""
    scenes = tuple(
        TouchScene(f"{name} {k}", touches)
        for name, each in groups().items()
        for k, touches in enumerate(each)
    )
    skin = paper_skin()
    return simulate(
        skin, adjacent(16), TouchSet("hard", 1, scenes), mesh=mesh_for_elements(skin, ELEMENTS)
    )


def frames_of(name: str) -> np.ndarray:
    """(k, m) V of a group."""
    start = 0
    for group, each in groups().items():
        if group == name:
            return np.asarray(simulated().frames_v[start : start + len(each)])
        start += len(each)
    raise KeyError(name)


@cache
def untouched_trials() -> np.ndarray:
    """Frames of the untouched skin (k, m) V, of which none was in the reference."""
    nothing = TouchSet("quiet trials", 2, (TouchScene("nothing", ()),))
    one = simulate(
        paper_skin(), adjacent(16), nothing, seed=1, mesh=mesh_for_elements(paper_skin(), ELEMENTS),
        measurement=Measurement(quiet_frames=UNTOUCHED_TRIALS, contact_spread=0.0),
    )  # fmt: skip
    own = simulated()
    return np.asarray(one.untouched_v - one.exact_untouched_v + own.exact_untouched_v)
