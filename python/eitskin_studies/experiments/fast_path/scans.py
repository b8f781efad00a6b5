"""Scans in time: each row at its own instant, given to the fast path drive by drive."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from eitskin.core.results import LearnedReference
from eitskin.model.model import Model
from eitskin.reference.row_gains import row_gains
from eitskin.scoring.matching import GATE_MM
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.twins.fast.path import FastPath, FastTouch

FloatArray = npt.NDArray[np.float64]

ROW_S = 1e-4
TARE_FRAMES = 64
STEP = 7  # drives follow by 7: neighbours in time are far apart on the skin
GRACE_S = 0.03  # a touch that has lifted may be told so long


@dataclass(frozen=True, eq=False)
class Scan:
    """Rows ``row`` (t,) of the protocol at ``time_s`` (t,), drive after drive."""

    row: npt.NDArray[np.int64]
    time_s: FloatArray
    frames: int

    @classmethod
    def of(cls, path: FastPath, lasts_s: float) -> Scan:
        """Whole frames for at least ``lasts_s``."""
        once = np.concatenate([path.drives[d].rows for d in order(path)])
        frames = int(np.ceil(lasts_s / (ROW_S * len(once))))
        return cls(np.tile(once, frames), np.asarray(ROW_S * np.arange(frames * len(once))), frames)


def order(path: FastPath) -> list[int]:
    """Drives of a frame in time."""
    count = len(path.drives)
    return [STEP * k % count for k in range(count)] if count % STEP else list(range(count))


@dataclass(frozen=True)
class TrueInTime:
    """A finger from ``from_s`` to ``to_s``, and where it is."""

    from_s: float
    to_s: float
    place: Callable[[float], FloatArray]


@dataclass(eq=False)
class Outcome:
    """What was told of one scene: false touches, of each finger the delay of its first report and
    the error then (or None), errors by finger, frames counted, and how many were told of after each
    drive."""

    false: int = 0
    first: list[tuple[float, float] | None] = field(default_factory=list)
    errors: list[list[float]] = field(default_factory=list)
    frames: Counter[str] = field(default_factory=Counter)
    told: list[tuple[float, int]] = field(default_factory=list)


class Player:
    """Plays scans through the fast path with the whole-frame core beside it."""

    def __init__(self, model: Model, blob: bytes, *, whole: bool = True) -> None:
        self.model, self.whole = model, whole
        self.path = FastPath(model)
        self.core = Reconstructor(model, engine="c", blob=blob)

    def tare(self, v0: FloatArray, sigma: float, rng: np.random.Generator) -> None:
        """Take the reference from noisy frames of ``v0`` (m,) V."""
        quiet = v0 + sigma * rng.standard_normal((TARE_FRAMES, len(v0)))
        learned: LearnedReference = self.core.tare(quiet)
        self.core.forget()
        mean, usable = quiet.mean(axis=0), np.ones(len(v0), dtype=np.bool_)
        gains = row_gains(self.model, usable, learned.gain * mean)[0]
        self.path.tare(mean, learned.noise_v, learned.gain * gains)

    def play(self, scan: Scan, volts: FloatArray, truth: Sequence[TrueInTime]) -> Outcome:
        """``volts`` (t,) as ``scan`` measured them."""
        out = Outcome(first=[None] * len(truth), errors=[[] for _ in truth])
        frame, at = np.full(len(self.path.model.protocol.drive_measure), np.nan), 0
        drives = order(self.path)
        while at < len(volts):
            for number in drives:
                rows = self.path.drives[number].rows
                mine = slice(at, at + len(rows))
                at += len(rows)
                end_s = float(scan.time_s[mine][-1]) + ROW_S
                middle_s = (float(scan.time_s[mine][0]) + end_s) / 2
                frame[rows] = volts[mine]
                told = self.path.drive(number, volts[mine], middle_s)
                if number == drives[-1] and self.whole:
                    told = self._whole_frame(frame, out.frames)
                _score(out, truth, told, middle_s, end_s)
        return out

    def _whole_frame(self, frame: FloatArray, count: Counter[str]) -> list[FastTouch]:
        aligned = self.path.aligned(frame)
        count["frames"] += 1
        count["explained"] += aligned.explained
        count["same"] += np.array_equal(aligned.volts, frame)
        if not aligned.trusted:
            return self.path.touches()
        found = self.core.reconstruct(aligned.volts)
        info = found.info
        electrodes = (*info.open_electrodes, *info.bridged_electrodes, *info.noisy_electrodes)
        count["named"] += bool(electrodes) or "outlier" in info.diagnostics_by_name
        return self.path.confirm(found.touches, electrodes)


def _score(
    out: Outcome,
    truth: Sequence[TrueInTime],
    told: Sequence[FastTouch],
    told_s: float,
    end_s: float,
) -> None:
    out.told.append((told_s, len(told)))
    free = [k for k, one in enumerate(truth) if one.from_s <= end_s <= one.to_s + GRACE_S]
    for touch in told:
        away = {
            k: float(np.hypot(*(truth[k].place(told_s) - (touch.x_mm, touch.y_mm)))) for k in free
        }
        k = min(away, key=lambda each: away[each], default=-1)
        if k < 0 or away[k] > GATE_MM:
            out.false += 1
            continue
        free.remove(k)
        out.errors[k].append(away[k])
        out.first[k] = out.first[k] or (end_s - truth[k].from_s, away[k])
