"""The stage before the solver, in numpy: what csrc/src/frame and csrc/src/api/frame_stage.c do. The
reference is taken, a frame examined, folded against it, reduced and whitened for what is left of
it.
"""

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.diagnostics import with_diagnostics
from eitskin.core.diagnostics_table import DIAGNOSTICS
from eitskin.core.options_table import LOG_DATA
from eitskin.core.results import (
    LearnedReference,
    Options,
    check_reference_frames,
)
from eitskin.errors import FrameError
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin_reference.constants_table import (
    FOLD_ROUNDING,
    MAX_OF_NOISE,
    MAX_RATIO,
    MAX_REGULARISATION,
    MIN_REFERENCE_FRAMES,
    NOISE_ROUNDING,
    RATIO_DEFINED,
)
from eitskin_reference.diagnostics import Examiner, Folded, FrameDiagnostics, Reference
from eitskin_reference.places import Corrected, corrected
from eitskin_reference.problem import (
    greatest,
    orthonormal,
    project,
)
from eitskin_reference.reference_outliers import clean
from eitskin_reference.row_gains import row_gains
from eitskin_reference.whitening import Whitening, filled, form_of, whiten

DEAD = "all voltages are zero; is the skin driven and connected?"


class FrameStage:
    """One model's reference, and frames against it as the solver gets them."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.options = default_options(model)
        self._s, self._p = model.sensitivity, model.projection.astype(np.float64)
        self._v_ref = model.v_ref_v.astype(np.float64)
        self._form = form_of(model)
        self._whitening: Whitening | None = None
        self.seen = self._s
        self._bad = np.zeros(model.protocol.n_rows, dtype=bool)
        self._without_reference = self._bad
        self._v0: FloatArray | None = None
        self._drift_v0: FloatArray | None = None
        self._gain, self._row_gain = 1.0, np.ones(model.protocol.n_rows)
        self._distance, self._far = 0.0, False
        self._corrected: Corrected | None = None
        self._v0_rms = 0.0
        self._lambda_noise = 0.0
        self._unusable = self._bad
        self._examiner = Examiner(model)
        self._noise_v = self._noise_energy = 0.0
        self._ready = False
        self._straight: FloatArray | None = None
        all_ = np.ones(len(model.fold.first), dtype=np.bool_)
        self._folded = Folded(np.zeros(len(all_)), np.zeros(len(all_)), all_, all_)

    def set_options(self, options: Options) -> None:
        """Replace the options."""
        learns = self._ready and options.row_gains != self.options.row_gains
        self.options = options
        if learns:
            self._learn_row_gains()
        self._examiner.wanted = {
            name for bit, name in enumerate(DIAGNOSTICS) if options.diagnostics >> bit & 1
        }

    def mask_rows(self, rows: BoolArray) -> None:
        """Leave the protocol rows where ``rows`` (m,) is true out of every frame."""
        self._bad = rows.copy()

    def _fold_reference(self, v0: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Folded reference (k,) and where it is known."""
        fold, usable = self.model.fold, ~(self._bad | self._without_reference)
        first = usable[fold.first]
        second = (fold.second >= 0) & usable[fold.second]
        total = np.where(first, v0[fold.first], 0) + np.where(
            second, fold.sign * v0[fold.second], 0
        )
        count = first.astype(int) + second
        return total / np.maximum(count, 1), count > 0

    def _fit_to_model(self, v0: FloatArray) -> float:
        folded, known = self._fold_reference(v0)
        v, r = folded[known], self._v_ref[known]
        if not np.abs(v).max(initial=0.0) > 0:
            raise FrameError(f"reference frame: {DEAD}")
        correlation = float(v @ r / np.sqrt((v @ v) * (r @ r)))
        self._gain = float(np.sqrt((r @ r) / (v @ v))) * (-1 if correlation < 0 else 1)
        self._v0, self._v0_rms = v0, float(np.sqrt(np.mean(v**2)))
        self._drift_v0 = v0
        self._learn_row_gains()
        return correlation

    def _learn_row_gains(self) -> None:
        errors, self._row_gain = self.model.model_errors, np.ones(self.model.protocol.n_rows)
        if errors is None:
            return
        usable = ~(self._bad | self._without_reference)
        assert self._drift_v0 is not None
        gains, logs, far = row_gains(self.model, usable, self._gain * self._drift_v0)
        self._distance = float(np.sqrt(np.nanmean(logs**2)))
        not_relative = self.model.data_kind != "normalised"
        self._far = far and not_relative
        in_force = errors.row_gains and self.options.row_gains and not_relative
        if in_force:
            self._row_gain = gains
        known = corrected(self.model.grid, errors, logs) if in_force and not far else None
        self._corrected = known

    @property
    def _noise_floor_v(self) -> float:
        """The least noise of a row: frames that were rounded may repeat to the last bit."""
        return max(self.options.noise_floor_v, NOISE_ROUNDING * self._v0_rms)

    @property
    def _lambda_noise_floor(self) -> float:
        """max |S'y| of that."""
        per_volt = 1 / self._v0_rms if self.model.data_kind == "normalised" else abs(self._gain)
        return MAX_OF_NOISE * self.model.noise_gain * self._noise_floor_v * per_volt

    def set_reference(self, frames: FloatArray) -> LearnedReference:
        """Take the reference from quiet ``frames`` (k, m) volts, as CoreEngine.set_reference does.

        Raises:
            FrameError: a frame cannot be used.
        """
        check_reference_frames(frames, self._bad, self.options.saturation_v)
        frames = np.where(self._bad, 0.0, frames)
        before, self._without_reference = (self._without_reference, self._noise_v), self._bad.copy()
        lambda_noise, self._noise_v, left = 0.0, 0.0, np.zeros(frames.shape, dtype=np.bool_)
        was_ready, self._ready = self._ready, False
        try:
            if len(frames) >= MIN_REFERENCE_FRAMES:
                if "outlier" in self._examiner.wanted:
                    frames, left = clean(frames, self.model.fold, ~self._bad)
                lambda_noise = self._learn_lambda_noise(frames, left)
                self._noise_v = self._noise_of(frames)
            correlation = self._fit_to_model(frames.mean(axis=0))
        except FrameError:
            (self._without_reference, self._noise_v), self._ready = (
                before,
                was_ready and self._v0 is not None,
            )
            raise
        if len(frames) >= MIN_REFERENCE_FRAMES:
            lambda_noise = max(lambda_noise, self._lambda_noise_floor)
            self._noise_v = max(self._noise_v, self._noise_floor_v)
        self._lambda_noise, self._ready = lambda_noise, True
        return LearnedReference(
            len(frames),
            correlation,
            self._gain,
            self._v0_rms,
            self._noise_v,
            lambda_noise,
            int(left.sum()),
        )

    def _noise_of(self, frames: FloatArray) -> float:
        """The rms over rows of the deviation of ``frames`` (k, m), V."""
        return float(np.sqrt(frames[:, ~self._bad].var(axis=0, ddof=1).mean()))

    def _learn_lambda_noise(self, frames: FloatArray, left: BoolArray) -> float:
        """The greatest max |S'y| of the second half of ``frames``, each against the mean of those
        before it; readings in ``left`` are not used."""
        half, seen = len(frames) // 2, 0.0
        try:
            self._fit_to_model(frames[:half].mean(axis=0))
            self._noise_v = self._noise_of(
                frames[:half]
            )  # lambda_noise is learned with the regularisation that it asks for
            for k in range(half, len(frames)):
                self._v0 = frames[:k].mean(axis=0)
                y = self.frame_stage(np.where(left[k], np.nan, frames[k]))[0]
                seen = max(seen, greatest(self.seen.T @ y, "both") / self._noise_ratio)
        except FrameError:
            self._v0 = None
            raise
        return seen

    def _datum(self, frame: FloatArray, v0: FloatArray, kind: str) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            if kind == "normalised":
                return (frame - v0) / v0
            if kind == "log-ratio":
                ratio = np.clip(frame / v0, 1 / MAX_RATIO, MAX_RATIO)
                return self._row_gain * self._gain * v0 * np.log(ratio)
        return self._row_gain * self._gain * (frame - v0)

    def frame_stage(self, frame: FloatArray) -> tuple[FloatArray, FloatArray, int]:
        """Reduced projected data y (r,), the basis (k, r) of what is ignored, and how many rows
        were left out.

        ``self.seen`` (r, n) is then S, or what stands for it where rows are left out.

        Raises:
            FrameError: no reference, or too many unusable channels.
        """
        if self._v0 is None:
            raise FrameError("frame: no reference frame has been set")
        limit, look = self.options.saturation_v, self._examiner
        look.found = FrameDiagnostics()
        masked = self._bad | self._without_reference
        saturated = (np.abs(np.nan_to_num(frame)) >= limit) & (limit > 0)
        unusable = masked | ~np.isfinite(frame) | saturated
        look.found.saturated = int((saturated & ~masked).sum())
        look.found.names |= {"saturated"} & look.wanted if look.found.saturated else set()
        judged = (
            Reference(
                np.where(masked, np.nan, self._v0),
                self._v0_rms,
                self._gain,
                self._row_gain,
                self._noise_v,
            )
            if self._ready
            else None
        )
        if judged:
            unusable = unusable | look.electrodes(frame, judged, masked, unusable)
        self._check_rows(frame, unusable)
        if look.found.no_signal:
            raise FrameError(f"frame: {DEAD}")
        folded = self._fold(frame, unusable)
        if judged:
            unusable = unusable | look.outliers(folded, judged)
            folded = self._fold(frame, self._check_rows(frame, unusable))
        if judged and look.model_mismatch(folded, self._along(folded), judged):
            outlier = look.unpaired(folded)
            if outlier.any():
                look.found.model_mismatch, unusable = 0.0, unusable | outlier
                folded = self._fold(frame, self._check_rows(frame, unusable))
            else:
                look.found.names |= {"model mismatch"} & look.wanted
        self._noise_energy = look.noise_energy(folded, judged) if judged else 0.0
        known = folded.first | folded.second
        self._leave_out(known)
        basis = orthonormal(self._directions(folded), self.model.rank)
        y = project(self._reduce(folded.d), basis)
        self._folded, self._straight = folded, self._straight_data(frame, unusable, basis)
        self._unusable = unusable
        directions = len(y) if self._whitening is None else min(len(y), int(known.sum()))
        # where the basis leaves no direction, what is there is rounding
        return y if len(basis) < directions else np.zeros_like(y), basis, int(unusable.sum())

    def _straight_data(
        self, frame: FloatArray, unusable: BoolArray, basis: FloatArray
    ) -> FloatArray | None:
        """What v0 log(v / v0) gives (r,), which strong touches bend less; None where it is not
        asked for."""
        model = self.model
        if (
            model.data_kind != "difference"
            or not self.options.touch_fit & LOG_DATA
            or not self._ready
        ):
            return None
        return project(self._reduce(self._fold(frame, unusable, "log-ratio").d), basis)

    def _check_rows(self, frame: FloatArray, unusable: BoolArray) -> BoolArray:
        """``unusable`` (m,), if there are not too many of them.

        Raises:
            FrameError: there are, or all others are zero.
        """
        if int(unusable.sum()) > self.options.max_masked:
            raise FrameError(
                with_diagnostics(
                    "frame: too many channels of the frame are unusable", self._examiner.found
                )
            )
        if not unusable.all() and not frame[~unusable].any():
            raise FrameError(f"frame: {DEAD}")
        return unusable

    def _fold(self, frame: FloatArray, unusable: BoolArray, kind: str = "") -> Folded:
        """The data of ``frame`` of a ``kind``, else of the model's, folded; zero where a fold is
        left out."""
        assert self._v0 is not None
        fold, kind = self.model.fold, kind or self.model.data_kind
        out = unusable | (
            (kind != "difference") & (np.abs(self._v0) < RATIO_DEFINED * self._v0_rms)
        )
        value = np.where(out, 0.0, self._datum(np.where(out, self._v0, frame), self._v0, kind))
        sign = np.ones_like(fold.sign) if kind == "normalised" else fold.sign
        first, second = ~out[fold.first], (fold.second >= 0) & ~out[fold.second]
        one, other = value[fold.first], np.where(second, sign * value[fold.second], 0.0)
        d = (np.where(first, one, 0.0) + other) / np.maximum(first.astype(int) + second, 1)
        size = (
            np.ones(len(one))
            if kind == "normalised"
            else np.abs(self._gain * (self._row_gain * self._v0)[fold.first])
        )
        apart = first & second & (np.abs(one - other) > FOLD_ROUNDING * size)
        return Folded(d, np.where(apart, one - other, 0.0), first, second)

    def _along(self, folded: Folded) -> FloatArray | None:
        """What drift of the gain makes of the folded data, (k,); None where it is not ignored."""
        if not self.options.project_reference or self._drift_v0 is None:
            return None
        fold, count = self.model.fold, folded.first.astype(int) + folded.second
        v0 = self._row_gain * self._drift_v0
        if self.model.data_kind == "normalised":
            return np.where(count > 0, 1.0, 0.0)
        total = np.where(folded.first, v0[fold.first], 0.0) + np.where(
            folded.second, fold.sign * v0[fold.second], 0.0
        )
        return np.asarray(self._gain * total / np.maximum(count, 1))

    @property
    def _noise_ratio(self) -> float:
        return 1.0 if self._whitening is None else self._whitening.noise_ratio

    @property
    def _detection_threshold(self) -> float:
        """max(S'y) of a frame, or of a touch, below which there is none: one reference frame tells
        no noise, but its rounding is known."""
        learned = max(self._lambda_noise, self._lambda_noise_floor)
        return self.options.detection_factor * self._noise_ratio * learned

    @property
    def _regularisation(self) -> float:
        stored = 0.0 if self._form is None else self._form.regularisation
        return stored if self._whitening is None else self._whitening.regularisation

    def _leave_out(self, known: BoolArray) -> None:
        """Whiten again for the folded rows (k,) that are known, and for the noise."""
        asked = self.options.regularisation_noise_factor * self._noise_v / self._v0_rms
        if self._far:
            asked = MAX_REGULARISATION
        self._whitening = (
            filled(self.model, known) if self._form is None else whiten(self._form, known, asked)
        )
        self.seen = self._s if self._whitening is None else self._whitening.see @ self._s

    def _reduce(self, d: FloatArray) -> FloatArray:
        """Folded data (k,) to reduced data (r,)."""
        if self._whitening is None:
            return self._p @ d
        whole = d if self._whitening.fill is None else self._whitening.fill @ d
        return self._whitening.data @ (self._p @ whole)

    def _directions(self, folded: Folded) -> list[FloatArray]:
        """What the model_mismatch ignores: P's columns of folds left out, unless that is whitened
        again, and the drift of the gain."""
        left_out: list[int] = (
            [] if self._whitening else np.flatnonzero(~(folded.first | folded.second)).tolist()
        )
        directions, along = [self._p[:, k] for k in left_out], self._along(folded)
        return directions if along is None else [*directions, self._reduce(along)]

    def _whole(self, frame: FloatArray) -> FloatArray:
        """A frame (m,) with the last one's rows, reduced and not projected (r,)."""
        folded = self._fold(frame, self._unusable)
        return self._reduce(np.where(folded.first | folded.second, folded.d, 0.0))

    def _of_known(self, basis: FloatArray, d: FloatArray) -> FloatArray:
        """Folded data ``d`` (k,) of the folds in use, reduced as the frame was (r,)."""
        known = self._folded.first | self._folded.second
        return project(self._reduce(np.where(known, d, 0.0)), basis)
