"""Scans in time: each row at its own instant, given to the fast path drive by drive."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from eitskin.arrays import FloatArray, IntArray
from eitskin.core.engine import CoreEngine
from eitskin.core.fast import AlignedFrame, FastCore, FastTouch
from eitskin.core.results import Info, Reconstruction
from eitskin.model.model import Model
from eitskin.scoring.matching import GATE_MM

ROW_S = 1e-4
TARE_FRAMES = 64
STEP = 7  # drives follow by 7: neighbours in time are far apart on the skin
GRACE_S = 0.03  # a touch that has lifted may be reported so long


@dataclass(frozen=True, eq=False)
class Scan:
    """Rows ``row`` (t,) of the protocol at ``time_s`` (t,), drive after drive."""

    row: IntArray
    time_s: FloatArray
    frames: int

    @classmethod
    def of(cls, fast: FastCore, lasts_s: float, drives: Sequence[int] = ()) -> "Scan":
        """Whole frames for at least ``lasts_s``, of ``drives`` or all."""
        once = np.concatenate([fast.rows[d] for d in drives or order(fast)])
        frames = int(np.ceil(lasts_s / (ROW_S * len(once))))
        return cls(np.tile(once, frames), np.asarray(ROW_S * np.arange(frames * len(once))), frames)


def order(fast: FastCore) -> list[int]:
    """Drives of a frame in time."""
    count = len(fast.rows)
    return [STEP * k % count for k in range(count)] if count % STEP else list(range(count))


@dataclass(frozen=True)
class TrueInTime:
    """A finger from ``from_s`` to ``to_s``, and its place."""

    from_s: float
    to_s: float
    place: Callable[[float], FloatArray]


@dataclass(eq=False)
class Outcome:
    """The reports of one scene: false touches, of each finger the delay of its first report
    and the error then (or None), errors by finger, frames counted, and how many were reported after
    each drive; when a diagnostic was first reported."""

    false: int = 0
    first: list[tuple[float, float] | None] = field(default_factory=list)
    errors: list[list[float]] = field(default_factory=list)
    frames: Counter[str] = field(default_factory=Counter)
    reported: list[tuple[float, int]] = field(default_factory=list)
    named: dict[str, float] = field(default_factory=dict)


class Player:
    """Plays scans through the C core's fast path, the whole-frame solver beside it, both of
    ``width``."""

    def __init__(self, model: Model, blob: bytes, width: str = "float32") -> None:
        self.model, self.engine = model, CoreEngine(blob, width)
        self.fast = FastCore(self.engine)
        self.drives = order(self.fast)

    def tare(self, v0: FloatArray, sigma: float, rng: np.random.Generator) -> None:
        """Take the reference from noisy frames of ``v0`` (m,) V."""
        self.engine.set_reference(v0 + sigma * rng.standard_normal((TARE_FRAMES, len(v0))))
        self.engine.forget()
        self.fast.begin()

    def drive(self, number: int, volts: FloatArray, time_s: float) -> list[FastTouch]:
        """A drive of a scan."""
        return self.fast.drive(number, volts, time_s)

    def aligned(self, frame: FloatArray) -> AlignedFrame:
        """The scan at one instant."""
        return self.fast.aligned(frame)

    def named(self, found: Info) -> Info:
        """Return the solver's diagnostics that are reported."""
        return self.fast.named(found)

    def confirm(self, found: Reconstruction) -> list[FastTouch]:
        """Give the solver's touches back to the tracks, and return the touches."""
        return self.fast.confirm(found.touches)

    def play(self, scan: Scan, volts: FloatArray, truth: Sequence[TrueInTime]) -> Outcome:
        """``volts`` (t,) as ``scan`` measured them."""
        out = Outcome(first=[None] * len(truth), errors=[[] for _ in truth])
        frame, at, drives = np.full(self.model.protocol.n_rows, np.nan), 0, self.drives
        while at < len(volts):
            for number in drives:
                rows = self.fast.rows[number]
                mine = slice(at, at + len(rows))
                at += len(rows)
                end_s = float(scan.time_s[mine][-1]) + ROW_S
                middle_s = (float(scan.time_s[mine][0]) + end_s) / 2
                frame[rows] = volts[mine]
                reported = self.drive(number, volts[mine], middle_s)
                if number == drives[-1]:
                    reported = self._whole_frame(frame, out, end_s)
                _score(out, truth, reported, middle_s, end_s)
        return out

    def _whole_frame(self, frame: FloatArray, out: Outcome, end_s: float) -> list[FastTouch]:
        aligned = self.aligned(frame)
        out.frames["frames"] += 1
        out.frames["explained"] += aligned.explained
        out.frames["same"] += np.array_equal(
            aligned.volts, frame.astype(aligned.volts.dtype), equal_nan=True
        )
        if not aligned.trusted:
            return self.fast.touches()
        found = self.engine.reconstruct(aligned.volts)
        names = self.named(found.info).diagnostics_by_name
        out.frames["named"] += bool(names)
        for name in names:
            out.named.setdefault(name, end_s)
        return self.confirm(found)


def _score(
    out: Outcome,
    truth: Sequence[TrueInTime],
    reported: Sequence[FastTouch],
    reported_s: float,
    end_s: float,
) -> None:
    out.reported.append((reported_s, len(reported)))
    free = [k for k, one in enumerate(truth) if one.from_s <= end_s <= one.to_s + GRACE_S]
    for touch in reported:
        away = {
            k: float(np.hypot(*(truth[k].place(reported_s) - (touch.x_mm, touch.y_mm))))
            for k in free
        }
        k = min(away, key=lambda each: away[each], default=-1)
        if k < 0 or away[k] > GATE_MM:
            out.false += 1
            continue
        free.remove(k)
        out.errors[k].append(away[k])
        out.first[k] = out.first[k] or (end_s - truth[k].from_s, away[k])
