"""Streams of a taught skin: measured presses in sequence, as a board would scan them, and the
tracker's results for their frames beside the results of each frame alone."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.results import Reconstruction
from eitskin.model.model import Model
from eitskin.model.options import default_options, tracking
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.left_out import CHI2_90
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import squared, teach
from eitskin_studies.experiments.experiment import ExperimentOutcome, Table, Workspace
from eitskin_studies.experiments.teaching import SKIN, load_measured

TITLE = "Streams of a taught skin"
COUNTS = (100, 400)  # presses that teach
JUDGED = 100
TARE = 8  # untouched frames before the session
RATE_HZ = 50.0
PERIOD_S = 7.0  # from press to press, as the robot pressed
RAMP_S, HOLD_S = 0.1, 0.5
FOUND_MM = 20.0  # a touch further from the press is false
LIFT_S = 0.06  # so long after its lift a touch may still be reported
WAYS = ("tracked", "frames alone")


@dataclass(frozen=True, eq=False)
class Scan:
    """A frame (m,) of a session, and the time since the press before it began, in s."""

    volts: FloatArray
    since_s: float


@dataclass
class Seen:
    """The reports of one press: ids in the order of frames, the delay to the first report in s,
    whether reports had a gap, the last distance in mm and its squared error in the covariance,
    the delay to its first confirmed report in s, and the numbers of frames, of those with a false
    touch, and of those with a false confirmed touch."""

    ids: list[int] = field(default_factory=list)
    delay_s: float = float("inf")
    gap: bool = False
    distance_mm: float = float("inf")
    mahalanobis2: float = float("inf")
    confirmed_s: float = float("inf")
    frames: int = 0
    false_frames: int = 0
    false_confirmed: int = 0

    @property
    def once(self) -> bool:
        """Return whether it had one id, without a gap, from its first report to its lift."""
        return bool(self.ids) and not self.gap and len(set(self.ids)) == 1


def noise_of(presses: Presses) -> FloatArray:
    """Return the standard deviation (m,) of a row's noise, from second differences of untouched
    frames: what remains of drift makes it too large rather than too small."""
    return np.asarray(np.diff(presses.untouched, 2, axis=0).std(axis=0) / np.sqrt(6.0))


def session(
    presses: Presses, k: int, noise: FloatArray, draw: np.random.Generator
) -> Iterator[Scan]:
    """Yield the scans from the contact of press ``k`` to just before that of the next one.

    Each row has the share of the press at its own time: the press grows and fades linearly. The
    untouched frame goes over to the next one by the time."""
    rows = presses.protocol.n_rows
    part = np.arange(rows) / rows
    after = presses.untouched[min(k + 1, len(presses) - 1)]
    for n in range(round(PERIOD_S * RATE_HZ)):
        t = (n + part) / RATE_HZ
        share = np.clip(np.minimum(t / RAMP_S, (2 * RAMP_S + HOLD_S - t) / RAMP_S), 0.0, 1.0)
        base = presses.untouched[k] + (after - presses.untouched[k]) * t / PERIOD_S
        volts = base + share * presses.difference[k] + noise * draw.normal(size=rows)
        yield Scan(volts, (n + 1) / RATE_HZ)


def watch(model: Model, presses: Presses, tracked: bool) -> list[Seen]:
    """Stream the last ``JUDGED`` presses after a tare; return what was seen of each."""
    first = len(presses) - JUDGED
    noise = noise_of(presses.take(np.arange(first)))
    draw = np.random.default_rng(7)
    core = Reconstructor(model)
    core.set_options(tracking(default_options(model)) if tracked else default_options(model))
    tare = presses.untouched[first - TARE : first]
    core.tare(tare + noise * draw.normal(size=tare.shape))
    step = core.follow if tracked else core.reconstruct
    return [
        _see(step, session(presses, k, noise, draw), presses.place_mm[k])
        for k in range(first, len(presses))
    ]


def _see(
    step: Callable[[FloatArray], Reconstruction], scans: Iterator[Scan], place_mm: FloatArray
) -> Seen:
    seen, lift_s = Seen(), 2 * RAMP_S + HOLD_S
    for scan in scans:
        touches, seen.frames = step(scan.volts).touches, seen.frames + 1
        near = [one for one in touches if _away(one, place_mm) <= FOUND_MM]
        true = near[:1] if scan.since_s <= lift_s + LIFT_S else []
        false = [one for one in touches if one not in true]
        seen.false_frames += bool(false)
        seen.false_confirmed += any(one.confirmed for one in false)
        if scan.since_s > lift_s - RAMP_S:
            continue
        if not near:
            seen.gap |= bool(seen.ids)
            continue
        one = min(near, key=lambda touch: _away(touch, place_mm))
        seen.delay_s = min(seen.delay_s, scan.since_s)
        seen.ids.append(one.id)
        if one.confirmed:
            seen.confirmed_s = min(seen.confirmed_s, scan.since_s)
        seen.distance_mm = _away(one, place_mm)
        seen.mahalanobis2 = squared(np.array([one.x_mm, one.y_mm]) - place_mm, one)
    return seen


def _away(touch: Touch, place_mm: FloatArray) -> float:
    return float(np.hypot(touch.x_mm - place_mm[0], touch.y_mm - place_mm[1]))


def facts(seen: list[Seen]) -> dict[str, float]:
    """The numbers of the table."""
    found = [one for one in seen if one.ids]
    distance = np.array([one.distance_mm for one in found] or [np.nan])
    delay = np.array([one.delay_s for one in found] or [np.nan])
    confirmed = np.array([one.confirmed_s for one in found] or [np.nan])
    return {
        "presses": len(seen),
        "found": len(found),
        "once": sum(one.once for one in seen),
        "with_false": sum(one.false_frames > 0 for one in seen),
        "false_frames": sum(one.false_frames for one in seen),
        "frames": sum(one.frames for one in seen),
        "median_mm": float(np.median(distance)),
        "p95_mm": float(np.quantile(distance, 0.95)),
        "delay_ms": 1e3 * float(np.median(delay)),
        "delay_p95_ms": 1e3 * float(np.quantile(delay, 0.95)),
        "confirmed_ms": 1e3 * float(np.median(confirmed)),
        "with_false_confirmed": sum(one.false_confirmed > 0 for one in seen),
        "false_confirmed": sum(one.false_confirmed for one in seen),
        "covered": sum(one.mahalanobis2 < CHI2_90 for one in found) / max(len(found), 1),
    }


def run(workspace: Workspace) -> ExperimentOutcome:
    """Teach by the first presses, stream the last ones.

    Raises:
        UsageError: the presses are not there.
    """
    presses = load_measured(workspace, "taught-sessions")
    found: dict[str, dict[str, float]] = {}
    for count in workspace.progress(COUNTS, "presses"):
        taught = _Taught(presses, count)
        for way in WAYS:
            found[f"{count} presses, {way}"] = workspace.kept(
                {"study": "taught-sessions", "count": count, "way": way},
                partial(taught.streamed, way),
            )
    return ExperimentOutcome((_table(found),), found, words={"conditions": _conditions()})


@dataclass(eq=False)
class _Taught:
    """The model that the first presses teach, made when it is first needed."""

    presses: Presses
    count: int

    @cached_property
    def model(self) -> Model:
        return teach(self.presses.take(np.arange(self.count)), SKIN).model

    def streamed(self, way: str) -> dict[str, float]:
        """Return the facts of one way."""
        return facts(watch(self.model, self.presses, way == WAYS[0]))


def _conditions() -> str:
    return (
        f"The first 100 or 400 of the 500 presses teach; the last {JUDGED} are streamed one after"
        f" another, in order of time, {PERIOD_S:g} s from press to press, at {RATE_HZ:g} frames per"
        f" second, after one tare of {TARE} frames. Each press grows within {1e3 * RAMP_S:g} ms,"
        f" stays for {1e3 * HOLD_S:g} ms and fades within {1e3 * RAMP_S:g} ms; each row has the"
        " share of the press at its own time, and the untouched frame goes over to the next one"
        " linearly. The rows' noise is that of second differences of untouched frames, seed 7. A"
        f" touch further than {FOUND_MM:g} mm from the press is false, and so is a second one, or"
        f" one later than {1e3 * LIFT_S:g} ms after the lift. The reference follows"
        " (`reference_frames` 512). *Frames alone* is each frame reconstructed by itself."
    )


def _table(found: dict[str, dict[str, float]]) -> Table:
    rows: list[tuple[str, Callable[[dict[str, float]], str]]] = [
        ("presses found", lambda f: f"{f['found']:.0f} of {f['presses']:.0f}"),
        ("one touch with one id from the first report to the lift",
         lambda f: f"{f['once']:.0f} of {f['presses']:.0f}"),
        ("presses with a false touch", lambda f: f"{f['with_false']:.0f} of {f['presses']:.0f}"),
        ("frames with a false touch", lambda f: f"{f['false_frames']:.0f} of {f['frames']:.0f}"),
        ("presses with a false confirmed touch",
         lambda f: f"{f['with_false_confirmed']:.0f} of {f['presses']:.0f}"),
        ("distance at the end of the hold, mm, median / p95",
         lambda f: f"{f['median_mm']:.1f} / {f['p95_mm']:.1f}"),
        ("90 % ellipses cover", lambda f: f"{f['covered']:.2f}"),
        ("first report after contact, ms, median / p95",
         lambda f: f"{f['delay_ms']:.0f} / {f['delay_p95_ms']:.0f}"),
        ("confirmed after contact, ms, median", lambda f: f"{f['confirmed_ms']:.0f}"),
    ]  # fmt: skip
    body = tuple((text, *(say(one) for one in found.values())) for text, say in rows)
    return Table("sessions", ("what", *found), body)
