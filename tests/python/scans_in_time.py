"""Scans whose rows are each measured at their own instant while touches land, move and lift, played
drive by drive through the core's fast path, and what it reports of them.

The scenes of ``eitskin study fast-path`` are like these; these stay as they are, since tests have
bounds for them.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from eitskin.core.engine import CoreEngine
from eitskin.core.fast import AlignedFrame, FastCore, FastTouch
from eitskin.core.results import Info, Reconstruction
from eitskin.model.model import Model
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import scene_from_table
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scoring.matching import GATE_MM
from eitskin.skin.protocol import in_order

ROW_S = 1e-4
TARE_FRAMES = 64
STEP = 7  # drives follow by 7: neighbours in time are far apart on the skin
GRACE_S = 0.03  # a touch that has lifted may be reported for so long
BEFORE_S, HELD_S, AFTER_S = 0.06, 0.08, 0.06
SWIPE_HELD_S = 0.04
FAULT_S = 0.04  # a fault begins here, the press later
FAULTED_PRESS_S, FAULTED_END_S = 0.15, 0.33
LEAST_MM = {"presses": 0.0, "swipes": 70.0, "pairs": 35.0}  # between the places of a scene
REACH = 0.83  # of the skin's radius: where touches are

Keyframes = Sequence[tuple[float, ...]]
_MESHES = MeshCache()


@dataclass(frozen=True, eq=False)
class Scan:
    """Rows ``row`` (t,) of the protocol at ``time_s`` (t,), drive after drive."""

    row: np.ndarray
    time_s: np.ndarray
    frames: int


def order(fast: FastCore) -> list[int]:
    """Drives of a frame in time."""
    count = len(fast.rows)
    return [STEP * k % count for k in range(count)] if count % STEP else list(range(count))


def scan_of(fast: FastCore, lasts_s: float) -> Scan:
    """Whole frames for at least ``lasts_s``."""
    once = np.concatenate([fast.rows[drive] for drive in order(fast)])
    frames = int(np.ceil(lasts_s / (ROW_S * len(once))))
    return Scan(np.tile(once, frames), ROW_S * np.arange(frames * len(once)), frames)


@dataclass(frozen=True)
class TrueInTime:
    """A finger from ``from_s`` to ``to_s``, and where it is."""

    from_s: float
    to_s: float
    place: Callable[[float], np.ndarray]


@dataclass(eq=False)
class Outcome:
    """Reports of one scene: false touches; for each finger the delay of its first report and the
    error then (or None), and the errors after each drive; counts of frames; the number of touches
    after each drive."""

    false: int = 0
    first: list[tuple[float, float] | None] = field(default_factory=list)
    errors: list[list[float]] = field(default_factory=list)
    frames: Counter[str] = field(default_factory=Counter)
    reported: list[int] = field(default_factory=list)


class Player:
    """Plays scans through the C core's fast path, the whole-frame solver beside it, both of
    ``width``."""

    def __init__(self, model: Model, blob: bytes, width: str = "float32") -> None:
        self.model, self.engine = model, CoreEngine(blob, width)
        self.fast = FastCore(self.engine)
        self.drives = order(self.fast)

    def tare(self, v0: np.ndarray, sigma: float, rng: np.random.Generator) -> None:
        """Take the reference from noisy frames of ``v0`` (m,) V."""
        self.engine.set_reference(v0 + sigma * rng.standard_normal((TARE_FRAMES, len(v0))))
        self.engine.forget()
        self.fast.begin()

    def drive(self, number: int, volts: np.ndarray, time_s: float) -> list[FastTouch]:
        return self.fast.drive(number, volts, time_s)

    def aligned(self, frame: np.ndarray) -> AlignedFrame:
        """The scan at one instant."""
        return self.fast.aligned(frame)

    def named(self, found: Info) -> Info:
        """The solver's diagnostics that are reported."""
        return self.fast.named(found)

    def confirm(self, found: Reconstruction) -> list[FastTouch]:
        """The touches, with those of the solver's."""
        return self.fast.confirm(found.touches)

    def play(self, scan: Scan, volts: np.ndarray, truth: Sequence[TrueInTime]) -> Outcome:
        """``volts`` (t,) as ``scan`` measured them."""
        out = Outcome(first=[None] * len(truth), errors=[[] for _ in truth])
        frame, at = np.full(self.model.protocol.n_rows, np.nan), 0
        while at < len(volts):
            for number in self.drives:
                rows = self.fast.rows[number]
                mine = slice(at, at + len(rows))
                at += len(rows)
                end_s = float(scan.time_s[mine][-1]) + ROW_S
                middle_s = (float(scan.time_s[mine][0]) + end_s) / 2
                frame[rows] = volts[mine]
                touches = self.drive(number, volts[mine], middle_s)
                if number == self.drives[-1]:
                    touches = self._whole_frame(frame, out)
                _score(out, truth, touches, middle_s, end_s)
        return out

    def _whole_frame(self, frame: np.ndarray, out: Outcome) -> list[FastTouch]:
        aligned = self.aligned(frame)
        out.frames["frames"] += 1
        out.frames["explained"] += aligned.explained
        out.frames["same"] += np.array_equal(
            aligned.volts, frame.astype(aligned.volts.dtype), equal_nan=True
        )
        if not aligned.trusted:
            return self.fast.touches()
        found = self.engine.reconstruct(aligned.volts)
        out.frames["named"] += bool(self.named(found.info).diagnostics_by_name)
        return self.confirm(found)


def _score(
    out: Outcome,
    truth: Sequence[TrueInTime],
    touches: Sequence[FastTouch],
    at_s: float,
    end_s: float,
) -> None:
    out.reported.append(len(touches))
    free = [k for k, one in enumerate(truth) if one.from_s <= end_s <= one.to_s + GRACE_S]
    for touch in touches:
        away = {
            k: float(np.hypot(*(truth[k].place(at_s) - (touch.x_mm, touch.y_mm)))) for k in free
        }
        k = min(away, key=lambda each: away[each], default=-1)
        if k < 0 or away[k] > GATE_MM:
            out.false += 1
            continue
        free.remove(k)
        out.errors[k].append(away[k])
        out.first[k] = out.first[k] or (end_s - truth[k].from_s, away[k])


# ---- skins and what a scan measures on them ----


class States:
    """``places`` (n, k, 2) of n presses, swipes (from, to) or pairs, and ``v0`` (n, m) of skins
    whose contacts were drawn."""

    def __init__(self, model: Model, kind: str, count: int, seed: int, elements: int) -> None:
        rng = np.random.default_rng([seed, ("presses", "swipes", "pairs").index(kind)])
        self.places = np.array([_places(model, rng, kind) for _ in range(count)])
        self._seeds = rng.integers(2**32, size=count).tolist()
        self._protocol, self._elements = in_order(model.protocol, f"by {STEP}"), elements
        self.v0 = np.array([self._simulated(k, (), 1)[0] for k in range(count)])

    def volts(self, k: int, paths: Sequence[Keyframes], frames: int) -> np.ndarray:
        """Rows (t,) in V of ``frames`` scans of skin ``k`` in the order of their times; of each
        touch ``paths`` has keyframes (s, mm, mm, press), the last held where it is at infinity."""
        return self._simulated(k, paths, frames)[1:].ravel()

    def _simulated(self, k: int, paths: Sequence[Keyframes], frames: int) -> np.ndarray:
        """An untouched frame as the protocol stands, then ``frames`` scans in their order."""
        head = {"seed": self._seeds[k], "elements": self._elements, "quiet_frames": 1,
                "frames": frames, "rate_hz": 1 / (ROW_S * self._protocol.n_rows)}  # fmt: skip
        effects = {"contact_impedance": {"spread": 0.3}}
        table = {"scene": head, "touch": [_touch(path) for path in paths], "effects": effects}
        scene = replace(scene_from_table(table, "scans", Path()), protocol=self._protocol)
        volts = simulate_frames(compile_scene(scene, mesh_cache=_MESHES)).voltage_v
        volts[1:] = volts[1:, self._protocol.scan_rows]
        return volts


def _touch(path: Keyframes) -> dict[str, object]:
    names = ("t_s", "x_mm", "y_mm", "press")
    keys = [dict(zip(names, key, strict=True)) for key in path if np.isfinite(key[0])]
    disc = {"radius_mm": 8.0, "contrast": 5.0, "law": "short_circuit"}
    return {**disc, "hold": len(keys) < len(path), "path": keys}


def _places(model: Model, rng: np.random.Generator, kind: str) -> np.ndarray:
    x0, _, x1, _ = model.skin.outline.bounding_box_mm
    while True:
        places = []
        for _ in range(1 if kind == "presses" else 2):
            radius = REACH * (x1 - x0) / 2 * np.sqrt(rng.uniform())
            angle = rng.uniform(0, 2 * np.pi)
            places.append(radius * np.array([np.cos(angle), np.sin(angle)]))
        if np.hypot(*(places[0] - places[-1])) >= LEAST_MM[kind]:
            return np.array(places)


# ---- scenes: each plays scene k of the states, with white noise of sigma V ----

Scene = Callable[[Player, States, int, np.random.Generator, float], Outcome]


def played(
    scene: Scene, states: States, k: int, player: Player, seed: int, snr_db: float = 60.0
) -> Outcome:
    """``scene`` after a tare."""
    rng = np.random.default_rng([seed, k])
    sigma = float(np.sqrt(np.mean(states.v0[k] ** 2))) / 10 ** (snr_db / 20)
    player.tare(states.v0[k], sigma, rng)
    return scene(player, states, k, rng, sigma)


def _ramp(
    from_s: float, rise_s: float, to_s: float, begin: np.ndarray, end: np.ndarray
) -> Keyframes:
    """A touch that is whole ``rise_s`` after ``from_s`` and lifts from ``to_s`` on as slowly."""
    keys = [(from_s, *begin, 0.0), (from_s + rise_s, *begin, 1.0)][rise_s == 0 :]
    ends = [(to_s, *end, 1.0), (to_s + rise_s, *end, 0.0)]
    return [*keys, *ends[: 1 if rise_s == 0 else 2]]


def _begin(player: Player, rng: np.random.Generator) -> float:
    return BEFORE_S + ROW_S * player.model.protocol.n_rows * float(rng.uniform())


def _scanned(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    lasts_s: float,
    touches: Sequence[tuple[Keyframes, TrueInTime]],
) -> Outcome:
    scan = scan_of(player.fast, lasts_s)
    volts = states.volts(k, [path for path, _ in touches], scan.frames)
    noise = sigma * rng.standard_normal(len(volts))
    return player.play(scan, volts + noise, [true for _, true in touches])


def press(
    player: Player, states: States, k: int, rng: np.random.Generator, sigma: float, *, rise_s: float
) -> Outcome:
    """One finger."""
    from_s, place = _begin(player, rng), states.places[k][0]
    to_s = from_s + rise_s + HELD_S
    path = _ramp(from_s, rise_s, to_s, place, place)
    truth = TrueInTime(from_s, to_s + rise_s, lambda _: place)
    lasts_s = to_s + rise_s + AFTER_S
    return _scanned(player, states, k, rng, sigma, lasts_s, [(path, truth)])


def pair(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    rise_s: float = 0.0,
    later_s: float = 0.0,
) -> Outcome:
    """Two fingers, the second ``later_s`` after the first."""
    from_s = _begin(player, rng)
    to_s = from_s + rise_s + later_s + HELD_S

    def stays(place: np.ndarray, _: float) -> np.ndarray:
        return place

    touches = [
        (
            _ramp(from_s + late_s, rise_s, to_s, place, place),
            TrueInTime(from_s + late_s, to_s + rise_s, partial(stays, place)),
        )
        for place, late_s in zip(states.places[k], (0.0, later_s), strict=True)
    ]
    return _scanned(player, states, k, rng, sigma, to_s + rise_s + AFTER_S, touches)


def swipe(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    speed_mm_per_s: float,
) -> Outcome:
    """A finger that stays, moves and stays."""
    here, there = states.places[k]
    moves_s = float(np.hypot(*(there - here))) / speed_mm_per_s
    from_s = _begin(player, rng)
    times_s = from_s + np.array([0.0, SWIPE_HELD_S, SWIPE_HELD_S + moves_s])
    to_s = float(times_s[-1]) + SWIPE_HELD_S
    path = [
        (float(t), *at, 1.0)
        for t, at in zip((*times_s, to_s), (here, here, there, there), strict=True)
    ]

    def place(time_s: float) -> np.ndarray:
        moved: np.ndarray = np.clip((time_s - times_s[1]) / moves_s, 0.0, 1.0) * (there - here)
        return here + moved

    truth = TrueInTime(from_s, to_s, place)
    return _scanned(player, states, k, rng, sigma, to_s + AFTER_S, [(path, truth)])


Spoil = Callable[[np.ndarray, Player, Scan, float, np.random.Generator], np.ndarray]


def fault(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    spoil: Spoil,
    pressed: bool = True,
) -> Outcome:
    """A fault, and later a finger that stays."""
    scan, paths, truth = scan_of(player.fast, FAULTED_END_S), [], []
    if pressed:
        place, up_s = states.places[k][0], FAULTED_PRESS_S + 0.03
        paths = [[(FAULTED_PRESS_S, *place, 0.0), (up_s, *place, 1.0), (np.inf, *place, 1.0)]]
        truth = [TrueInTime(FAULTED_PRESS_S, np.inf, lambda _: place)]
    volts = spoil(states.volts(k, paths, scan.frames), player, scan, sigma, rng)
    return player.play(scan, volts + sigma * rng.standard_normal(len(volts)), truth)


def nothing(volts: np.ndarray, *_: object) -> np.ndarray:
    return volts


def glitches(
    volts: np.ndarray, _: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    """One row of two frames."""
    late = np.flatnonzero(scan.time_s > FAULT_S)
    hit = rng.choice(late, len(volts) // 400, replace=False)
    spoiled = volts.copy()
    spoiled[hit] += float(np.abs(volts).max()) * rng.standard_normal(len(hit))
    return spoiled


def _rows_of_one(player: Player, scan: Scan, rng: np.random.Generator) -> np.ndarray:
    """Return which rows (t, 2) drive with a failing electrode, and which measure with it."""
    protocol = player.model.protocol
    table = protocol.drive_measure[scan.row] == rng.integers(protocol.n_electrodes)
    return table.reshape(-1, 2, 2).any(axis=2) & (scan.time_s[:, None] > FAULT_S)


def open_electrode(
    volts: np.ndarray, player: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    """No current flows by way of it, and it floats where it is measured."""
    drives, measures = _rows_of_one(player, scan, rng).T
    floating = 0.3 * float(rng.uniform(-1, 1)) * float(np.abs(volts).max())
    return np.where(drives, 0.0, np.where(measures, floating, volts))


def noisy_electrode(
    volts: np.ndarray, player: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    """Thirty times the noise."""
    spoiled = _rows_of_one(player, scan, rng)[:, 1]
    return volts + 30 * sigma * spoiled * rng.standard_normal(len(volts))


def drift(
    volts: np.ndarray, _: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    """The gain, by half a percent."""
    changed: np.ndarray = 1 + 0.005 * np.clip((scan.time_s - FAULT_S) / 0.1, 0, 1)
    return volts * changed


SCENES: dict[str, tuple[str, Scene]] = {  # each with the kind of its states
    "sudden press": ("presses", partial(press, rise_s=0.0)),
    "press in 60 ms": ("presses", partial(press, rise_s=0.06)),
    "two at once": ("pairs", pair),
    "one after another": ("pairs", partial(pair, later_s=0.03)),
    "and slowly": ("pairs", partial(pair, rise_s=0.06, later_s=0.06)),
    "swipe": ("swipes", partial(swipe, speed_mm_per_s=600.0)),
    "glitches": ("presses", partial(fault, spoil=glitches)),
    "open electrode": ("presses", partial(fault, spoil=open_electrode)),
    "noisy electrode": ("presses", partial(fault, spoil=noisy_electrode)),
    "drift": ("presses", partial(fault, spoil=drift)),
}
