"""Scenes beyond presses, swipes and pairs on the prebuilt skin: what else fingers do, and other
scans and skins."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin.skin.electrodes import Electrodes
from eitskin.skin.protocol import Protocol, adjacent, in_order, table
from eitskin.skin.skin import Skin, paper_skin
from eitskin_studies.experiments.fast_path.scans import (
    ROW_S,
    STEP,
    Outcome,
    Player,
    Scan,
    TrueInTime,
)
from eitskin_studies.experiments.fast_path.states import Keyframes, States, Touched, place_on

Paths = Sequence[tuple[Keyframes, TrueInTime]]

FINGER, INSULATING = Touched(), Touched(law="insulating", contrast=0.2)
BEFORE_S, HELD_S, AFTER_S = 0.06, 0.12, 0.06
GROWS_MM, GROWS_S = (3.0, 10.0), 0.06
CREPT, LEFT, FADES_S = 0.8, 0.04, 0.4  # of a press; so little is a tenth of its signal
CROSSING_MM, CROSSING_MM_PER_S, CROSSING_APART_S = 60.0, 300.0, 0.1
HAND_MM, HAND_PRESS, HAND_FIRST_S, HAND_APART_MM = 20.0, 0.25, 0.2, 55.0


@dataclass(frozen=True)
class Row:
    """A line of the table: ``count`` scenes of ``places``, (n, 2) mm, and the ``paths`` of touches
    there that begin at a time."""

    name: str
    count: int
    places: Callable[[Skin, np.random.Generator], FloatArray]
    paths: Callable[[FloatArray, float], Paths]
    touched: Touched = FINGER
    electrodes: int = 16
    half: bool = False


def rows() -> list[Row]:
    """Return the rows of the page."""
    slow, sudden = partial(_pressed, rise_s=0.06), partial(_pressed, rise_s=0.0)
    later, one = partial(slow, later_s=0.06), partial(_apart, count=1)
    three, five = (partial(_apart, count=count) for count in (3, 5))
    return [
        Row("contact grows from 3 to 10 mm in 60 ms", 100, one, _growing),
        Row("insulating, rise 60 ms", 100, one, slow, INSULATING),
        Row("strength creeps, a tenth stays and fades", 60, one, _creeping),
        Row("two fingers 20 to 35 mm apart, rise 60 ms", 100, _near, slow),
        Row("three fingers at once, rise 60 ms", 60, three, slow),
        Row("three fingers, 60 ms after each other", 60, three, later),
        Row("five fingers, 60 ms after each other", 30, five, later),
        Row("two fingers cross at 300 mm/s", 40, _crossing_places, _crossing),
        Row("a hand rests, then a finger", 60, _hand_places, _hand),
        Row("half scan, press, rise 0 ms", 100, one, sudden, half=True),
        Row("half scan, press, rise 60 ms", 100, one, slow, half=True),
        Row("32 electrodes, press, rise 60 ms", 40, one, slow, electrodes=32),
    ]


class HalfPlayer(Player):
    """Every second drive alone: a frame takes half the time, and the other rows are masked."""

    def __init__(self, model: Model, blob: bytes) -> None:
        super().__init__(model, blob)
        self.drives = [2 * (3 * k % 8) for k in range(8)]
        out = np.ones(model.protocol.n_rows, dtype=np.bool_)
        out[np.concatenate([self.fast.rows[number] for number in self.drives])] = False
        self.engine.mask_rows(out)
        enough = replace(default_options(model), max_masked=len(out) * 3 // 4)
        self.engine.set_options(enough)


@cache
def model_of(electrodes: int) -> tuple[Model, bytes]:
    """The prebuilt model, or one of the same skin with more electrodes."""
    if electrodes == 16:
        return load_prebuilt()
    skin = replace(paper_skin(), electrodes=Electrodes(count=electrodes))
    model = build_model(skin, adjacent(electrodes), BuildSettings(samples=0))
    return model, encode_model(model)


def play(row: Row, count: int, seed: int, number: int, elements: int) -> list[Outcome]:
    """``count`` scenes of the row of this number."""
    model, blob = model_of(row.electrodes)
    rng = np.random.default_rng([seed, 1000 + number])
    places = np.array([row.places(model.skin, rng) for _ in range(count)])
    skins = np.sort(rng.integers(2**32, size=min(4, count)))
    seeds = [int(skins[k * len(skins) // count]) for k in range(count)]
    protocol, measured = _scanned(model.protocol, row.half)
    states = States(places, seeds, protocol, elements, row.touched, model.skin)
    return [
        _played(row, model, blob, states, k, measured, np.random.default_rng([seed, number, k]))
        for k in range(count)
    ]


def _scanned(protocol: Protocol, half: bool) -> tuple[Protocol, IntArray]:
    """Return the part of a protocol that is scanned, in its order, and the numbers of its rows."""
    if not half:
        return in_order(protocol, f"by {STEP}"), np.arange(protocol.n_rows)
    drive = np.repeat(
        np.arange(len(protocol.drive_starts)),
        np.diff([*protocol.drive_starts, protocol.n_rows]),
    )
    rows = np.flatnonzero(drive % 2 == 0)
    part = table(protocol.n_electrodes, protocol.drive_measure[rows], protocol.current_a)
    return in_order(part, "by 3"), rows


def _played(
    row: Row,
    model: Model,
    blob: bytes,
    states: States,
    k: int,
    measured: IntArray,
    rng: np.random.Generator,
) -> Outcome:
    player = HalfPlayer(model, blob) if row.half else Player(model, blob)
    if row.touched.law == "insulating":
        player.engine.set_options(replace(default_options(model), sign="decrease"))
    v0, sigma = np.zeros(model.protocol.n_rows), float(np.sqrt(np.mean(states.v0[k] ** 2))) / 1e3
    v0[measured] = states.v0[k]
    player.tare(v0, sigma, rng)
    begin_s = BEFORE_S + ROW_S * len(measured) * float(rng.uniform())
    touches = row.paths(states.places[k], begin_s)
    ends_s = max(path[-1][0] for path, _ in touches) + AFTER_S
    scan = Scan.of(player.fast, ends_s, player.drives)
    volts = states.volts(k, [path for path, _ in touches], scan.frames)
    noisy = volts + sigma * rng.standard_normal(len(volts))
    return player.play(scan, noisy, [true for _, true in touches])


# ---- places ----


def _apart(
    skin: Skin,
    rng: np.random.Generator,
    *,
    count: int,
    least_mm: float = 35.0,
    most_mm: float = np.inf,
) -> FloatArray:
    """Return places with the given distance between neighbours."""
    while True:
        places = np.array([place_on(skin, rng) for _ in range(count)])
        away = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(count, 1)]
        if ((away >= least_mm) & (away <= most_mm)).all():
            return places


def _near(skin: Skin, rng: np.random.Generator) -> FloatArray:
    return _apart(skin, rng, count=2, least_mm=20.0, most_mm=35.0)


def _crossing_places(skin: Skin, rng: np.random.Generator) -> FloatArray:
    """From, to of one finger and of another at right angles to it."""
    middle, angle = 0.3 * place_on(skin, rng), rng.uniform(0, 2 * np.pi)
    along = CROSSING_MM / 2 * np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    return np.array([middle - along, middle + along, middle - across, middle + across])


def _hand_places(skin: Skin, rng: np.random.Generator) -> FloatArray:
    while True:
        hand, finger = 0.7 * place_on(skin, rng), place_on(skin, rng)
        if np.hypot(*(hand - finger)) >= HAND_APART_MM:
            return np.array([hand, finger])


# ---- what touches do ----


def _at(place: FloatArray, from_s: float, to_s: float) -> TrueInTime:
    return TrueInTime(from_s, to_s, lambda _: place)


def _pressed(places: FloatArray, begin_s: float, *, rise_s: float, later_s: float = 0.0) -> Paths:
    """One after the other, all lifted together."""
    to_s, listed = begin_s + later_s * (len(places) - 1) + rise_s + HELD_S, []
    for k, at in enumerate(places):
        from_s = begin_s + later_s * k
        path = [(from_s, *at, 0.0), (from_s + rise_s, *at, 1.0)][rise_s == 0 :]
        path += [(to_s, *at, 1.0), (to_s + rise_s, *at, 0.0)][: 2 - (rise_s == 0)]
        listed.append((path, _at(at, from_s, to_s + rise_s)))
    return listed


def _growing(places: FloatArray, begin_s: float) -> Paths:
    (at,), (least, most) = places, GROWS_MM
    times = begin_s + np.array([0.0, GROWS_S, GROWS_S + HELD_S, 2 * GROWS_S + HELD_S])
    path = [
        (float(t), *at, press, radius)
        for t, press, radius in zip(times, (0, 1, 1, 0), (least, most, most, least), strict=True)
    ]
    return [(path, _at(at, begin_s, float(times[-1])))]


def _creeping(places: FloatArray, begin_s: float) -> Paths:
    """Its strength grows from 0.8 to 1 while it is held, and a tenth is left when it is lifted."""
    (at,), steps = places, (0.06, 0.5, 0.06, FADES_S)
    times = begin_s + np.cumsum((0.0, *steps))
    path = [(float(t), *at, press) for t, press in zip(times, (0, CREPT, 1, LEFT, 0), strict=True)]
    return [(path, _at(at, begin_s, float(times[3])))]


def _crossing(places: FloatArray, begin_s: float) -> Paths:
    """Return two crossing fingers; the second one comes to the crossing later by the given time."""
    moves_s, listed = CROSSING_MM / CROSSING_MM_PER_S, []
    for k, (here, there) in enumerate((places[:2], places[2:])):
        from_s = begin_s + k * CROSSING_APART_S
        times = [from_s, from_s + 0.04, from_s + 0.04 + moves_s, from_s + 0.08 + moves_s]
        path = [(t, *at, 1.0) for t, at in zip(times, (here, here, there, there), strict=True)]
        listed.append((path, TrueInTime(from_s, times[-1], partial(_between, path))))
    return listed


def _between(path: Keyframes, time_s: float) -> FloatArray:
    keys = np.array(path)
    return np.array([np.interp(time_s, keys[:, 0], keys[:, k]) for k in (1, 2)])


def _hand(places: FloatArray, begin_s: float) -> Paths:
    """A wide, light contact that stays, and a finger beside it."""
    hand, finger = places
    ((path, truth),) = _pressed(finger[None], begin_s + HAND_FIRST_S, rise_s=0.03)
    ends_s = path[-1][0] + 0.02
    rests = [(begin_s, 0.0), (begin_s + 0.12, HAND_PRESS), (ends_s, HAND_PRESS)]
    resting = [(t, *hand, press, HAND_MM) for t, press in rests]
    return [(resting, _at(hand, begin_s, ends_s)), (path, truth)]
