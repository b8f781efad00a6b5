"""What is found wrong with a frame, in numpy: the rules of
csrc/src/diagnostics/{electrodes,outliers,model_mismatch,crowded}.c, written for reading.

docs/reference/diagnostics.md says what each rule is for and what its thresholds were chosen on.
"""

from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.diagnostics_table import DIAGNOSTICS, Touch
from eitskin.core.results import Options
from eitskin.model.model import Model
from eitskin.model.row_form import RowForm
from eitskin_reference.constants_table import (
    CROWD_CLEAR,
    CROWD_CLEAREST,
    CROWD_FAINT,
    CROWD_FAR,
    CROWD_LEFT,
    CROWD_MIN,
    CROWD_NEAREST,
    CROWD_OFFSET,
    CROWD_STRONG,
    CROWD_TOUCHES,
    CROWD_WEAKEST,
    CROWD_WIDEST,
    MISMATCH_FRACTION,
    MISMATCH_NOISE,
    NOISY_FRACTION,
    OUTLIER_ENERGY,
    OUTLIER_FRACTION,
    OUTLIER_LARGEST,
    OUTLIER_MAX,
    OUTLIER_NEARER,
    OUTLIER_NOISE,
    OUTLIER_PIVOT,
    OUTLIER_RIDGE,
    OUTLIER_ROBUST,
    OUTLIER_UNPAIRED,
    ROBUST,
    ROW_DEAD_FRACTION,
    ROW_DEAD_NOISE,
    ROW_GROWN,
    ROW_SIGNIFICANT,
    ROW_SIGNIFICANT_NOISE,
    ROW_SMALL,
    ROWS_TO_JUDGE,
    STALE_NOISE,
    STALE_RATIO,
)

CROWD_WEIGHTS = (
    CROWD_TOUCHES,
    CROWD_NEAREST,
    CROWD_WIDEST,
    CROWD_LEFT,
    CROWD_WEAKEST,
    CROWD_CLEAREST,
)


def robust(values: FloatArray) -> float:
    """The deviation that the upper median of ``values``, all >= 0, suggests."""
    return ROBUST * float(np.sort(values)[len(values) // 2]) if len(values) else 0.0


PRIVATE = ("names", "no_signal")  # fields of Found that Info has not


@dataclass
class FrameDiagnostics:
    """What a frame's examination has found so far."""

    names: set[str] = field(default_factory=set)
    saturated: int = 0
    outliers: int = 0
    no_signal: bool = False  # on any electrode: it is the front end
    model_mismatch: float = 0.0
    unexplained: float = 0.0
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()
    noisy_electrodes: tuple[int, ...] = ()

    @property
    def diagnostics(self) -> int:
        """As eits_info.diagnostics."""
        return sum(1 << bit for bit, name in enumerate(DIAGNOSTICS) if name in self.names)


class Sheet(NamedTuple):
    """P's rows where they are orthogonal: 1 / |P_i|^2, and so much of it as predicts d from P d."""

    inverse: FloatArray
    shrink: FloatArray

    @classmethod
    def of(cls, rows: RowForm | None) -> "Sheet | None":
        """None where the model does not say."""
        if rows is None:
            return None
        energy, squared = rows.energy.astype(np.float64), rows.square.astype(np.float64)
        return cls(1 / energy, squared / (squared + OUTLIER_RIDGE * squared.max()) / energy)


@dataclass
class Folded:
    """Folded data of a frame: ``d`` (k,), what the sides differ by (0 where one is in use), and
    which are in use."""

    d: FloatArray
    apart: FloatArray
    first: BoolArray
    second: BoolArray

    @property
    def both(self) -> BoolArray:
        """Folds with both sides in use."""
        return np.asarray(self.first & self.second)

    @property
    def whole(self) -> bool:
        """No fold is left out."""
        return bool((self.first | self.second).all())


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference that a frame is judged by: v0 (m,) with NaN where there is none, its rms, the
    gain, the rows' own gains (m,), and the noise (0: unknown)."""

    v0: FloatArray
    rms_v: float
    gain: float
    row_gain: FloatArray
    noise_v: float


class Examiner:
    """Examines the frames of one model. ``wanted`` holds the names of what is looked for."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.rows = model.protocol.drive_measure.astype(np.int64)
        self._p = model.projection.astype(np.float64)
        self.wanted: set[str] = set(DIAGNOSTICS)
        self.found = FrameDiagnostics()

    @cached_property
    def sheet(self) -> Sheet | None:
        """What is known of P."""
        return Sheet.of(self.model.row_form)

    # ---- rows and electrodes ----

    def electrodes(
        self, frame: FloatArray, ref: Reference, masked: BoolArray, unusable: BoolArray
    ) -> BoolArray:
        """Rows (m,) to leave out because of open electrodes, bridged pairs or impossible values.
        ``masked``: without reference; ``unusable``: those, and rows that cannot be used by
        themselves."""
        noise = ROW_DEAD_NOISE * ref.noise_v
        size = np.where(masked, 0.0, np.abs(np.nan_to_num(ref.v0)))
        along = np.where(
            unusable, 0.0, np.nan_to_num(frame) * np.where(np.nan_to_num(ref.v0) < 0, -1.0, 1.0)
        )
        limit = np.maximum(ROW_DEAD_FRACTION * size, noise)
        judged = (size >= max(ROW_SIGNIFICANT * ref.rms_v, ROW_SIGNIFICANT_NOISE * noise)) & ~masked
        dead = judged & (unusable | (np.abs(along) < limit))
        turned = judged & ~dead & (along < 0)
        alive = judged & ~dead
        grown = ~unusable & (
            np.abs(along) > ROW_GROWN * np.maximum(size, ROW_SMALL * ref.rms_v) + noise
        )
        out = np.zeros(len(frame), dtype=np.bool_)
        if turned.sum() >= ROWS_TO_JUDGE and "model mismatch" in self.wanted:
            self.found.names.add("model mismatch")
        impossible = turned | grown
        if 0 < turned.sum() + grown.sum() < ROWS_TO_JUDGE and "outlier" in self.wanted:
            out |= impossible
            self.found.outliers += int(impossible.sum())
            self.found.names.add("outlier")
            alive = alive & ~impossible
        if dead.sum() < ROWS_TO_JUDGE:
            return out
        silent, judged_electrodes = self._silent(judged, alive, dead & ~unusable)
        if silent.sum() == judged_electrodes:  # it is not the electrodes
            self.found.no_signal = int((dead & ~unusable).sum()) >= ROWS_TO_JUDGE
            return out
        dead = judged & ~alive
        self.found.open_electrodes = (
            tuple(int(e) for e in np.flatnonzero(silent)) if "electrode open" in self.wanted else ()
        )
        self.found.bridged_electrodes = self._bridged(dead, alive)
        silent_ones, bridged = self.found.open_electrodes, self.found.bridged_electrodes
        self.found.names |= {
            name
            for name, which in (("electrode open", silent_ones), ("electrodes bridged", bridged))
            if which
        }
        return out | self._using(silent_ones + bridged)

    def _using(self, electrodes: tuple[int, ...]) -> BoolArray:
        return np.asarray(np.isin(self.rows, electrodes).any(axis=1))

    def _silent(
        self, judged: BoolArray, alive: BoolArray, silent: BoolArray
    ) -> tuple[BoolArray, int]:
        """Electrodes (n,) without an alive row though enough tell, or all of whose drives, with
        several partners, are ``silent``; and of how many enough tell."""
        count = self.model.protocol.n_electrodes
        uses = np.array([(self.rows == e).any(axis=1) for e in range(count)])
        enough = (uses & judged).sum(axis=1) >= ROWS_TO_JUDGE
        found = enough & ~(uses & alive).any(axis=1)
        for e in range(count):
            driven = judged & (self.rows[:, :2] == e).any(axis=1)
            several = len(np.unique(self.rows[driven, :2])) > 2
            found[e] |= several and driven.sum() >= ROWS_TO_JUDGE and bool(silent[driven].all())
        return found, int(enough.sum())

    def _bridged(self, dead: BoolArray, alive: BoolArray) -> tuple[int, ...]:
        if "electrodes bridged" not in self.wanted:
            return ()
        without_open, found = ~self._using(self.found.open_electrodes), set[int]()
        pairs = {
            frozenset(map(int, pair))
            for row in self.rows[dead & without_open]
            for pair in (row[:2], row[2:])
        }
        for pair in pairs:
            across = (
                np.array(
                    [set(row[:2]) == pair or set(row[2:]) == pair for row in self.rows.tolist()]
                )
                & without_open
            )
            lives = all((self._using((e,)) & alive).any() for e in pair)
            if lives and not (across & alive).any() and (across & dead).sum() >= ROWS_TO_JUDGE:
                found |= pair
        return tuple(sorted(found))

    # ---- reciprocals ----

    def flagged(self, folded: Folded, ref: Reference) -> npt.NDArray[np.intp]:
        """Folds whose sides differ by more than noise and gains explain."""
        fold, off = self.model.fold, np.abs(folded.apart)
        if ref.noise_v > 0 and self.model.data_kind == "normalised":
            with np.errstate(divide="ignore", invalid="ignore"):
                most = (
                    OUTLIER_NOISE
                    * ref.noise_v
                    * np.hypot(1 / ref.v0[fold.first], 1 / ref.v0[fold.second])
                )
        elif ref.noise_v > 0:
            own = abs(ref.gain) * ref.row_gain[fold.first]
            most = OUTLIER_NOISE * np.sqrt(2) * own * ref.noise_v
        else:
            spread = robust(off[folded.both])
            most = np.full(len(off), OUTLIER_ROBUST * spread if spread > 0 else np.inf)
        large = off > OUTLIER_LARGEST * np.abs(folded.d).max(initial=0.0)
        return np.flatnonzero(
            folded.both
            & (off > most)
            & large
            & (off > OUTLIER_FRACTION * (np.abs(folded.d) + off / 2))
        )

    def outliers(self, folded: Folded, ref: Reference) -> BoolArray:
        """Rows (m,) to leave out as outliers, or because of noisy electrodes."""
        out, fold = np.zeros(self.model.protocol.n_rows, dtype=np.bool_), self.model.fold
        flagged = self.flagged(folded, ref)
        if len(flagged) > OUTLIER_MAX:
            return self._noisy(flagged)
        if not len(flagged) or "outlier" not in self.wanted:
            return out
        half = folded.apart[flagged] / 2
        predicted = self._predict(folded, flagged)
        if predicted is None:
            first = second = np.ones(len(flagged))
        else:
            first, second = (
                np.abs(folded.d[flagged] + side * half - predicted) for side in (1, -1)
            )
        out[fold.first[flagged[~(first <= OUTLIER_NEARER * second)]]] = True
        out[fold.second[flagged[~(second <= OUTLIER_NEARER * first)]]] = True
        self.found.outliers += int(out.sum())
        self.found.names.add("outlier")
        return out

    def _predict(self, folded: Folded, flagged: npt.NDArray[np.intp]) -> FloatArray | None:
        """What the other folds predict for the flagged ones; None where they do not."""
        if self.sheet is None or not folded.whole:
            return None
        p = self._p[:, flagged]
        off = folded.d[flagged] - p.T @ (self.sheet.shrink * (self._p @ folded.d))
        left = np.eye(len(flagged)) - p.T @ (self.sheet.shrink[:, None] * p)
        try:
            pivots = np.diag(np.linalg.cholesky(left)) ** 2
        except np.linalg.LinAlgError:
            return None
        return (
            None
            if pivots.min() <= OUTLIER_PIVOT
            else np.asarray(folded.d[flagged] - np.linalg.solve(left, off))
        )

    def _noisy(self, flagged: npt.NDArray[np.intp]) -> BoolArray:
        out, used = (
            np.zeros(self.model.protocol.n_rows, dtype=np.bool_),
            self.rows[self.model.fold.first[flagged]],
        )
        shared = np.array([(used == e).sum() for e in range(self.model.protocol.n_electrodes)])
        found = tuple(int(e) for e in np.flatnonzero(shared >= NOISY_FRACTION * len(flagged)))
        if not found:
            self.found.names |= {"model mismatch"} & self.wanted
            return out
        if "electrode noisy" not in self.wanted:
            return out
        self.found.noisy_electrodes = found
        self.found.names.add("electrode noisy")
        pair = set(found)
        if len(found) == 2 and all(
            set(row[:2]) == pair or set(row[2:]) == pair for row in used.tolist()
        ):
            return np.array([set(row[2:]) == pair for row in self.rows.tolist()])
        return self._using(found)

    # ---- what no sheet gives ----

    def noise_energy(self, folded: Folded, ref: Reference) -> float:
        """The variance of a fold's datum, summed over the folds in use; copied reciprocals are one
        measurement."""
        fold = self.model.fold
        row = np.where(folded.first, fold.first, fold.second)
        ratio = self.model.data_kind == "normalised"
        each = (
            ref.noise_v / ref.v0[row] if ratio else ref.gain * ref.noise_v * ref.row_gain[row]
        ) ** 2
        used = folded.first | folded.second
        return float(np.where(folded.both & (folded.apart != 0), each / 2, each)[used].sum())

    def model_mismatch(self, folded: Folded, along: FloatArray | None, ref: Reference) -> bool:
        """Whether more of d lies outside of the model's sheet than noise explains; ``along`` is the
        drift that is ignored. Sets ``found.model_mismatch``."""
        rank, folds = self._p.shape
        if self.sheet is None or not folded.whole or rank >= folds or not ref.noise_v > 0:
            return False
        inverse = self.sheet.inverse

        def outside(a: FloatArray, b: FloatArray) -> float:
            return float(a @ b - (self._p @ a) @ (inverse * (self._p @ b)))

        off, whole = outside(folded.d, folded.d), float(folded.d @ folded.d)
        if along is not None and along @ along > 0:
            whole -= float(folded.d @ along) ** 2 / float(along @ along)
            off -= (
                outside(folded.d, along) ** 2 / outside(along, along)
                if outside(along, along) > 0
                else 0.0
            )
        noise = self.noise_energy(folded, ref) * (folds - rank) / folds
        if not off > noise or not whole > 0:
            return False
        share = float(np.sqrt((off - noise) / whole))
        self.found.model_mismatch = min(share, 1.0)
        return share > MISMATCH_FRACTION and off > MISMATCH_NOISE**2 * noise

    def unpaired(self, folded: Folded) -> BoolArray:
        """Rows of the one fold that the others predict worst, where no fold has a reciprocal of its
        own."""
        out, fold = np.zeros(self.model.protocol.n_rows, dtype=np.bool_), self.model.fold
        if (
            "outlier" not in self.wanted
            or self.sheet is None
            or {"model mismatch"} & self.found.names
            or (folded.apart != 0).any()
        ):
            return out
        off = np.abs(folded.d - self._p.T @ (self.sheet.shrink * (self._p @ folded.d)))
        left = 1 - (self._p**2 * self.sheet.shrink[:, None]).sum(axis=0)
        size = np.where(left > OUTLIER_PIVOT, off / np.sqrt(np.maximum(left, OUTLIER_PIVOT)), 0.0)
        worst = int(size.argmax())
        if size[worst] ** 2 > OUTLIER_ENERGY * float(off @ off) and size[
            worst
        ] > OUTLIER_UNPAIRED * robust(size):
            out[fold.first[worst]] = True
            if fold.second[worst] >= 0:
                out[fold.second[worst]] = True
            self.found.outliers += int(out.sum())
            self.found.names.add("outlier")
        return out

    # ---- after the solve ----

    def stale(
        self, correlation: FloatArray, sign: str, lambda_max: float, lambda_noise: float
    ) -> None:
        """Whether S'y goes the way touches cannot."""
        if sign == "both" or "stale reference" not in self.wanted or not lambda_noise > 0:
            return
        against = float((-correlation if sign == "increase" else correlation).max())
        if against > STALE_RATIO * lambda_max and against > STALE_NOISE * lambda_noise:
            self.found.names.add("stale reference")

    def unlike(self, *, far: bool) -> None:
        """Whether the reference is ``far`` from the model's."""
        if far and "unlike the model" in self.wanted:
            self.found.names.add("unlike the model")

    def crowd(
        self,
        touches: tuple[Touch, ...],
        options: Options,
        clearness: float,
        *,
        doubtful: bool = False,
    ) -> None:
        """Whether there are more touches than can be separated, by the score of
        csrc/src/diagnostics/crowded.c; ``found.unexplained`` is known. ``clearness``: max(S'y) over
        that of noise; ``doubtful``: the test of touches says so."""
        count, left = len(touches), self.found.unexplained
        if doubtful and "crowded" in self.wanted:
            self.found.names.add("crowded")
        if not count or "crowded" not in self.wanted or clearness < CROWD_FAINT:
            return
        apart = [
            np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) / (a.radius_mm + b.radius_mm)
            for a, b in combinations(touches, 2)
        ]
        weakest = min(touch.explained for touch in touches)
        features = (
            count / self.model.protocol.n_electrodes,
            min([CROWD_FAR, *apart]),
            max(touch.radius_mm for touch in touches) / options.touch_seed_radius_mm,
            np.sqrt(left),
            (
                min(CROWD_STRONG, np.sqrt(weakest) * clearness)
                if np.isfinite(clearness)
                else CROWD_STRONG
            ),
            np.sqrt(weakest / left) if weakest < CROWD_CLEAR**2 * left else CROWD_CLEAR,
        )
        if (
            count >= options.max_touches
            or np.dot(CROWD_WEIGHTS, features) + CROWD_OFFSET < CROWD_MIN
        ):
            self.found.names.add("crowded")

    def of_frame(self) -> dict[str, Any]:
        """The fields of ``Info`` that say what was found."""
        f = self.found
        told = (entry.name for entry in fields(f) if entry.name not in PRIVATE)
        return {name: getattr(f, name) for name in ("diagnostics", *told)}
