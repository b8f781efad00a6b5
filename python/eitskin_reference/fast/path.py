"""The fast path: touches after each drive of a scan. The numpy reference of csrc/src/fast/path.c.

A frame's rows are measured one drive after another. After each drive its rows are compared with
what the known touches predict; what is unexpected is a change of those, a glitch, a drift of the
gain, or a new touch. The whole-frame solver stays as it is: frames are brought to one instant
before it sees them (``aligned``), and its touches confirm, seed and correct these (``confirm``).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.diagnostics_table import DIAGNOSTICS, Touch
from eitskin.core.fast import AlignedFrame, FastTouch
from eitskin.model.model import Model
from eitskin_reference.constants_table import (
    FAST_AMBIGUOUS,
    FAST_BIRTH,
    FAST_BIRTH_ERROR,
    FAST_BORN_MM,
    FAST_BORN_STRENGTH,
    FAST_CHANGE,
    FAST_CHANGE_MM,
    FAST_CONFIRM_MM,
    FAST_DEAD,
    FAST_DEAD_NOISE,
    FAST_DRIFT_STEP,
    FAST_DRIFTED,
    FAST_DRIFTED_FRAMES,
    FAST_DRIFTED_NOISE,
    FAST_ENERGY_DRIVES,
    FAST_FAINT,
    FAST_FAR,
    FAST_FIRST_SPEED,
    FAST_FRAMES,
    FAST_GAIN_STEP,
    FAST_GLITCH,
    FAST_GONE,
    FAST_HELD,
    FAST_LEFT_SD,
    FAST_LOST_FRAMES,
    FAST_MAX_DRIFT,
    FAST_MAX_TOUCHES,
    FAST_MAX_WAIT,
    FAST_MOVED_MM,
    FAST_MOVED_SD,
    FAST_MOVED_STRENGTH,
    FAST_NEWS,
    FAST_OFF,
    FAST_ON,
    FAST_PAIR_HELD,
    FAST_QUIET,
    FAST_SEED_MM,
    FAST_SEED_STRENGTH,
    FAST_SPREAD_MM,
    FAST_STRENGTH_JUMP,
    FAST_SUSPECT,
    FAST_SUSPECT_MOST,
    FAST_UNEXPLAINED,
    FAST_WILD,
)
from eitskin_reference.fast.births import Births, Fit, Held, apart, inverted
from eitskin_reference.fast.rows import Drive, RowModel, drives_of
from eitskin_reference.fast.tracks import (
    SIZE,
    VX,
    VY,
    C,
    Innovation,
    Tracks,
    X,
    Y,
    dot,
    lower_solve,
    summed,
)

_MEMORY = 32  # drives of which it is known whether they were explained
_SATURATED, _STALE, _CROWDED = (
    1 << DIAGNOSTICS.index(name) for name in ("saturated", "stale reference", "crowded")
)


@dataclass(eq=False)
class _Known:
    """What is kept of a touch beside its state."""

    id: int
    energy: float  # mean share of chi^2 that it explains in a drive
    on: bool = True
    off_drives: int = 0
    frames_missed: int = 0
    confirmed: bool = False
    at: FloatArray | None = None  # where, when a frame was last aligned


@dataclass(eq=False)
class _Past:
    """The last time that a drive was measured: touches' x, y and strength by id, and whether its
    rows were accounted for."""

    state: dict[int, FloatArray] = field(default_factory=dict)
    explained: bool = True


class FastPath:
    """One skin's fast path. ``sign`` is +1 where touches raise the conductivity, -1 where they
    lower it.

    Raises:
        UsageError: the model has no fields.
    """

    def __init__(self, model: Model, *, sign: float = 1.0) -> None:
        self.model, self.rows, self.drives = model, RowModel(model), drives_of(model)
        self._table = model.protocol.drive_measure
        cells = np.flatnonzero((model.grid.index % 2 == 0).all(axis=1))
        self._births, self._sign, self._next_id = Births(self.rows, cells, sign), sign, 1
        m = model.protocol.n_rows
        self.tare(np.zeros(m), 1.0, np.ones(m))

    def tare(self, v0: FloatArray, noise_v: float, gain: FloatArray) -> None:
        """Begin without touches: the untouched frame ``v0`` (m,) V, the rows' noise, and model
        volts per measured volt of each row (m,)."""
        self._v0, self._noise_v, self._gain = v0, noise_v, gain
        self._sigma = noise_v * float(np.sqrt(dot(gain, gain) / len(gain)))
        self._drift, self._drifted, self._time_us = 0.0, 0, -1
        noise = noise_v / max(float(np.sqrt(np.nanmean(v0 * v0))), float(np.finfo(float).tiny))
        self._far = max(FAST_DRIFTED, FAST_DRIFTED_NOISE * noise)
        self.tracks, self._known = Tracks(), list[_Known]()
        self._held, self._quiet, self._waited, self._glitched = list[Held](), 0, 0, False
        self._first: FloatArray | None = None
        self._beside = False  # whether the map beside it is made
        self._unexplained, self._unexplained_frames = [False] * _MEMORY, 0
        self._past = [_Past() for _ in self.drives]
        self._masked = np.zeros(len(v0), dtype=np.bool_)
        self._wild, self._suspect = 0, np.zeros(int(self._table.max()) + 1, dtype=np.int64)
        self._seeds: list[tuple[float, float]] = []
        self._named, self._stirred, self._next_aligned = (0, 0), False, self._next_id

    # ---- a drive ----

    def drive(self, number: int, volts: FloatArray, time_s: float) -> list[FastTouch]:
        """The rows (r,) in V of drive ``number``, nan where there is none, measured about
        ``time_s``, which counts by microseconds; returns what touches the skin."""
        drive = self.drives[number]
        v0 = self._v0[drive.rows]
        used = self._chosen(drive, volts, v0)
        z = self._gain[drive.rows] * np.where(used, volts - (1 + self._drift) * v0, 0.0)
        used &= np.abs(z) < FAST_FAR * self._sigma
        z = np.where(used, z, 0.0)
        time_us = round(1e6 * time_s)
        if 0 <= self._time_us < time_us:
            self.tracks.predict((time_us - self._time_us) * 1e-6)
        self._time_us = time_us
        self._past[number] = _Past()
        self._changed = False
        explained = self._look(number, z, used)
        self._past[number].explained = explained and not self._changed
        self._unexplained = [*self._unexplained[1:], not explained]
        self._update_known()
        for known, state in zip(self._known, self.tracks.state, strict=True):
            self._past[number].state[known.id] = state[:3].copy()
        return self.touches()

    def _chosen(self, drive: Drive, volts: FloatArray, v0: FloatArray) -> BoolArray:
        """Rows (r,) that are measured, not wild, and of no electrode of which most rows are: no
        touch changes a row so far."""
        used = np.isfinite(volts) & np.isfinite(v0) & ~self._masked[drive.rows]
        far = (volts * v0 < FAST_DEAD * (v0 * v0)) | (volts * v0 > FAST_WILD * (v0 * v0))
        wild = used & far & (np.abs(v0) > FAST_DEAD_NOISE * self._noise_v)
        self._wild += int(wild.sum())
        measured = self._table[drive.rows, 2:]
        if 2 * int(wild.sum()) <= len(used):  # else it is the drive's doing
            for pair, one in zip(measured[used], wild[used], strict=True):
                for e in pair:
                    step = 1 if one else -1
                    self._suspect[e] = min(max(self._suspect[e] + step, 0), FAST_SUSPECT_MOST)
        return np.asarray(used & ~wild & ~(self._suspect[measured] > FAST_SUSPECT).any(axis=1))

    def touches(self) -> list[FastTouch]:
        """What touches the skin, as of the last drive."""
        return [
            FastTouch(known.id, s[X], s[Y], s[VX], s[VY], s[C], known.confirmed)
            for known, s in zip(self._known, self.tracks.state.tolist(), strict=True)
            if known.on
        ]

    def _look(self, number: int, z: FloatArray, used: BoolArray) -> bool:
        """Believe the rows, or wait; whether they are accounted for."""
        drive, tracks = self.drives[number], self.tracks
        answers = np.array([self.rows.answer(drive, s[X], s[Y])[0] for s in tracks.state])
        answers = answers.reshape(len(tracks), 3, len(z))
        seen = tracks.innovation(z, used, self._sigma, answers)
        along = self._gain[drive.rows] * np.where(used, self._v0[drive.rows], 0.0)
        if seen.chi2 >= FAST_NEWS:
            other = self._other_than_touches(z, used, seen, answers, along)
            if other is not None:
                tracks.update(other)
                return True
        else:
            self._glitched = False
        # while drives wait, what is on stays: it would go to meet the one that lands
        moves = np.array([not (known.on and self._held) for known in self._known])
        for strength, place_mm in ((FAST_STRENGTH_JUMP, 0.0), (FAST_CHANGE, FAST_CHANGE_MM)):
            if seen.chi2 < FAST_NEWS or not len(tracks):
                break
            kept, tracks.p = tracks.p, tracks.loosened(strength, place_mm * moves)
            seen = tracks.innovation(z, used, self._sigma, answers)
            if seen.chi2 >= FAST_NEWS:
                tracks.p = kept
            else:
                self._changed = place_mm > 0  # perhaps within the drive
        news = seen.chi2 >= FAST_NEWS
        if news or self._held:
            self._wait(Held(drive, seen.white, seen.factor, used, news, number))
        if news:
            return self._find_births()
        if self._quiet >= FAST_QUIET:
            self._held = []
        left = z.copy()
        for known, strength, answer in zip(
            self._known, tracks.state[:, C], answers[:, 0], strict=True
        ):
            ratio = float(strength) / self._sigma
            known.energy += (ratio * ratio * dot(answer, answer) - known.energy) / (
                FAST_ENERGY_DRIVES
            )
            left -= strength * answer
        self._follow_drift(left, along)
        tracks.update(seen)
        return True

    def _other_than_touches(
        self,
        z: FloatArray,
        used: BoolArray,
        seen: Innovation,
        answers: FloatArray,
        along: FloatArray,
    ) -> Innovation | None:
        """The rows without one that is a glitch, or without a drift of the gain, where that and no
        touch explains them."""
        own = seen.e**2 / summed(seen.factor**2, axis=1)
        worst = int(np.argmax(own))
        if own[worst] > FAST_GLITCH and not self._glitched:
            unit = lower_solve(seen.factor, np.eye(len(z))[worst])
            left = seen.white - dot(unit, seen.white) / dot(unit, unit) * unit
            if dot(left, left) < FAST_NEWS:
                without, self._glitched = used.copy(), True
                without[worst] = False
                return self.tracks.innovation(z, without, self._sigma, answers)
        self._glitched = False
        drift = lower_solve(seen.factor, along)
        energy = dot(drift, drift)
        if not energy > 0:
            return None
        size = dot(drift, seen.white) / energy
        if not (seen.chi2 - size * size * energy < FAST_NEWS and abs(size) < FAST_MAX_DRIFT):
            return None
        self._drift += FAST_DRIFT_STEP * size
        return replace(seen, white=seen.white - size * drift)

    def _follow_drift(self, left: FloatArray, along: FloatArray) -> None:
        """A little of what is ``left`` along v0 is drift of the gain."""
        energy = dot(along, along)
        if energy > 0:
            self._drift += FAST_GAIN_STEP * dot(along, left) / energy

    # ---- births ----

    def _wait(self, one: Held) -> None:
        """A drive is held until it is accounted for, as long as there is room."""
        self._waited += 1
        begins = not self._held or self._waited > FAST_MAX_WAIT
        if begins:
            self._births.begin()
            self._held, self._waited, self._first, self._beside = [], 0, None, False
        if not (begins and one.sudden) and not self._beside:
            self._births.add(one)
        self._held = [*self._held, one][-FAST_HELD:]
        self._quiet = 0 if one.news else self._quiet + 1

    def _find_births(self) -> bool:
        """Touches that explain what waits, by one search a drive; whether there are."""
        room = FAST_MAX_TOUCHES - len(self.tracks)
        if len(self._held) < 2 or room < 1 or sum(self._unexplained) > FAST_UNEXPLAINED:
            return False
        held = self._held[1:]
        if self._first is not None and room >= 2:
            if not self._beside:
                self._births.map_beside(held, self._first)
                self._beside = True
                return False
            first, self._first, self._beside = self._first, None, False
            return self._try(self._births.two(held, first), held[-FAST_PAIR_HELD:])
        self._first, self._beside = None, False
        begin = int(self._held[0].sudden)
        held = self._held[begin:]
        fits = self._births.one(held)
        if self._try(fits, held):
            return True
        if fits:
            left = fits[0].left
            more = float(summed(left)) > _noise(fits[0], held)
            self._first = fits[0].places if more and len(self._held) > 2 else None
            spoiled = int(np.argmax(left))
            if left[spoiled] > max(FAST_NEWS, float(summed(left)) / 2) and spoiled < len(held) - 1:
                del self._held[begin + spoiled]
                self._first = None
        return False

    def _try(self, fits: Sequence[Fit], held: list[Held]) -> bool:
        """The best of ``fits`` is born where it is believed, with the first drive or without, first
        as it was searched for."""
        if not fits:
            return False
        others = [fit.score for fit in fits[1:] if apart(fit.places[-1:], fits[0].places[-1]).all()]
        lead = fits[0].score - max([0.0, *others])
        other = self._held[1:] if len(held) == len(self._held) else self._held
        for drives in (held, other) if len(fits[0].places) == 1 else (held,):
            fit = fits[0] if drives is held else self._births.fit(drives, fits[0].places)
            if fit is not None and self._believed(fit, lead, drives):
                self._give_birth(fit, drives)
                self._held = []
                return True
        return False

    def _believed(self, best: Fit, lead: float, held: Sequence[Held]) -> bool:
        k, inverse = len(best.places), inverted(best.h)
        if inverse is None:
            return False
        left, kappa = float(summed(best.left)), _excess(best, held)
        on = self.tracks.state[[known.on for known in self._known], :2]  # others give way
        spread = max(float(np.trace(inverse[i : i + 2, i : i + 2])) for i in range(0, 2 * k, 2))
        return bool(
            (best.own > FAST_BIRTH * kappa).all()
            and left < _noise(best, held) + FAST_BIRTH_ERROR * FAST_BIRTH_ERROR * best.score
            and kappa * spread < FAST_SPREAD_MM * FAST_SPREAD_MM
            and lead > max(FAST_BIRTH, FAST_AMBIGUOUS * best.own[-1])
            and all(
                apart(np.vstack([best.places[:i], on]), place).all()
                for i, place in enumerate(best.places)
            )
        )

    def _give_birth(self, fit: Fit, held: Sequence[Held]) -> None:
        kappa, inverse = _excess(fit, held), inverted(fit.h)
        assert inverse is not None
        for i, (x_mm, y_mm) in enumerate(fit.places):
            for k in reversed(range(len(self.tracks))):
                if not apart(self.tracks.state[k : k + 1, :2], fit.places[i])[0]:
                    self._forget(k)
            strength, p = fit.strength[-1, i], np.zeros((SIZE, SIZE))
            p[:2, :2] = kappa * inverse[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
            p[C, C] = kappa * fit.variance[i]
            at = np.arange(SIZE)
            p[at, at] += (
                np.array(
                    [
                        FAST_BORN_MM,
                        FAST_BORN_MM,
                        FAST_BORN_STRENGTH * strength,
                        FAST_FIRST_SPEED,
                        FAST_FIRST_SPEED,
                    ]
                )
                ** 2
            )
            self.tracks.add(np.array([x_mm, y_mm, strength, 0.0, 0.0]), p)
            known = _Known(self._next_id, float(fit.own[i]) / len(held))
            self._known.append(known)
            self._next_id += 1
            for one, then in zip(held, fit.strength[:, i], strict=True):
                past = self._past[one.number]
                past.state[known.id] = np.array([x_mm, y_mm, then])
        for one in held:
            self._past[one.number].explained = True

    def _update_known(self) -> None:
        """Which touches are on, and which have gone."""
        tracks = self.tracks
        for k in reversed(range(len(tracks))):
            known, state = self._known[k], tracks.state[k]
            strength = self._sign * state[C]
            tracks.peak[k] = max(tracks.peak[k], strength)
            if strength < FAST_OFF * tracks.peak[k] or known.energy < FAST_FAINT:
                known.on = False
            elif strength > FAST_ON * tracks.peak[k] and known.energy > 2 * FAST_FAINT:
                known.on = True
            known.off_drives = 0 if known.on else known.off_drives + 1
            on_skin = np.isfinite(state).all() and self.rows.on_skin(state[X], state[Y])
            if known.off_drives > FAST_GONE or not on_skin:
                self._forget(k)
            elif not known.on:
                state[VX:] = 0.0

    def _forget(self, k: int) -> None:
        self.tracks.remove(k)
        del self._known[k]

    # ---- whole frames ----

    def named(self, diagnostics: int) -> int:
        """What may be reported of the bits that the solver found in the last aligned frame."""
        twice = diagnostics & self._named[0]
        thrice, self._named = twice & self._named[1], (diagnostics, self._named[0])
        stale = _STALE if self._drifted >= FAST_DRIFTED_FRAMES else 0
        if self._stirred:
            return thrice | diagnostics & _SATURATED | stale
        return diagnostics & ~_CROWDED | twice & _CROWDED | stale

    def aligned(self, volts: FloatArray) -> AlignedFrame:
        """The last scan's rows (m,) in V, all drives measured once since the last call, brought to
        the instant of its last drive. Touches that stay as they are change no bit."""
        out = volts.copy()
        self._stirred = self._glitched or self._next_id != self._next_aligned
        self._next_aligned = self._next_id
        for k, known in enumerate(self._known):
            now = self.tracks.state[k, :3]
            known.at = now[:2].copy()
            then = [past.state.get(known.id, np.array([*now[:2], 0.0])) for past in self._past]
            self._stirred |= not known.on
            if not self._moved(k, now, np.array(then)):
                continue
            for drive, was in zip(self.drives, then, strict=True):
                change = now[C] * self.rows.answer(drive, now[X], now[Y])[0][0]
                change = change - was[C] * self.rows.answer(drive, was[X], was[Y])[0][0]
                out[drive.rows] += change / self._gain[drive.rows]
        explained = all(past.explained for past in self._past) and not self._held
        self._unexplained_frames = 0 if explained else self._unexplained_frames + 1
        self._stirred |= not explained
        self._drifted = self._drifted + 1 if abs(self._drift) > self._far else 0
        return AlignedFrame(out, explained, explained or self._unexplained_frames > FAST_FRAMES)

    def _moved(self, k: int, now: FloatArray, then: FloatArray) -> bool:
        variance = np.diag(self.tracks.p)[SIZE * k : SIZE * k + 3]
        least = FAST_MOVED_STRENGTH * abs(now[C])
        far = max(FAST_MOVED_MM, FAST_MOVED_SD * float(np.sqrt(variance[0] + variance[1])))
        much = max(least, FAST_MOVED_SD * float(np.sqrt(variance[C])))
        x, y = (then[:, :2] - now[:2]).T
        square, change = float((x * x + y * y).max()), float(np.abs(then[:, C] - now[C]).max())
        self._stirred |= square > FAST_MOVED_MM * FAST_MOVED_MM or change > least
        return square > far * far or change > much

    def confirm(self, found: Iterable[Touch], electrodes: Iterable[int] = ()) -> list[FastTouch]:
        """What the whole-frame solver found in the last aligned frame, and the electrodes that it
        named. Touches that it does not find go after some frames, what it alone finds comes; rows
        of these electrodes are left out."""
        bad = np.isin(self._table, list(electrodes))
        self._masked = np.asarray(bad.any(axis=1))
        places = np.array([(one.x_mm, one.y_mm) for one in found]).reshape(-1, 2)
        free = np.ones(len(places), dtype=np.bool_)
        for k in reversed(range(len(self.tracks))):
            known = self._known[k]
            at, known.at = known.at, None
            if at is None:  # it came after that frame
                continue
            x, y = (places - at).T
            square = np.where(free, x * x + y * y, np.inf)
            nearest = int(np.argmin(square)) if len(places) else -1
            if nearest >= 0 and square[nearest] < FAST_CONFIRM_MM * FAST_CONFIRM_MM:
                free[nearest], known.confirmed, known.frames_missed = False, True, 0
                continue
            known.frames_missed += 1
            if known.on and known.frames_missed >= FAST_LOST_FRAMES:
                self._forget(k)
        strength = [one.strength_s_per_m_mm2 for one in found]
        if self._wild:  # a frame with rows that are no touch's may show any
            free[:] = False
        self._wild = 0
        self._seed(places[free], np.array(strength)[free])
        return self.touches()

    def _seed(self, places: FloatArray, strength: FloatArray) -> None:
        """Touches that two frames on end have found and no drive."""
        before, self._seeds = self._seeds, []
        for place, c in zip(places, strength, strict=True):
            if apart(np.array(before).reshape(-1, 2), place).all():
                if len(self._seeds) < FAST_MAX_TOUCHES:
                    self._seeds.append((float(place[0]), float(place[1])))
                continue
            if len(self.tracks) == FAST_MAX_TOUCHES:
                continue
            if not apart(self.tracks.state[:, :2], place).all():
                continue
            sd = [FAST_SEED_MM, FAST_SEED_MM, FAST_SEED_STRENGTH * c] + [FAST_FIRST_SPEED] * 2
            self.tracks.add(np.array([*place, c, 0.0, 0.0]), np.diag(np.array(sd) ** 2))
            self._known.append(_Known(self._next_id, 4 * FAST_FAINT, confirmed=True))
            self._next_id += 1


def _freedom(fit: Fit, held: Sequence[Held]) -> int:
    """Rows less what has been fitted to them, at least 1."""
    return max(1, sum(one.rows for one in held) - len(fit.places) * (len(held) + 2))


def _excess(fit: Fit, held: Sequence[Held]) -> float:
    """What is left of chi^2 for each degree of freedom, at least 1."""
    return max(1.0, float(summed(fit.left)) / _freedom(fit, held))


def _noise(fit: Fit, held: Sequence[Held]) -> float:
    """What noise alone leaves of chi^2, and hardly more."""
    free = _freedom(fit, held)
    return free + FAST_LEFT_SD * float(np.sqrt(2 * free))
