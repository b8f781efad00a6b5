"""Random gestures: who touches where and when, and what each amounts to.

A session is a list of gestures with pauses between them. Timing, place, speed, contrast and
radius of every finger are drawn; a gesture depends on (seed, role, session, its number) only.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.scene.laws import ShortCircuit
from eitskin.scene.streams import stream
from eitskin.scene.touch_path import Keyframe, TouchTrack

# what a session holds, each as often; the last two are no gestures and must stay without one
KINDS = ("tap", "double-tap", "hold", "swipe", "pinch", "spread", "rotate", "drag", "press")
NONE = ("drag", "press")
EACH = 3  # how often a session has each kind
STEPS = 12  # straight pieces of a path
RIM_MM = 6.0  # least distance of a finger's edge from the skin's rim
LEAD_S, GAP_S = 0.4, (0.45, 0.8)  # before the first gesture, and from one to the next


@dataclass(frozen=True)
class Finger:
    """One finger from landing to lifting: its place ``xy_mm`` (k, 2) at ``at_s`` (k,)."""

    at_s: FloatArray
    xy_mm: FloatArray
    radius_mm: float
    contrast: float
    landing_s: float

    def track(self) -> TouchTrack:
        """With the contact growing from nothing as it lands, and going as it lifts."""
        start, end = float(self.at_s[0]), float(self.at_s[-1])
        soft = min(self.landing_s, (end - start) / 3)
        times = sorted({*self.at_s.tolist(), start + soft, end - soft})
        keys = tuple(
            Keyframe(
                t,
                float(np.interp(t, self.at_s, self.xy_mm[:, 0])),
                float(np.interp(t, self.at_s, self.xy_mm[:, 1])),
                self.radius_mm,
                max(min(1.0, (t - start) / soft, (end - t) / soft), 1e-3),
            )
            for t in times
        )
        return TouchTrack(keys, ShortCircuit(self.contrast))


@dataclass(frozen=True)
class DrawnGesture:
    """A gesture that was made, and when it ended: at the finger's lift, or with two fingers at the
    first lift.
    ``direction_deg`` is a swipe's."""

    kind: str
    fingers: tuple[Finger, ...]
    start_s: float
    end_s: float
    direction_deg: float | None = None

    @property
    def is_light(self) -> bool:
        """Return whether a finger changes the skin less than one of 7 mm that conducts nine times
        as much as the sheet, about the paper's finger."""
        return any((one.contrast - 1) * one.radius_mm**2 < 8 * 7.0**2 for one in self.fingers)

    @property
    def is_gesture(self) -> bool:
        """Return whether anything but down, move and up may be reported."""
        return self.kind not in NONE


@dataclass(frozen=True)
class DrawnSession:
    """Gestures one after another on a skin of ``reach_mm`` (its radius)."""

    name: str
    gestures: tuple[DrawnGesture, ...]
    duration_s: float

    @property
    def tracks(self) -> tuple[TouchTrack, ...]:
        """Every finger of all gestures."""
        return tuple(finger.track() for one in self.gestures for finger in one.fingers)


def draw_session(
    reach_mm: float,
    seed: int,
    role: str,
    number: int,
    each: int = EACH,
    kinds: tuple[str, ...] = KINDS,
) -> DrawnSession:
    """Each of ``kinds`` so often, in a random order."""
    order = stream(seed, f"gesture order {role}", number).permutation(
        np.repeat(np.arange(len(kinds)), each)
    )
    at_s, made = LEAD_S, []
    for place, kind in enumerate(order.tolist()):
        generator = stream(seed, f"gesture {role} {number}", place)
        one = draw_gesture(kinds[kind], reach_mm, generator)
        made.append(_moved(one, at_s))
        at_s = max(float(finger.at_s[-1]) for finger in made[-1].fingers)
        at_s += float(generator.uniform(*GAP_S))
    return DrawnSession(f"{role}-s{seed}-{number}", tuple(made), at_s)


def draw_gesture(kind: str, reach_mm: float, generator: np.random.Generator) -> DrawnGesture:
    """One gesture that begins at 0 s."""
    for _ in range(10_000):
        one = _MAKERS[kind](generator, reach_mm)
        if all(
            np.hypot(*finger.xy_mm.T).max() + finger.radius_mm + RIM_MM <= reach_mm
            for finger in one.fingers
        ):
            return one
    raise RuntimeError(f"no {kind} fits on a skin of {reach_mm:g} mm")


def _moved(one: DrawnGesture, by_s: float) -> DrawnGesture:
    fingers = tuple(replace(finger, at_s=finger.at_s + by_s) for finger in one.fingers)
    return replace(one, fingers=fingers, start_s=one.start_s + by_s, end_s=one.end_s + by_s)


def _finger(
    g: np.random.Generator,
    at_s: FloatArray,
    xy_mm: FloatArray,
    hand: tuple[float, float] | None = None,
) -> Finger:
    """``hand``: radius and contrast about which the fingers of one hand lie."""
    radius, contrast = _hand(g) if hand is None else hand
    if hand is not None:
        radius, contrast = (
            radius * float(g.uniform(0.9, 1.1)),
            contrast * float(g.uniform(0.9, 1.1)),
        )
    return Finger(at_s, xy_mm, radius, contrast, float(g.uniform(0.015, 0.05)))


def _hand(g: np.random.Generator) -> tuple[float, float]:
    """A finger conducts about nine times what the paper's gel does (``scene.laws``); lighter ones
    less."""
    return float(g.uniform(6.0, 9.5)), float(g.uniform(5.0, 10.0))


def _place(g: np.random.Generator, reach_mm: float) -> FloatArray:
    radius, angle = reach_mm * np.sqrt(g.uniform()), g.uniform(0, 2 * np.pi)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def _direction(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle)])


def _still(g: np.random.Generator, place: FloatArray, start_s: float, length_s: float) -> Finger:
    """A finger that rolls by at most 2 mm."""
    roll = g.uniform(0.0, 2.0) * _direction(g.uniform(0, 2 * np.pi))
    return _finger(g, np.array([start_s, start_s + length_s]), np.array([place, place + roll]))


def _tap(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    length = float(g.uniform(0.07, 0.2))
    return DrawnGesture("tap", (_still(g, _place(g, reach_mm), 0.0, length),), 0.0, length)


def _double_tap(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    place, (first, gap, second) = (
        _place(g, reach_mm),
        g.uniform([0.07, 0.08, 0.07], [0.16, 0.2, 0.16]),
    )
    aside = g.uniform(0.0, 5.0) * _direction(g.uniform(0, 2 * np.pi))
    one = _still(g, place, 0.0, float(first))
    again = _still(g, place + aside, float(first + gap), float(second))
    again = replace(again, radius_mm=one.radius_mm, contrast=one.contrast)
    return DrawnGesture("double-tap", (one, again), 0.0, float(first + gap + second))


def _hold(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    length = float(g.uniform(0.7, 1.5))
    return DrawnGesture("hold", (_still(g, _place(g, reach_mm), 0.0, length),), 0.0, length)


def _press(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    length = float(g.uniform(0.36, 0.42))
    return DrawnGesture("press", (_still(g, _place(g, reach_mm), 0.0, length),), 0.0, length)


def _swipe(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    """In an arc of little bend, lifted while it moves."""
    length, speed = float(g.uniform(45.0, 110.0)), float(g.uniform(150.0, 600.0))
    angle, bend = float(g.uniform(0, 2 * np.pi)), float(g.uniform(-0.12, 0.12))
    along = np.linspace(0.0, 1.0, STEPS + 1)
    forth, aside = _direction(angle), _direction(angle + np.pi / 2)
    path = length * (along[:, None] * forth + (4 * bend * along * (1 - along))[:, None] * aside)
    start = _place(g, reach_mm)
    finger = _finger(g, along * (length / speed), start + path)
    return DrawnGesture("swipe", (finger,), 0.0, length / speed, float(np.degrees(angle) % 360))


def _drag(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    """To a place, where it rests before it is lifted."""
    length, speed = float(g.uniform(30.0, 80.0)), float(g.uniform(40.0, 120.0))
    there, rest = length / speed, float(g.uniform(0.15, 0.3))
    start, forth = _place(g, reach_mm), _direction(g.uniform(0, 2 * np.pi))
    at_s = np.array([0.0, there, there + rest])
    finger = _finger(g, at_s, np.array([start, start + length * forth, start + length * forth]))
    return DrawnGesture("drag", (finger,), 0.0, there + rest)


def _two(
    g: np.random.Generator, kind: str, reach_mm: float, distance_mm: FloatArray, angle: FloatArray
) -> DrawnGesture:
    """Two fingers so far apart and at such an angle at each of STEPS + 1 times; they land and lift
    within 40 ms of each other, and rest at most 0.1 s at either end."""
    length = float(g.uniform(0.3, 1.0))
    before, after = g.uniform(0.02, 0.1, 2)
    fixed = float(g.uniform(0.0, 1.0)) * 0.5  # 0: one of them stays, 0.5: both move alike
    middle = _place(g, reach_mm)
    early, late = g.uniform(0.0, 0.04, 2), g.uniform(0.0, 0.04, 2)
    fingers, hand = [], _hand(g)
    eased = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, STEPS + 1))
    across = np.interp(eased, np.linspace(0.0, 1.0, STEPS + 1), distance_mm)
    turned = np.interp(eased, np.linspace(0.0, 1.0, STEPS + 1), angle)
    vector = across[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
    moving = before + length * np.linspace(0.0, 1.0, STEPS + 1)
    for which, part in enumerate((fixed, fixed - 1.0)):
        path = middle + part * vector
        at_s = np.concatenate(
            [[early[which]], moving + 0.04, [before + length + 0.08 + after - late[which]]]
        )
        fingers.append(_finger(g, at_s, np.vstack([path[:1], path, path[-1:]]), hand))
    end = min(float(finger.at_s[-1]) for finger in fingers)
    return DrawnGesture(kind, tuple(fingers), 0.0, end)


def _pinch(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    far, near, angle = g.uniform(70, 120), g.uniform(24, 45), g.uniform(0, 2 * np.pi)
    return _two(g, "pinch", reach_mm, np.linspace(far, near, STEPS + 1), np.full(STEPS + 1, angle))


def _spread(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    far, near, angle = g.uniform(70, 120), g.uniform(24, 45), g.uniform(0, 2 * np.pi)
    return _two(g, "spread", reach_mm, np.linspace(near, far, STEPS + 1), np.full(STEPS + 1, angle))


def _rotate(g: np.random.Generator, reach_mm: float) -> DrawnGesture:
    across, angle = g.uniform(45, 100), g.uniform(0, 2 * np.pi)
    turn = np.radians(g.uniform(40, 120)) * (1 if g.uniform() < 0.5 else -1)
    path = angle + np.linspace(0.0, turn, STEPS + 1)
    return _two(g, "rotate", reach_mm, np.full(STEPS + 1, across), path)


_MAKERS = {
    "tap": _tap, "double-tap": _double_tap, "hold": _hold, "swipe": _swipe, "pinch": _pinch,
    "spread": _spread, "rotate": _rotate, "drag": _drag, "press": _press,
}  # fmt: skip
