"""The diagnostics of a frame, by the rules of docs/reference/diagnostics.md."""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.core import constants_table as limits
from eitskin.core.diagnostics_table import DIAGNOSTICS, Touch
from eitskin.core.results import Options
from eitskin.model.model import Model
from eitskin.oracle.folding import Folded, Reference
from eitskin.oracle.lasso import greatest
from eitskin.oracle.reference import robust
from eitskin.oracle.whitening import singular


@dataclass
class Found:
    """The diagnostics of one frame, by the names of ``Info``; only those in ``wanted`` are kept."""

    wanted: frozenset[str]
    names: set[str] = field(default_factory=set)
    saturated: int = 0
    outliers: int = 0
    model_mismatch: float = 0.0
    open_electrodes: tuple[int, ...] = ()
    bridged_electrodes: tuple[int, ...] = ()
    noisy_electrodes: tuple[int, ...] = ()
    no_signal: bool = False

    def say(self, name: str) -> bool:
        """Note the diagnostic ``name``; whether it is wanted."""
        if name in self.wanted:
            self.names.add(name)
        return name in self.wanted

    @property
    def diagnostics(self) -> int:
        """Bits, as ``Info.diagnostics``."""
        return sum(1 << bit for bit, name in enumerate(DIAGNOSTICS) if name in self.names)


# ---- electrodes ----


def electrodes(
    model: Model, frame: FloatArray, ref: Reference, unusable: BoolArray, found: Found
) -> BoolArray:
    """Rows (m,) to leave out: of open and bridged electrodes, and impossible ones."""
    table = model.protocol.drive_measure.astype(int)
    noise, v0 = limits.ROW_DEAD_NOISE * ref.noise_v, np.nan_to_num(ref.v0)
    size, along = np.abs(v0), np.where(unusable, 0.0, frame * np.where(v0 < 0, -1, 1))
    limit = np.maximum(limits.ROW_DEAD_FRACTION * size, noise)
    clear = max(limits.ROW_SIGNIFICANT * ref.rms_v, limits.ROW_SIGNIFICANT_NOISE * noise)
    judged = np.isfinite(ref.v0) & (size >= clear)
    turned = judged & ~unusable & (along <= -limit)
    alive = judged & ~unusable & (np.abs(along) >= limit)
    silent = judged & ~unusable & ~alive
    most = limits.ROW_GROWN * np.maximum(size, limits.ROW_SMALL * ref.rms_v) + noise
    grown = ~unusable & (np.abs(along) > most)
    few_dead = (judged & ~alive).sum() < limits.ROWS_TO_JUDGE
    out = np.zeros(len(frame), dtype=bool)
    if turned.sum() >= limits.ROWS_TO_JUDGE:
        found.say("model mismatch")
    if 0 < turned.sum() + grown.sum() < limits.ROWS_TO_JUDGE and found.say("outlier"):
        out = turned | grown
        alive = alive & ~out
        found.outliers += int(out.sum())
    if few_dead:
        return out
    opened, told = _open(model, table, judged, alive, silent)
    if len(opened) == told:  # all electrodes at once: it is not the electrodes
        found.no_signal = int(silent.sum()) >= limits.ROWS_TO_JUDGE
        return out
    if opened and found.say("electrode open"):
        found.open_electrodes = opened
    without = np.asarray(~np.isin(table, found.open_electrodes).any(axis=1))
    bridged = _bridged(table, np.asarray(judged & ~alive & without), alive, without)
    if bridged and found.say("electrodes bridged"):
        found.bridged_electrodes = bridged
    gone = found.open_electrodes + found.bridged_electrodes
    return np.asarray(out | np.isin(table, gone).any(axis=1))


def _open(
    model: Model, table: IntArray, judged: BoolArray, alive: BoolArray, silent: BoolArray
) -> tuple[tuple[int, ...], int]:
    """Return the open electrodes, and the number of electrodes with enough rows for a decision. An
    electrode is open if none of its rows is alive, or if all rows that it drives with several
    partners are silent."""
    opened, told = [], 0
    for e in range(model.protocol.n_electrodes):
        uses, drives = (table == e).any(axis=1) & judged, (table[:, :2] == e).any(axis=1) & judged
        partners = set(table[drives, :2].ravel()) - {e}
        lifeless = uses.sum() >= limits.ROWS_TO_JUDGE and not (uses & alive).any()
        floats = drives.sum() >= limits.ROWS_TO_JUDGE and silent[drives].all() and len(partners) > 1
        told += int(uses.sum() >= limits.ROWS_TO_JUDGE)
        if lifeless or floats:
            opened.append(e)
    return tuple(opened), told


def _across(table: IntArray, pair: set[int]) -> BoolArray:
    """Rows (m,) that drive or measure across ``pair``."""
    return np.array([set(row[:2]) == pair or set(row[2:]) == pair for row in table.tolist()])


def _bridged(
    table: IntArray, dead: BoolArray, alive: BoolArray, without: BoolArray
) -> tuple[int, ...]:
    """Electrodes of pairs across which every row is dead though both live elsewhere; ``without``
    open electrodes."""
    found: set[int] = set()
    for pair in {frozenset(two) for row in table[dead].tolist() for two in (row[:2], row[2:])}:
        across = _across(table, set(pair)) & without
        lives = all((alive & (table == e).any(axis=1)).any() for e in pair)
        if lives and not (across & alive).any() and (across & dead).sum() >= limits.ROWS_TO_JUDGE:
            found |= pair
    return tuple(sorted(found))


# ---- reciprocals ----


def flagged(model: Model, folded: Folded, ref: Reference) -> IntArray:
    """Folds whose rows differ by more than noise, the frame and the fold's own size explain."""
    fold, off = model.fold, np.abs(folded.apart)
    with np.errstate(divide="ignore", invalid="ignore"):
        if ref.noise_v > 0 and model.data_kind == "normalised":
            each = ref.noise_v * np.hypot(1 / ref.v0[fold.first], 1 / ref.v0[fold.second])
            most = limits.OUTLIER_NOISE * each
        elif ref.noise_v > 0:
            one = abs(ref.gain) * ref.row_gain[fold.first] * ref.noise_v
            most = limits.OUTLIER_NOISE * np.sqrt(2) * one
        else:
            spread = robust(off[folded.both])
            most = np.full(len(off), limits.OUTLIER_ROBUST * spread if spread > 0 else np.inf)
    large = off > limits.OUTLIER_LARGEST * np.abs(folded.d).max(initial=0.0)
    own = off > limits.OUTLIER_FRACTION * (np.abs(folded.d) + off / 2)
    return np.flatnonzero(folded.both & (off > most) & large & own)


def outliers(model: Model, folded: Folded, ref: Reference, found: Found) -> BoolArray:
    """Rows (m,) to leave out as outliers, or because of noisy electrodes."""
    out, fold = np.zeros(model.protocol.n_rows, dtype=bool), model.fold
    which = flagged(model, folded, ref)
    if len(which) > limits.OUTLIER_MAX:
        return _noisy(model, which, found)
    if not len(which) or not found.say("outlier"):
        return out
    expected = predicted(model, folded, which)
    for k, value in zip(which, expected, strict=True):
        first, second = (abs(folded.d[k] + side * folded.apart[k] / 2 - value) for side in (1, -1))
        out[fold.first[k]] = not first <= limits.OUTLIER_NEARER * second
        out[fold.second[k]] = not second <= limits.OUTLIER_NEARER * first
    found.outliers += int(out.sum())
    return out


def predicted(model: Model, folded: Folded, which: IntArray) -> FloatArray:
    """Predict the folds in ``which`` from the other folds, by ridge regression on the model's
    singular vectors; NaN if the others do not determine them."""
    nothing = np.full(len(which), np.nan)
    if model.row_form is None or not folded.known.all():
        return nothing
    u, s, _, _ = singular(model)
    answers, ridge = u * s, limits.OUTLIER_RIDGE * s.max() ** 2 * np.eye(len(s))
    if not _own_part(answers, ridge, which) > limits.OUTLIER_PIVOT:
        return nothing
    others = np.delete(np.arange(len(folded.d)), which)
    normal = answers[others].T @ answers[others] + ridge
    return np.asarray(
        answers[which] @ np.linalg.solve(normal, answers[others].T @ folded.d[others])
    )


def _own_part(answers: FloatArray, ridge: FloatArray, which: IntArray) -> float:
    """The least part of a fold in ``which`` that the fit of all folds, and of those before it in
    ``which``, does not follow by itself."""
    hat = answers[which] @ np.linalg.solve(answers.T @ answers + ridge, answers[which].T)
    left = np.eye(len(which)) - hat
    pivots = [
        left[k, k] - left[k, :k] @ np.linalg.solve(left[:k, :k], left[:k, k])
        for k in range(len(which))
    ]
    return float(min(pivots))


def _noisy(model: Model, which: IntArray, found: Found) -> BoolArray:
    """More flagged folds than single readings give: rows (m,) of what nearly all of them share."""
    table, out = model.protocol.drive_measure.astype(int), np.zeros(model.protocol.n_rows, bool)
    used = table[model.fold.first[which]]
    shared = np.array([(used == e).sum() for e in range(model.protocol.n_electrodes)])
    names = tuple(int(e) for e in np.flatnonzero(shared >= limits.NOISY_FRACTION * len(which)))
    if not names:
        found.say("model mismatch")
        return out
    if not found.say("electrode noisy"):
        return out
    found.noisy_electrodes = names
    if len(names) == 2 and _across(used, set(names)).all():  # one channel: what it measures
        return np.array([set(row[2:]) == set(names) for row in table.tolist()])
    return np.asarray(np.isin(table, names).any(axis=1))


# ---- outside the model's range ----


def noise_energy(model: Model, folded: Folded, ref: Reference) -> float:
    """The variance of a fold's datum by the noise of its rows, summed over folds with data. The
    mean of two has half of it; two that agree to the last bit are one measurement."""
    row = np.where(folded.first, model.fold.first, model.fold.second)
    with np.errstate(invalid="ignore"):
        scale = 1 / ref.v0 if model.data_kind == "normalised" else ref.gain * ref.row_gain
    each = (scale[row] * ref.noise_v) ** 2
    halved = np.where(folded.both & (folded.apart != 0), each / 2, each)
    return float(halved[folded.known].sum())


def mismatch(
    model: Model, folded: Folded, ref: Reference, drift: FloatArray | None, found: Found
) -> bool:
    """Return whether more of d lies outside the model's range than noise explains; sets the
    fraction of |d| that does."""
    folds, rank = len(folded.d), model.rank
    if model.row_form is None or not folded.known.all() or rank >= folds or not ref.noise_v > 0:
        return False
    u = singular(model)[0]
    drifts = np.zeros((folds, 0)) if drift is None else drift[:, None]
    off, whole = (
        folded.d - some @ np.linalg.lstsq(some, folded.d, rcond=1e-12)[0]
        for some in (np.column_stack([u, drifts]), drifts)
    )
    noise = noise_energy(model, folded, ref) * (folds - rank) / folds
    beyond = float(off @ off) - noise
    if not beyond > 0 or not whole @ whole > 0:
        return False
    fraction = float(np.sqrt(beyond / (whole @ whole)))
    found.model_mismatch = min(fraction, 1.0)
    return (
        fraction > limits.MISMATCH_FRACTION and float(off @ off) > limits.MISMATCH_NOISE**2 * noise
    )


def unpaired(model: Model, folded: Folded, found: Found) -> BoolArray:
    """Rows (m,) of the one fold that the others predict worst, where no fold has a reciprocal of
    its own: its standardised error holds most of the energy, and is far beyond the others'."""
    out = np.zeros(model.protocol.n_rows, dtype=bool)
    if "outlier" not in found.wanted or "model mismatch" in found.names or folded.apart.any():
        return out
    u, s, _, _ = singular(model)
    hat = (u * (s**2 / (s**2 + limits.OUTLIER_RIDGE * s.max() ** 2))) @ u.T
    off, left = np.abs(folded.d - hat @ folded.d), 1 - np.diag(hat)
    size = np.where(
        left > limits.OUTLIER_PIVOT, off / np.sqrt(np.maximum(left, limits.OUTLIER_PIVOT)), 0.0
    )
    worst = int(size.argmax())
    alone = size[worst] ** 2 > limits.OUTLIER_ENERGY * float(off @ off)
    if alone and size[worst] > limits.OUTLIER_UNPAIRED * robust(size):
        rows = [model.fold.first[worst], model.fold.second[worst]]
        out[[row for row in rows if row >= 0]] = True
        found.outliers += int(out.sum())
        found.say("outlier")
    return out


def scaled(frame: FloatArray, ref: Reference, unusable: BoolArray, found: Found) -> None:
    """Return whether the rows in use have another size than the reference, all together."""
    v0 = ref.v0[~unusable]
    along = float((frame[~unusable] * np.where(v0 < 0, -1, 1)).sum())
    size, most = float(np.abs(v0).sum()), limits.STALE_SCALE
    if size > 0 and not size / most <= along <= most * size:
        found.say("stale reference")


# ---- after the solve ----


def stale(correlation: FloatArray, options: Options, lambda_noise: float) -> bool:
    """Return whether S'y goes the way that touches cannot, more than the other way and than
    noise."""
    if options.sign == "both" or not lambda_noise > 0:
        return False
    other = "decrease" if options.sign == "increase" else "increase"
    against = greatest(correlation, other)
    ahead = greatest(correlation, options.sign)
    return against > max(limits.STALE_RATIO * ahead, limits.STALE_NOISE * lambda_noise)


def crowded(
    model: Model,
    touches: tuple[Touch, ...],
    options: Options,
    unexplained: float,
    clearness: float,
) -> bool:
    """Return whether there are more touches than can be separated, by a linear score;
    ``clearness``: lambda_max over lambda_noise."""
    if not touches or clearness < limits.CROWD_FAINT:
        return False
    apart = [
        np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) / (a.radius_mm + b.radius_mm)
        for a, b in combinations(touches, 2)
    ]
    weakest, clear = min(t.explained for t in touches), limits.CROWD_CLEAR
    if weakest < clear**2 * unexplained:
        clear = float(np.sqrt(weakest / unexplained))
    score = limits.CROWD_OFFSET
    score += limits.CROWD_TOUCHES * len(touches) / model.protocol.n_electrodes
    score += limits.CROWD_NEAREST * min([limits.CROWD_FAR, *apart])
    score += limits.CROWD_WIDEST * max(t.radius_mm for t in touches) / options.touch_seed_radius_mm
    score += limits.CROWD_LEFT * np.sqrt(unexplained) + limits.CROWD_CLEAREST * clear
    score += limits.CROWD_WEAKEST * min(limits.CROWD_STRONG, np.sqrt(weakest) * clearness)
    numbers = limits.CROWD_NUMBERS * len(touches)
    if len(touches) >= options.max_touches or numbers > model.rank:
        return True
    return bool(score < limits.CROWD_MIN)
