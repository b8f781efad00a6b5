"""Hands on the paper's skin: fingers that land, stay, move and lift while rows are measured."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scene.description import Scene, scene_from_table

REACH_MM = 78.0  # places lie within so much of the middle of a skin of radius 97
RATE_HZ = 48.0
UNTOUCHED = 64
END_S = 0.15  # after the last finger has lifted
LEFT, FADES_S = 0.1, 0.4  # of a touch that creeps, at the lift, and how long that takes to fade


@dataclass(frozen=True, eq=False)
class Finger:
    """A touch that begins at ``from_s``, is whole ``rise_s`` later, goes straight from ``begin`` to
    ``end`` (mm) between ``moves_s`` and ``off_s``, and has lifted ``rise_s`` after that. A tenth of
    one that ``creeps`` stays then, and fades."""

    from_s: float
    rise_s: float
    off_s: float
    begin: FloatArray
    end: FloatArray
    radius_mm: float = 8.0
    contrast: float = 5.0
    creeps: bool = False
    waits_s: float = 0.0

    @property
    def whole_s(self) -> float:
        return self.from_s + self.rise_s

    @property
    def moves_s(self) -> float:
        return self.whole_s + self.waits_s

    @property
    def gone_s(self) -> float:
        return self.off_s + self.rise_s

    def place(self, time_s: float) -> FloatArray:
        way = (time_s - self.moves_s) / max(self.off_s - self.moves_s, 1e-9)
        return np.asarray(self.begin + np.clip(way, 0.0, 1.0) * (self.end - self.begin))

    def table(self) -> dict[str, Any]:
        """Return the table [[touch]] of a scene."""
        keys = [(self.from_s, self.begin, 0.0), (self.whole_s, self.begin, 1.0)]
        keys += [(self.moves_s, self.begin, 1.0), (self.off_s, self.end, 1.0)]
        keys += [(self.gone_s, self.end, LEFT if self.creeps else 0.0)]
        if self.creeps:
            keys.append((self.gone_s + FADES_S, self.end, 0.0))
        path: list[dict[str, float]] = []
        for t_s, (x_mm, y_mm), press in keys:
            key = {"t_s": t_s, "x_mm": float(x_mm), "y_mm": float(y_mm), "press": press}
            if path and t_s <= path[-1]["t_s"]:  # at the same instant
                t_s = path[-1]["t_s"] + 1e-6
                key["t_s"] = t_s
            path.append(key)
        return {"radius_mm": self.radius_mm, "contrast": self.contrast, "path": path}


Draw = Callable[[np.random.Generator], list[Finger]]


def scene(fingers: list[Finger], seed: int, snr_db: float, elements: int) -> Scene:
    """``fingers`` on the paper's skin, with noise."""
    ends_s = max(one.gone_s + FADES_S * one.creeps for one in fingers) + END_S
    head = {"seed": seed, "frames": int(ends_s * RATE_HZ), "rate_hz": RATE_HZ,
            "quiet_frames": UNTOUCHED, "elements": elements}  # fmt: skip
    table = {"scene": head, "touch": [one.table() for one in fingers],
             "effects": {"noise": {"snr_db": snr_db}}}  # fmt: skip
    return replace(scene_from_table(table, "hands", Path()), name="hands")


def place(rng: np.random.Generator, reach_mm: float = REACH_MM) -> FloatArray:
    """Anywhere within ``reach_mm``, evenly."""
    radius, angle = reach_mm * np.sqrt(rng.random()), 2 * np.pi * rng.random()
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def apart(
    rng: np.random.Generator, others: list[Finger], gap_mm: float, reach_mm: float = REACH_MM
) -> FloatArray | None:
    """A place at least ``gap_mm`` from where the others are; None if there is hardly one."""
    for _ in range(999):
        here = place(rng, reach_mm)
        if all(np.hypot(*(here - at)) > gap_mm for one in others for at in (one.begin, one.end)):
            return here
    return None


def _still(
    rng: np.random.Generator, from_s: float, rise_s: float, held_s: float, at: FloatArray
) -> Finger:
    off_s = from_s + rise_s + held_s
    return Finger(from_s, rise_s, off_s, at, at, rng.uniform(6.5, 9.5), rng.uniform(3, 8))


def piano(rng: np.random.Generator) -> list[Finger]:
    """Up to six keys one after another, some held while the next ones land."""
    fingers: list[Finger] = []
    from_s = 0.1
    for _ in range(6):
        at = apart(rng, fingers, 30.0)
        if at is None:
            break
        fingers.append(_still(rng, from_s, rng.uniform(0.01, 0.06), rng.uniform(0.15, 0.4), at))
        from_s += rng.uniform(0.06, 0.25)
    return fingers


def chord(rng: np.random.Generator) -> list[Finger]:
    """Three to five within 40 ms."""
    fingers: list[Finger] = []
    for _ in range(int(rng.integers(3, 6))):
        at = apart(rng, fingers, 32.0)
        if at is not None:
            late_s, rise_s = rng.uniform(0, 0.04), rng.uniform(0.02, 0.06)
            fingers.append(_still(rng, 0.2 + late_s, rise_s, 0.6 + rng.uniform(0, 0.03), at))
    return fingers


def pair(rng: np.random.Generator) -> list[Finger]:
    """Two fingers 24 to 34 mm apart, at once or after each other."""
    while True:
        here, angle = place(rng, 65.0), 2 * np.pi * rng.random()
        there = here + rng.uniform(24, 34) * np.array([np.cos(angle), np.sin(angle)])
        if np.hypot(*there) <= REACH_MM:
            break
    late_s = float(rng.choice([0.0, 0.01, 0.12]))
    radius_mm, contrast = rng.uniform(6.5, 8.5), rng.uniform(3, 8)
    other = contrast * rng.uniform(0.7, 1.4)
    return [
        Finger(0.2, 0.03, 0.83, here, here, radius_mm, contrast),
        Finger(0.2 + late_s, 0.03, 0.83 + late_s, there, there, radius_mm, other),
    ]


def moving(rng: np.random.Generator) -> list[Finger]:
    """Two that slide at 40 to 250 mm/s, never nearer than 28 mm."""
    steps = np.linspace(0, 1, 30)[:, None]
    while True:
        a, b, c, d = (place(rng) for _ in range(4))
        away = (a + steps * (b - a)) - (c + steps * (d - c))
        if np.hypot(*away.T).min() > 28 and np.hypot(*(b - a)) > 40:
            break
    held_s, late_s = np.hypot(*(b - a)) / rng.uniform(40, 250), rng.uniform(0, 0.1)
    fingers = []
    for from_s, here, there in ((0.2, a, b), (0.2 + late_s, c, d)):
        size = rng.uniform(6.5, 9.5), rng.uniform(3, 8)
        fingers.append(Finger(from_s, 0.03, from_s + 0.03 + held_s, here, there, *size))
    return fingers


def palm(rng: np.random.Generator) -> list[Finger]:
    """A broad, weak contact, then a finger beside it."""
    at = place(rng, 40.0)
    fingers = [Finger(0.2, 0.12, 1.42, at, at, 22.0, 2.0)]
    beside = apart(rng, fingers, 48.0)
    if beside is not None:
        fingers.append(_still(rng, 0.6, 0.03, 0.4, beside))
    return fingers


def single(rise_s: float) -> Draw:
    """One press."""

    def draw(rng: np.random.Generator) -> list[Finger]:
        return [_still(rng, 0.1 + rng.uniform(0, 0.02), rise_s, 0.2, place(rng))]

    return draw


def swipe(speed_mm_per_s: float) -> Draw:
    """One finger over 70 mm or more, which stays 40 ms before it goes."""

    def draw(rng: np.random.Generator) -> list[Finger]:
        while True:
            here, there = place(rng), place(rng)
            if np.hypot(*(here - there)) >= 70:
                break
        from_s, waits_s = 0.1 + rng.uniform(0, 0.02), 0.04
        off_s = from_s + waits_s + np.hypot(*(here - there)) / speed_mm_per_s
        return [Finger(from_s, 0.0, off_s, here, there, waits_s=waits_s)]

    return draw


def crossing(rng: np.random.Generator) -> list[Finger]:
    """Two at 300 mm/s over 90 mm; the second comes to the crossing .1 s later."""
    middle, angle = 0.3 * place(rng), rng.uniform(0, 2 * np.pi)
    along = 45.0 * np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    fingers = []
    for k, way in enumerate((along, across)):
        from_s = 0.1 + rng.uniform(0, 0.02) + 0.1 * k
        off_s = from_s + 0.04 + 90.0 / 300.0
        fingers.append(Finger(from_s, 0.0, off_s, middle - way, middle + way, waits_s=0.04))
    return fingers


def five(rng: np.random.Generator) -> list[Finger]:
    """Five, 60 ms after each other, that lift together."""
    while True:
        fingers: list[Finger] = []
        for k in range(5):
            at = apart(rng, fingers, 35.0)
            if at is None:
                break
            fingers.append(Finger(0.1 + 0.06 * k, 0.06, 0.1 + 0.36 + 0.08, at, at))
        if len(fingers) == 5:
            return fingers


def hand(rng: np.random.Generator) -> list[Finger]:
    """A hand of 40 mm and contrast 2 rests, then a finger lands beside it."""
    while True:
        at, beside = 0.7 * place(rng), place(rng)
        if np.hypot(*(at - beside)) >= 50:
            break
    finger = Finger(0.4, 0.03, 0.55, beside, beside)
    return [Finger(0.1, 0.12, 0.65, at, at, 20.0, 2.0), finger]


def creeping(rng: np.random.Generator) -> list[Finger]:
    """A tenth of the touch is left at the lift, and fades in .4 s."""
    at = place(rng)
    return [Finger(0.1 + rng.uniform(0, 0.02), 0.06, 0.66, at, at, creeps=True)]
