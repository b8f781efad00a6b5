"""The engine ``numpy``: the oracle with the interface of the C core's engine.

Each frame stands by itself: no tracker, no reference tracking, no limit of multiply-accumulates.
``explain`` gives what a frame becomes on its way to the image, for tests.
"""

import threading
from dataclasses import dataclass, replace
from time import perf_counter_ns

import numpy as np

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.constants_table import (
    BASIS_TOLERANCE,
    FINAL_RADIUS,
    INTERACTION_MAX,
    MAX_OF_NOISE,
    MAX_REGULARISATION,
    MIN_REFERENCE_FRAMES,
    MIN_SQUARE,
    NOISE_ROUNDING,
    SHOWN_UNTESTED,
    STALE_EXPLAINED,
)
from eitskin.core.diagnostics import with_diagnostics
from eitskin.core.diagnostics_table import DIAGNOSTICS, Touch
from eitskin.core.options_table import INTERACTION
from eitskin.core.results import (
    TAKE_REFERENCE,
    Info,
    LearnedReference,
    Options,
    Reconstruction,
    check_reference_frames,
)
from eitskin.errors import FrameError, UsageError
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.oracle.discs import Disc, DiscFit, area_mm2, drawn, interaction, on_skin
from eitskin.oracle.examine import (
    Found,
    crowded,
    electrodes,
    mismatch,
    noise_energy,
    outliers,
    scaled,
    stale,
    unpaired,
)
from eitskin.oracle.folding import Folded, Reference, fold_frame, gain_drift
from eitskin.oracle.lasso import Lasso, greatest
from eitskin.oracle.places import corrected
from eitskin.oracle.reference import DEAD, fitted, noise_of, with_row_gains, without_outliers
from eitskin.oracle.whitening import Whitening, project_out, whitening
from eitskin.threads import one_at_a_time

ROUNDS = 4  # of fitting discs and taking their interaction out of the data


@dataclass(frozen=True, eq=False)
class Explained:
    """A frame as the solver gets it: whitened, projected data ``y`` (r,) that ``s`` (r, n) is to
    explain; ``project`` Q (r, r), in both already; the rows that are left out, folded data,
    whitening and diagnostics."""

    y: FloatArray
    s: FloatArray
    project: FloatArray
    unusable: BoolArray
    folded: Folded
    whitening: Whitening
    found: Found


class OracleEngine:
    """Turns one model's frames into images and touches, by definition. It is slow. Its methods hold
    ``lock``, like those of the C core's engine."""

    def __init__(self, model: Model) -> None:
        self.lock = threading.RLock()
        self.model, self.options = model, default_options(model)
        self.reference: Reference | None = None
        self._masked = np.zeros(model.protocol.n_rows, dtype=bool)
        self._last: FloatArray | None = None

    @one_at_a_time
    def set_options(self, options: Options) -> None:
        """Replace the options.

        Raises:
            UsageError: a limit of multiply-accumulates, which are not counted here.
        """
        if options.mac_limit:
            raise UsageError(
                "options: the engine numpy counts no multiply-accumulates; give no mac_limit, or"
                " use the C core"
            )
        if options.sign != self.options.sign:
            self._last = None
        self.options = options
        if self.reference is not None:
            wanted = bool(options.row_gains)
            self.reference = with_row_gains(self.model, self.reference, wanted)

    @one_at_a_time
    def mask_rows(self, rows: BoolArray) -> None:
        """Leave the protocol rows where ``rows`` (m,) is true out of every frame."""
        self._masked = rows.copy()

    @one_at_a_time
    def forget(self) -> None:
        """Forget the last coefficients, from which a warm start begins."""
        self._last = None

    # ---- the reference ----

    @one_at_a_time
    def set_reference(self, frames: FloatArray) -> LearnedReference:
        """Take the reference from untouched ``frames`` (k, m) V: one to three as their mean, more
        also for the noise. docs/design/oracle.md, "Reference".

        Raises:
            FrameError: a frame cannot be used.
        """
        check_reference_frames(frames, self._masked, self.options.saturation_v)
        frames, many = np.where(self._masked, 0.0, frames), len(frames) >= MIN_REFERENCE_FRAMES
        left, lambda_noise, noise_v = np.zeros(frames.shape, dtype=bool), 0.0, 0.0
        if many:
            self.reference = None
            if "outlier" in self._wanted:
                frames, left = without_outliers(self.model, frames, self._masked)
            lambda_noise = self._learn_lambda_noise(frames, left)
            noise_v = noise_of(frames[:, ~self._masked])
        ref = self._fitted(frames.mean(axis=0))
        if many:
            lambda_noise = max(lambda_noise, self._lambda_noise_floor(ref))
            noise_v = max(noise_v, self._noise_floor_v(ref))
        self.reference = replace(ref, noise_v=noise_v, lambda_noise=lambda_noise)
        self._last = None
        return LearnedReference(
            len(frames), ref.correlation, ref.gain, ref.rms_v, noise_v, lambda_noise,
            int(left.sum()),
        )  # fmt: skip

    def _fitted(self, v0: FloatArray) -> Reference:
        return fitted(self.model, v0, self._masked, bool(self.options.row_gains))

    def _learn_lambda_noise(self, frames: FloatArray, left: BoolArray) -> float:
        """The greatest max |S'y| of the second half of ``frames`` (k, m), each against the mean of
        those before it; the first half gives scale, row gains, drift and regularisation."""
        half = len(frames) // 2
        ref = self._fitted(frames[:half].mean(axis=0))
        noise_v, seen = noise_of(frames[:half, ~self._masked]), 0.0
        for k in range(half, len(frames)):
            v0 = np.where(self._masked, np.nan, frames[:k].mean(axis=0))
            before = replace(ref, v0=v0, noise_v=noise_v)
            one = self.explain(np.where(left[k], np.nan, frames[k]), before, judged=False)
            seen = max(seen, greatest(one.s.T @ one.y, "both") / one.whitening.noise_ratio)
        return seen

    def _noise_floor_v(self, ref: Reference) -> float:
        """The least noise of a row: frames that were rounded may repeat to the last bit."""
        return max(self.options.noise_floor_v, NOISE_ROUNDING * ref.rms_v)

    def _lambda_noise_floor(self, ref: Reference) -> float:
        scale = 1 / ref.rms_v if self.model.data_kind == "normalised" else abs(ref.gain)
        return MAX_OF_NOISE * self.model.noise_gain * self._noise_floor_v(ref) * scale

    # ---- a frame ----

    @property
    def _wanted(self) -> frozenset[str]:
        bits = self.options.diagnostics
        return frozenset(name for bit, name in enumerate(DIAGNOSTICS) if bits >> bit & 1)

    def explain(
        self, frame: FloatArray, ref: Reference | None = None, *, judged: bool = True
    ) -> Explained:
        """A frame (m,) V to whitened data; not ``judged``: nothing is looked for.

        Raises:
            FrameError: no reference, or the frame cannot be used.
        """
        ref = self.reference if ref is None else ref
        if ref is None:
            raise FrameError(f"frame: no reference frame has been set; {TAKE_REFERENCE}")
        found, limit, kind = Found(self._wanted), self.options.saturation_v, self.model.data_kind
        masked = self._masked | ~np.isfinite(ref.v0)
        saturated = (np.abs(np.nan_to_num(frame)) >= limit) & (limit > 0) & ~masked
        unusable = masked | saturated | ~np.isfinite(frame)
        found.saturated = int(saturated.sum())
        if found.saturated:
            found.say("saturated")
        if judged:
            unusable = unusable | electrodes(self.model, frame, ref, unusable, found)
        self._check(frame, unusable, found)
        folded = fold_frame(self.model, frame, ref, unusable, kind)
        if judged:
            unusable = unusable | outliers(self.model, folded, ref, found)
            folded = fold_frame(self.model, frame, ref, unusable, kind)
            if mismatch(self.model, folded, ref, self._drift(ref, folded), found):
                alone = unpaired(self.model, folded, found)
                if alone.any():
                    found.model_mismatch, unusable = 0.0, unusable | alone
                    folded = fold_frame(self.model, frame, ref, unusable, kind)
                else:
                    found.say("model mismatch")
            self._check(frame, unusable, found)
            scaled(frame, ref, unusable, found)
        return self._whitened(ref, folded, unusable, found)

    def _drift(self, ref: Reference, folded: Folded) -> FloatArray | None:
        """The direction of gain drift in the folded data (k,), where it is to be ignored."""
        return gain_drift(self.model, ref, folded) if self.options.project_reference else None

    def _whitened(
        self, ref: Reference, folded: Folded, unusable: BoolArray, found: Found
    ) -> Explained:
        asked = self.options.regularisation_noise_factor * ref.noise_v / ref.rms_v
        asked = max(asked, MAX_REGULARISATION if ref.far else 0.0)
        white = whitening(self.model, folded.known, asked)
        directions, drift = white.ignored, self._drift(ref, folded)
        if drift is not None:
            # like the data of folds without rows, those of the drift are unknown there
            directions = np.column_stack([directions, white.data @ drift])
        project, count = project_out(directions, BASIS_TOLERANCE)
        y = project @ (white.data @ folded.d)
        whole = white.ignored.shape[1] > 0 or folded.known.all() or self.model.row_form is None
        most = len(y) if whole else min(len(y), int(folded.known.sum()))
        if count >= most:  # no direction is left: the numbers are rounding errors
            y = np.zeros_like(y)
        return Explained(y, project @ white.seen, project, unusable, folded, white, found)

    def _check(self, frame: FloatArray, unusable: BoolArray, found: Found) -> None:
        if unusable.sum() > self.options.max_masked:
            raise FrameError(
                with_diagnostics("frame: too many rows of the frame are unusable", found)
            )
        dead = not unusable.all() and not frame[~unusable].any()
        if dead or found.no_signal:
            raise FrameError(f"frame: {DEAD}")

    # ---- image ----

    @one_at_a_time
    def reconstruct(self, frame: FloatArray, *, touches: bool = True) -> Reconstruction:
        """One frame (m,) V to image and touches.

        Raises:
            FrameError: the frame cannot be used.
        """
        if frame.shape != (self.model.protocol.n_rows,):
            raise FrameError(
                f"frame: has shape {frame.shape}, but the model's protocol has"
                f" {self.model.protocol.n_rows} rows"
            )
        began_ns = perf_counter_ns()
        try:
            seen = self.explain(np.asarray(frame, dtype=float))
        except FrameError:
            self._last = None
            raise
        ref = self.reference
        assert ref is not None
        lambda_noise = ref.lambda_noise * seen.whitening.noise_ratio
        problem, x, iterations, stop = self._solve(seen.y, seen, lambda_noise)
        correlation = seen.s.T @ seen.y
        lambda_max = greatest(correlation, self.options.sign)
        against = stale(correlation, self.options, lambda_noise)
        if ref.far:
            seen.found.say("unlike the model")
        weight = self.model.column_weight.astype(float)
        solved_ns, unexplained = perf_counter_ns(), 0.0
        reported: tuple[Touch, ...] = ()
        if touches and x.any():
            fit, discs = self._discs(seen, x * weight)
            if self.options.second_pass and len(discs) > 1:
                problem, x, iterations, stop = self._solve(fit.y, seen, lambda_noise)
            left = fit.residual(discs)
            unexplained = float(left @ left) / float(seen.y @ seen.y)
            reported = self._touches(seen, fit, discs, ref)
            clearness = lambda_max / lambda_noise if lambda_noise > 0 else np.inf
            if crowded(self.model, reported, self.options, unexplained, clearness):
                seen.found.say("crowded")
            against = against and not (discs and unexplained < STALE_EXPLAINED)
        if against:
            seen.found.say("stale reference")
        solved = stop in ("iterations", "gap", "optimum")
        self._last = x if solved else None
        gap, norm = problem.gap(x) if solved else 0.0, float(np.linalg.norm(problem.y))
        found, end_ns = seen.found, perf_counter_ns()
        info = Info(
            iterations, stop, int(np.count_nonzero(x)), int(seen.unusable.sum()), 0, len(reported),
            0, 0, problem.lam, lambda_max, lambda_noise, gap, gap / max(norm**2 / 2, 1e-300),
            float(np.linalg.norm(problem.residual(x))), norm, found.diagnostics, found.saturated,
            found.outliers, found.model_mismatch, unexplained, found.open_electrodes,
            found.bridged_electrodes, found.noisy_electrodes, seen.whitening.regularisation,
            solve_us=(solved_ns - began_ns) / 1000, touch_us=(end_ns - solved_ns) / 1000,
        )  # fmt: skip
        if not reported or unexplained >= SHOWN_UNTESTED:
            return Reconstruction(x * weight, x, reported, info)
        info, image = replace(info, shown="touches"), drawn(self.model, reported)
        return Reconstruction(x * weight, x, reported, info, touch_image=image)

    def _threshold(self, ref: Reference, white: Whitening) -> float:
        """lambda_max below which a frame has no touch."""
        learned = max(ref.lambda_noise, self._lambda_noise_floor(ref))
        return self.options.detection_factor * white.noise_ratio * learned

    def _solve(
        self, y: FloatArray, seen: Explained, lambda_noise: float
    ) -> tuple[Lasso, FloatArray, int, str]:
        """The problem of data ``y`` (r,), its solution (n,), how many iterations it took and why it
        ended."""
        o, ref = self.options, self.reference
        assert ref is not None
        lambda_max = greatest(seen.s.T @ y, o.sign)
        lam = o.lambda_abs or max(o.lambda_rel * lambda_max, o.lambda_noise_factor * lambda_noise)
        problem, zero = Lasso(seen.s, y, lam, o.sign), np.zeros(self.model.grid.n_pixels)
        if y.any() and lambda_max < self._threshold(ref, seen.whitening):
            return problem, zero, 0, "below-threshold"
        if not lambda_max > lam or y @ y < MIN_SQUARE:
            return problem, zero, 0, "zero"
        if o.solver not in ("fista", "working-set"):
            return problem, problem.optimum(), o.iterations, "optimum"
        start = self._last if o.warm_start else None
        if start is not None and problem.objective(start) >= problem.objective(zero):
            start = None
        enough = o.gap_rel * float(y @ y) / 2
        limits = o.iterations, self.model.lipschitz
        x, done = problem.fista(*limits, start, gap=enough, every=o.gap_every)
        reached = enough > 0 and problem.gap(x) <= enough
        return problem, x, done, "gap" if reached else "iterations"

    # ---- touches ----

    def disc_fit(self, seen: Explained) -> DiscFit:
        """The fit of discs to a frame's data."""
        o, ref = self.options, self.reference
        assert ref is not None
        each = noise_energy(self.model, seen.folded, ref) / len(seen.folded.d)
        noise = each * float(np.sum(seen.whitening.data**2)) / self.model.rank
        if self._interact:
            o = replace(o, touch_radius_weight=FINAL_RADIUS * o.touch_radius_weight)
        return DiscFit(self.model, seen.s, seen.y, noise, o)

    @property
    def _interact(self) -> bool:
        """Return whether what touches do to each other is taken out of the data."""
        model, wanted = self.model, bool(self.options.touch_fit & INTERACTION)
        return model.fields is not None and model.data_kind == "difference" and wanted

    def _discs(self, seen: Explained, image: FloatArray) -> tuple[DiscFit, list[Disc]]:
        """Return discs from the peaks of ``image`` (n,), fitted to the data without their
        interaction, and these data."""
        fit = self.disc_fit(seen)
        starts = self.starts(fit, image)
        if self.options.touch_sweeps == 0:
            return fit, fit.with_strengths(starts)
        discs = fit.fitted(starts)
        for _ in range(ROUNDS if self._interact and len(discs) > 1 else 0):
            added = self.reduced(seen, interaction(self.model, discs))
            much = added @ added > INTERACTION_MAX * (seen.y @ seen.y)
            fit = replace(fit, y=seen.y if much else seen.y - added)
            discs = fit.improved(discs)
        return fit, discs

    def starts(self, fit: DiscFit, image: FloatArray) -> list[Disc]:
        """Return the discs with which a fit begins, at the peaks of ``image`` (n,)."""
        return fit.peaks(image)

    def reduced(self, seen: Explained, d: FloatArray) -> FloatArray:
        """Folded data ``d`` (k,) as this frame's are whitened and projected (r,)."""
        return np.asarray(seen.project @ (seen.whitening.data @ d))

    def _touches(
        self, seen: Explained, fit: DiscFit, discs: list[Disc], ref: Reference
    ) -> tuple[Touch, ...]:
        """Strongest first, numbered from 1."""
        model, out = self.model, []
        explained = fit.explained(discs, float(seen.y @ seen.y))
        for disc, share in zip(discs, explained, strict=True):
            x, y = on_skin(model.grid, disc.x_mm, disc.y_mm)
            if model.model_errors is not None and self.options.row_gains and not ref.far:
                x, y = corrected(model, ref.log_gain, np.array([x, y])).tolist()
                x, y = on_skin(model.grid, x, y)
            strength = disc.change * area_mm2(model, disc)
            touch = Touch(0, x, y, disc.radius_mm, strength, min(1.0, float(share)))
            if model.force_law is not None:
                force = model.force_law.forces_at(np.array([[x, y]]), np.array([strength]))
                touch = replace(touch, force_n=float(force[0]))
            out.append(touch)
        out.sort(key=lambda touch: -abs(touch.strength_s_per_m_mm2))
        return tuple(replace(touch, id=k) for k, touch in enumerate(out, start=1))
