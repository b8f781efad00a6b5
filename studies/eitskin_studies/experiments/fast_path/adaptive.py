"""Drives chosen as they are measured, where touches are least sure, against fixed orders at equal
time: the numpy fast path alone, without whole frames beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.model.model import Model
from eitskin.progress import Progress
from eitskin.scoring.matching import GATE_MM
from eitskin_reference.constants_table import FAST_MODEL_ERROR
from eitskin_reference.fast.path import FastPath
from eitskin_reference.fast.tracks import SIZE, C, X, Y
from eitskin_reference.row_gains import row_gains
from eitskin_studies.experiments.experiment import ExperimentSettings, Table
from eitskin_studies.experiments.fast_path.scans import GRACE_S, ROW_S, STEP, TARE_FRAMES
from eitskin_studies.experiments.fast_path.states import (
    ELEMENTS,
    Keyframes,
    States,
    draw_states,
)

MEASURED = {
    "with_false": "scenes with a false touch",
    "missed": "fingers missed",
    "first_ms": "report, ms",
    "first_mm": "error then, mm",
    "moving_mm": "error, mm",
}
TITLE = "Drives chosen as they are measured, against fixed orders at equal time"
ROUND = 24  # each drive is measured at least once in so many
BEFORE_S, HELD_S, AFTER_S, LATER_S = 0.04, 0.08, 0.05, 0.03


class WatchedPath(FastPath):
    """Says what a drive is worth."""

    def waiting(self) -> set[int]:
        """Numbers of the drives that wait for a touch that explains them."""
        return {one.number for one in self._held}

    def gains(self) -> FloatArray:
        """By how much each drive (n,) would lessen the variances of places, mm^2."""
        n, tracks = SIZE * len(self.tracks), self.tracks
        places, found = np.arange(n) % SIZE < C, np.zeros(len(self.drives))
        for number, drive in enumerate(self.drives):
            h, error = np.zeros((len(drive.rows), n)), np.zeros(len(drive.rows))
            for at, state in zip(range(0, n, SIZE), tracks.state, strict=True):
                answer = self.rows.answer(drive, state[X], state[Y])[0]
                h[:, at + X], h[:, at + Y] = state[C] * answer[1:]
                h[:, at + C] = answer[0]
                error += (FAST_MODEL_ERROR * state[C] * answer[0]) ** 2
            moved = h @ tracks.p
            s = moved @ h.T + np.diag(error + self._sigma**2)
            found[number] = np.sum(moved[:, places] * np.linalg.solve(s, moved[:, places]))
        return found

    def energies(self) -> FloatArray:
        """What a touch gives of each drive (n,) at the map's greatest cell; zero where there is
        none."""
        score = self._births.score
        if not score.any():
            return np.zeros(len(self.drives))
        x_mm, y_mm = self.rows.centres_mm[self._births.cells[int(np.argmax(score))]]
        answers = [self.rows.answer(drive, x_mm, y_mm)[0][0] for drive in self.drives]
        return np.array([np.sum(answer**2) for answer in answers])


Chooser = Callable[[WatchedPath, FloatArray], int]


def fixed(step: int) -> Chooser:
    """Drives ``step`` further than the last."""
    return lambda path, age: int((np.argmin(age) + step) % len(age))


def adaptive(path: WatchedPath, age: FloatArray) -> int:
    """The drive that lessens the variances of places most; while drives wait for a touch, that of
    the others in which it would be strongest; where nothing touches or a round is due, that which
    is oldest. ``age`` (n,) counts drives since each was measured."""
    oldest = np.argsort(-age, kind="stable")
    waiting = path.waiting()
    if not (age[oldest] + np.arange(len(age)) >= ROUND).any():
        if waiting:
            worth = path.energies()
            worth[list(waiting)] = 0.0
            if worth.any():
                return int(np.argmax(worth))
        elif len(path.tracks):
            return int(np.argmax(path.gains()))
    return int(oldest[0])


@dataclass(frozen=True)
class Finger:
    """A touch by keyframes, and while it moves."""

    path: Keyframes
    moves: tuple[float, float] = (np.inf, -np.inf)

    def place(self, time_s: float) -> FloatArray:
        keys = np.array(self.path)
        return np.array([np.interp(time_s, keys[:, 0], keys[:, k]) for k in (1, 2)])


@dataclass(eq=False)
class Told:
    """False drives; of each finger the first report's delay, s, and error, mm; errors in mm while
    one moves."""

    false: int = 0
    first: dict[int, tuple[float, float]] = field(default_factory=dict)
    moving: list[float] = field(default_factory=list)
    fingers: int = 0


@dataclass(frozen=True)
class Scene:
    """A line of the table: ``count`` scenes of states ``kind``."""

    name: str
    kind: str
    count: int
    make: Callable[[FloatArray, float], list[Finger]]
    snr_db: float = 60.0


def scenes() -> list[Scene]:
    """Those of the page."""
    light, fast = partial(_press, rise_s=0.03), partial(_swipe, speed_mm_per_s=300.0)
    return [
        Scene("press, rise 30 ms", "presses", 60, light),
        Scene("press, rise 30 ms, 40 dB", "presses", 60, light, 40.0),
        Scene("swipe at 100 mm/s", "swipes", 16, partial(_swipe, speed_mm_per_s=100.0)),
        Scene("swipe at 300 mm/s", "swipes", 24, fast),
        Scene("swipe at 600 mm/s", "swipes", 24, partial(_swipe, speed_mm_per_s=600.0)),
        Scene("swipe at 300 mm/s, 40 dB", "swipes", 24, fast, 40.0),
        Scene("a second finger 30 ms later", "pairs", 40, _one_after_another),
    ]


def compare(
    model: Model, blob: bytes, settings: ExperimentSettings, progress: Progress
) -> tuple[list[dict[str, Any]], Table]:
    """Every scene by every order, and the table of it."""
    orders = {"as they stand": fixed(1), f"by {STEP}": fixed(STEP), "chosen": adaptive}
    listed = [(scene, settings.count(scene.count)) for scene in scenes()]
    drawn, found = dict[str, States](), []
    for kind in sorted({scene.kind for scene, _ in listed}):
        most = max(count for scene, count in listed if scene.kind == kind)
        drawn[kind] = draw_states(model, kind, most, settings.seed, ELEMENTS)
    for scene, count in progress(listed, "choosing drives"):
        for name, choose in orders.items():
            told = [
                play(model, blob, drawn[scene.kind], k, scene, choose, settings.seed)
                for k in range(count)
            ]
            found.append({"scene": scene.name, "drives": name, **_summary(told)})
    return found, table(found)


def table(found: list[dict[str, Any]]) -> Table:
    """Of what was found: a column an order, a row for each thing that was measured in a scene."""
    names = list(dict.fromkeys(one["drives"] for one in found))
    by_scene: dict[str, list[dict[str, Any]]] = {}
    for one in found:
        by_scene.setdefault(one["scene"], []).append(one)
    rows = [
        (f"{scene}: {title}", *(_cell(one[key]) for one in of))
        for scene, of in by_scene.items()
        for key, title in MEASURED.items()
        if any(one[key] != () for one in of)
    ]
    return Table("orders", ("median, p95", *names), tuple(rows))


def _press(places: FloatArray, from_s: float, *, rise_s: float) -> list[Finger]:
    up_s = from_s + rise_s
    keys = ((from_s, 0.0), (up_s, 1.0), (up_s + HELD_S, 1.0), (up_s + HELD_S + rise_s, 0.0))
    return [Finger([(t, *places[0], press) for t, press in keys])]


def _swipe(places: FloatArray, from_s: float, *, speed_mm_per_s: float) -> list[Finger]:
    moves_s = float(np.hypot(*(places[1] - places[0]))) / speed_mm_per_s
    times = from_s + np.cumsum((0.0, HELD_S / 2, moves_s, HELD_S / 2))
    path = [(float(t), *places[k], 1.0) for t, k in zip(times, (0, 0, 1, 1), strict=True)]
    return [Finger(path, (float(times[1]), float(times[2])))]


def _one_after_another(places: FloatArray, from_s: float) -> list[Finger]:
    to_s = from_s + LATER_S + HELD_S
    return [
        Finger([(begin_s, *at, 1.0), (to_s, *at, 1.0)])
        for at, begin_s in zip(places, (from_s, from_s + LATER_S), strict=True)
    ]


def _summary(told: list[Told]) -> dict[str, Any]:
    first = np.array([one for each in told for one in each.first.values()]).reshape(-1, 2)
    moving = np.array([error for each in told for error in each.moving])
    return {
        "scenes": len(told),
        "with_false": sum(each.false > 0 for each in told),
        "missed": sum(each.fingers - len(each.first) for each in told),
        "first_ms": _quantiles(1e3 * first[:, 0]),
        "first_mm": _quantiles(first[:, 1]),
        "moving_mm": _quantiles(moving),
    }


def _quantiles(values: FloatArray) -> tuple[float, ...]:
    """Median and 95 % quantile."""
    return tuple(float(np.quantile(values, q)) for q in (0.5, 0.95)) if values.size else ()


def _cell(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(f"{each:.1f}" if each >= 4 else f"{each:.2f}" for each in value) or "-"
    return str(value)


def play(
    model: Model,
    blob: bytes,
    states: States,
    k: int,
    scene: Scene,
    choose: Chooser,
    seed: int,
) -> Told:
    """``scene`` at place ``k`` of ``states``, its drives as ``choose`` says."""
    rng, v0 = np.random.default_rng([seed, k]), states.v0[k]
    sigma = float(np.sqrt(np.mean(v0**2))) / 10 ** (scene.snr_db / 20)
    fingers = scene.make(states.places[k], BEFORE_S + ROW_S * len(v0) * float(rng.uniform()))
    path, out = _tared(model, blob, v0, sigma, rng), Told(fingers=len(fingers))
    count = len(path.drives)
    age = np.zeros(count)
    age[[STEP * n % count for n in range(count)]] = np.arange(count, 0, -1)
    ends_s = max(one.path[-1][0] for one in fingers) + AFTER_S
    rows_at = states.rows_at(k, [one.path for one in fingers], ends_s)
    begins_s = 0.0
    while begins_s < ends_s:
        number = choose(path, age)
        rows = path.drives[number].rows
        age += 1
        age[number] = 0
        times = np.full(len(v0), begins_s)
        times[rows] += ROW_S * np.arange(len(rows))
        volts = rows_at(times)[rows] + sigma * rng.standard_normal(len(rows))
        end_s = begins_s + ROW_S * len(rows)
        middle_s = (begins_s + end_s) / 2
        told = path.drive(number, volts, middle_s)
        _score(out, fingers, [np.array([one.x_mm, one.y_mm]) for one in told], middle_s, end_s)
        begins_s = end_s
    return out


def _tared(
    model: Model, blob: bytes, v0: FloatArray, sigma: float, rng: np.random.Generator
) -> WatchedPath:
    engine, path = CoreEngine(blob, "float64"), WatchedPath(model)
    engine.set_reference(v0 + sigma * rng.standard_normal((TARE_FRAMES, len(v0))))
    lib, ffi, _, context = engine.handles
    learned = ffi.new("eits_reference_info *")
    lib.eits_get_reference(context, learned)
    mean = np.array(ffi.unpack(learned.v0, len(v0)))
    gains = row_gains(model, np.isfinite(mean), learned.gain * mean)[0]
    path.tare(mean, learned.noise_v, learned.gain * gains)
    return path


def _score(
    out: Told,
    fingers: Sequence[Finger],
    told: Sequence[FloatArray],
    middle_s: float,
    end_s: float,
) -> None:
    free = {
        n for n, one in enumerate(fingers)
        if one.path[0][0] <= end_s <= one.path[-1][0] + GRACE_S
    }  # fmt: skip
    for place in told:
        away = {n: float(np.hypot(*(fingers[n].place(middle_s) - place))) for n in free}
        n = min(away, key=lambda each: away[each], default=-1)
        if n < 0 or away[n] > GATE_MM:
            out.false += 1
            continue
        free.remove(n)
        out.first.setdefault(n, (end_s - fingers[n].path[0][0], away[n]))
        if fingers[n].moves[0] <= middle_s <= fingers[n].moves[1]:
            out.moving.append(away[n])
