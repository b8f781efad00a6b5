"""Touches that land, move and lift while rows are measured: the reports of the fast path after each
drive."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.model.prebuilt import load_prebuilt
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.fast_path import beyond
from eitskin_studies.experiments.fast_path.scans import (
    ROW_S,
    Outcome,
    Player,
    Scan,
    TrueInTime,
)
from eitskin_studies.experiments.fast_path.states import (
    ELEMENTS,
    Keyframes,
    States,
    draw_states,
)
from eitskin_studies.experiments.multitouch.counts import share

TITLE = "Touches after each drive: false ones, delay and error, while they land, move and lift"
BEFORE_S, HELD_S, AFTER_S = 0.06, 0.08, 0.06
SWIPE_HELD_S = 0.04
FAULT_S = 0.04  # a fault begins here, the press later
FAULTED_PRESS_S, FAULTED_END_S = 0.15, 0.33


@dataclass(frozen=True)
class Row:
    """A line of the table: ``count`` scenes of states ``kind``."""

    name: str
    kind: str
    count: int
    make: Callable[[Player, States, int, np.random.Generator, float], Outcome]
    snr_db: float = 60.0
    fault: tuple[str, ...] = ()  # diagnostics, any of which names it


def rows() -> list[Row]:
    """Return the rows of the page."""
    listed = [
        Row(f"press, rise {rise_ms} ms", "presses", 400, partial(_press, rise_s=rise_ms / 1e3))
        for rise_ms in (0, 30, 60, 120)
    ]
    listed += [
        Row(
            f"press, rise {rise_ms} ms, 40 dB",
            "presses",
            200,
            partial(_press, rise_s=rise_ms / 1e3),
            40.0,
        )
        for rise_ms in (0, 60)
    ]
    listed += [
        Row(f"swipe at {speed} mm/s", "swipes", 60, partial(_swipe, speed_mm_per_s=float(speed)))
        for speed in (200, 600, 1000)
    ]
    listed += [
        Row(
            f"two fingers at once, rise {rise_ms} ms",
            "pairs",
            200,
            partial(_pair, rise_s=rise_ms / 1e3),
        )
        for rise_ms in (0, 30)
    ]
    listed.append(Row("a second finger 30 ms later", "pairs", 200, partial(_pair, later_s=0.03)))
    listed.append(Row("quiet", "presses", 100, partial(_fault, spoil=_nothing, press=False)))
    electrode = "electrode open", "electrode noisy"
    faults: list[tuple[str, Spoil, tuple[str, ...]]] = [
        ("glitches", _glitches, ("outlier",)),
        ("electrode open", _open, electrode),
        ("electrode noisy", _noisy, electrode),
        ("gain drifts by 0.5 %", _drift, ("stale reference",)),
    ]
    return listed + [
        Row(f"{name}, then a press", "presses", 50, partial(_fault, spoil=spoil), fault=named)
        for name, spoil, named in faults
    ]


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    settings = workspace.settings
    model, blob = load_prebuilt()
    drawn: dict[str, States] = {}
    listed = [(row, settings.count(row.count)) for row in rows()]
    for kind in ("presses", "swipes", "pairs"):
        most = max(count for row, count in listed if row.kind == kind)
        drawn[kind] = draw_states(model, kind, most, settings.seed, ELEMENTS)
    found = []
    for number, (row, count) in enumerate(workspace.progress(listed, "playing")):
        outcomes = []
        for k in range(count):
            rng = np.random.default_rng([settings.seed, number, k])
            v0 = drawn[row.kind].v0[k]
            sigma = float(np.sqrt(np.mean(v0**2))) / 10 ** (row.snr_db / 20)
            player = Player(model, blob)
            player.tare(v0, sigma, rng)
            outcomes.append(row.make(player, drawn[row.kind], k, rng, sigma))
        found.append({"name": row.name, **_summary(outcomes, row.fault)})
    more = [
        {
            "name": one.name,
            **_summary(
                beyond.play(one, settings.count(one.count), settings.seed, number, ELEMENTS),
                (),
            ),
        }
        for number, one in enumerate(workspace.progress(beyond.rows(), "beyond"))
    ]
    words = (
        f"Seed {settings.seed}; discs of radius 8 mm and contrast 5; 60 dB unless a line says"
        f" otherwise; frames from {ELEMENTS} elements, contacts spread by 30 %, a tare of 64"
        " frames; 100 us per row; every seventh drive comes next; the prebuilt model."
    )
    tables = (_table("rows", found), _table("beyond", more, 8))
    data = {"rows": found, "beyond": more}
    return ExperimentOutcome(tables, data, {}, {"sets": words, "unfounded": _unfounded(found)})


# ---- scenes ----


def _ramp(
    from_s: float, rise_s: float, to_s: float, begin: FloatArray, end: FloatArray
) -> Keyframes:
    """A touch that is whole ``rise_s`` after ``from_s`` and lifts from ``to_s`` on as slowly."""
    keys = [(from_s, *begin, 0.0), (from_s + rise_s, *begin, 1.0)][rise_s == 0 :]
    ends = [(to_s, *end, 1.0), (to_s + rise_s, *end, 0.0)]
    return [*keys, *ends[: 1 if rise_s == 0 else 2]]


def _begin(player: Player, rng: np.random.Generator) -> float:
    rows = player.model.protocol.n_rows
    return BEFORE_S + ROW_S * rows * float(rng.uniform())


def _played(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    lasts_s: float,
    touches: Sequence[tuple[Keyframes, TrueInTime]],
) -> Outcome:
    scan = Scan.of(player.fast, lasts_s)
    volts = states.volts(k, [path for path, _ in touches], scan.frames)
    return player.play(
        scan, volts + sigma * rng.standard_normal(len(volts)), [true for _, true in touches]
    )


def _press(
    player: Player, states: States, k: int, rng: np.random.Generator, sigma: float, *, rise_s: float
) -> Outcome:
    from_s, place = _begin(player, rng), states.places[k][0]
    to_s = from_s + rise_s + HELD_S
    path = _ramp(from_s, rise_s, to_s, place, place)
    truth = TrueInTime(from_s, to_s + rise_s, lambda _: place)
    lasts_s = to_s + rise_s + AFTER_S
    return _played(player, states, k, rng, sigma, lasts_s, [(path, truth)])


def _pair(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    rise_s: float = 0.0,
    later_s: float = 0.0,
) -> Outcome:
    from_s = _begin(player, rng)
    to_s = from_s + rise_s + later_s + HELD_S
    here, there = states.places[k]
    touches = [
        (
            _ramp(from_s + late_s, rise_s, to_s, place, place),
            TrueInTime(from_s + late_s, to_s + rise_s, partial(_stays, place)),
        )
        for place, late_s in ((here, 0.0), (there, later_s))
    ]
    return _played(player, states, k, rng, sigma, to_s + rise_s + AFTER_S, touches)


def _stays(place: FloatArray, _: float) -> FloatArray:
    return place


def _swipe(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    speed_mm_per_s: float,
) -> Outcome:
    here, there = states.places[k]
    moves_s = float(np.hypot(*(there - here))) / speed_mm_per_s
    from_s = _begin(player, rng)
    times_s = from_s + np.array([0.0, SWIPE_HELD_S, SWIPE_HELD_S + moves_s])
    to_s = float(times_s[-1]) + SWIPE_HELD_S
    path = [
        (float(t), *at, 1.0)
        for t, at in zip((*times_s, to_s), (here, here, there, there), strict=True)
    ]

    def place(time_s: float) -> FloatArray:
        return np.asarray(
            here + np.clip((time_s - times_s[1]) / moves_s, 0.0, 1.0) * (there - here)
        )

    truth = TrueInTime(from_s, to_s, place)
    return _played(player, states, k, rng, sigma, to_s + AFTER_S, [(path, truth)])


Spoil = Callable[[FloatArray, Player, Scan, float, np.random.Generator], FloatArray]


def _fault(
    player: Player,
    states: States,
    k: int,
    rng: np.random.Generator,
    sigma: float,
    *,
    spoil: Spoil,
    press: bool = True,
) -> Outcome:
    scan, paths, truth = Scan.of(player.fast, FAULTED_END_S), [], []
    if press:
        place, up_s = states.places[k][0], FAULTED_PRESS_S + 0.03
        paths = [[(FAULTED_PRESS_S, *place, 0.0), (up_s, *place, 1.0), (np.inf, *place, 1.0)]]
        truth = [TrueInTime(FAULTED_PRESS_S, np.inf, lambda _: place)]
    volts = spoil(states.volts(k, paths, scan.frames), player, scan, sigma, rng)
    return player.play(scan, volts + sigma * rng.standard_normal(len(volts)), truth)


def _nothing(volts: FloatArray, *_: Any) -> FloatArray:
    return volts


def _glitches(
    volts: FloatArray, _: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> FloatArray:
    """One row of two frames."""
    late = np.flatnonzero(scan.time_s > FAULT_S)
    hit = rng.choice(late, len(volts) // 400, replace=False)
    spoiled = volts.copy()
    spoiled[hit] += float(np.abs(volts).max()) * rng.standard_normal(len(hit))
    return spoiled


def _with(player: Player, scan: Scan, rng: np.random.Generator) -> BoolArray:
    """Return which rows (t, 2) drive, and measure, with an electrode that fails."""
    table = player.model.protocol.drive_measure[scan.row] == rng.integers(
        player.model.protocol.n_electrodes
    )
    late = scan.time_s[:, None] > FAULT_S
    return np.asarray(table.reshape(-1, 2, 2).any(axis=2) & late)


def _open(
    volts: FloatArray, player: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> FloatArray:
    """Open an electrode: no current flows through it, and it floats where it is measured."""
    drives, measures = _with(player, scan, rng).T
    floating = 0.3 * float(rng.uniform(-1, 1)) * float(np.abs(volts).max())
    return np.where(drives, 0.0, np.where(measures, floating, volts))


def _noisy(
    volts: FloatArray, player: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> FloatArray:
    """Thirty times the noise."""
    spoiled = _with(player, scan, rng)[:, 1]
    return np.asarray(volts + 30 * sigma * spoiled * rng.standard_normal(len(volts)))


def _drift(
    volts: FloatArray, _: Player, scan: Scan, sigma: float, rng: np.random.Generator
) -> FloatArray:
    return np.asarray(volts * (1 + 0.005 * np.clip((scan.time_s - FAULT_S) / 0.1, 0, 1)))


# ---- what came of it ----


def _summary(outcomes: list[Outcome], fault: tuple[str, ...]) -> dict[str, Any]:
    first = np.array([one for each in outcomes for one in each.first if one]).reshape(-1, 2)
    fingers = sum(len(each.first) for each in outcomes)
    steady = [float(np.median(one)) for each in outcomes for one in each.errors if one]
    frames: Counter[str] = sum((each.frames for each in outcomes), Counter())
    named_s = [[each.named[name] for name in fault if name in each.named] for each in outcomes]
    after_ms = [1e3 * (min(each) - FAULT_S) for each in named_s if each]
    return {
        "scenes": len(outcomes),
        "drives": sum(len(each.reported) for each in outcomes),
        "with_false": sum(each.false > 0 for each in outcomes),
        "false_drives": sum(each.false for each in outcomes),
        "fingers": fingers,
        "missed": fingers - len(first),
        "first_ms": [1e3 * each for each in _quantiles(first[:, 0])],
        "first_mm": _quantiles(first[:, 1]),
        "steady_mm": _quantiles(steady),
        "frames": dict(frames),
        "fault": bool(fault),
        "fault_ms": _quantiles(after_ms),
        "fault_named": len(after_ms),
    }


def _unfounded(found: list[dict[str, Any]]) -> str:
    """Count the frames without a fault that have a diagnostic, and the drives with one that have a
    false touch."""
    spoiled = [one for one in found if one["fault"]]
    drives, false = (sum(one[key] for one in spoiled) for key in ("drives", "false_drives"))
    quiet = [one for one in found if not one["fault"] and one["fingers"] <= one["scenes"]]
    counts: Counter[bool] = Counter()
    named: Counter[bool] = Counter()
    for one in quiet:
        noisy = one["name"].endswith("40 dB")
        counts[noisy] += one["frames"]["frames"]
        named[noisy] += one["frames"].get("named", 0)
    shares = [
        f"{named[noisy]} of {counts[noisy]:,} ({100 * named[noisy] / max(1, counts[noisy]):.2f} %)"
        for noisy in (False, True)
    ]
    return (
        "Untouched skins, presses and swipes have no fault; at 60 dB a diagnostic is reported in"
        f" {shares[0]} of their frames, at 40 dB in {shares[1]}. In the scenes with a fault,"
        f" {false} of {drives:,} drives have a false touch."
    )


def _quantiles(values: npt.ArrayLike) -> list[float]:
    """Median and 95 % quantile."""
    given = np.asarray(values, dtype=np.float64)
    return [float(np.quantile(given, q)) for q in (0.5, 0.95)] if given.size else []


def _two(values: Iterable[float], digits: int) -> str:
    return ", ".join(f"{each:.{digits}f}" for each in values) or "-"


def _table(name: str, found: list[dict[str, Any]], columns: int = 11) -> Table:
    """The first ``columns`` of all."""
    lines = []
    for one in found:
        false, frames = share(one["with_false"], one["scenes"]), one["frames"]
        count = max(1, frames["frames"])
        lines.append(
            (
                one["name"], str(one["scenes"]),
                f"{100 * false.mean:.1f} % ({100 * false.low:.1f} to {100 * false.high:.1f})",
                f"{one['missed']} of {one['fingers']}", _two(one["first_ms"], 1),
                _two(one["first_mm"], 2), _two(one["steady_mm"], 2),
                f"{100 * frames.get('explained', 0) / count:.0f} %",
                f"{100 * frames.get('same', 0) / count:.1f} %",
                f"{100 * frames.get('named', 0) / count:.2f} %",
                f"{one['fault_named']} of {one['scenes']}; {_two(one['fault_ms'], 0)}"
                if one["fault"] else "-",
            )
        )  # fmt: skip
    head = ("scene", "scenes", "with any false touch (95 %)", "fingers missed",
            "first report, ms after contact: median, p95", "error then, mm", "error later, mm",
            "frames explained", "of the same bits", "with a diagnostic",
            "fault named, ms after: median, p95")  # fmt: skip
    return Table(name, head[:columns], tuple(line[:columns] for line in lines))
