"""The numpy reference: the same mathematics as the C core, in float64, written for reading; the
core is judged against it.

minimise |y - S x|^2 / 2 + lambda |x|_1 by FISTA (Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009)
183, doi 10.1137/080716542); ``exact`` has the other solvers, ``frame_stage`` what comes before.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter_ns

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.options_table import INTERACTION
from eitskin.core.results import Info, LearnedReference, Options, Reconstruction
from eitskin.errors import FrameError, UsageError
from eitskin.model.model import Model
from eitskin.model.storage import stride_for
from eitskin_reference.constants_table import ERROR_MIN_NOISE, ERROR_SHARE, MIN_SQUARE
from eitskin_reference.disc_fit import Disc, Reduced
from eitskin_reference.evidence import DataErrors
from eitskin_reference.exact import ActiveSet
from eitskin_reference.fista import fista
from eitskin_reference.follow import Follower, gain_beside
from eitskin_reference.frame_stage import FrameStage
from eitskin_reference.interaction import interplay, turned_dipoles
from eitskin_reference.problem import (
    Certificate,
    Problem,
    SolveResult,
    greatest,
    project,
)
from eitskin_reference.touches import brought_onto_skin, find_touches
from eitskin_reference.tracker import Tracker

SOLVED = ("iterations", "gap", "optimum")


class ReferenceEngine(FrameStage):
    """The numpy engine: one model's frames to images and touches. Slow, and plain."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        self._warm: FloatArray | None = None
        self._tracker, self._follower = Tracker(model.grid), Follower(self.options.reference_frames)

    def set_options(self, options: Options) -> None:
        """Replace the options.

        Raises:
            UsageError: a limit of multiply-accumulates, which are not counted here.
        """
        if options.mac_limit:
            raise UsageError(
                "options: the numpy reference counts no multiply-accumulates; give no mac_limit, or"
                " use the C core"
            )
        if options.sign != self.options.sign:
            self._warm = None
        self._follower.frames = options.reference_frames
        super().set_options(options)

    def set_reference(self, frames: FloatArray) -> LearnedReference:
        """As :meth:`FrameStage.set_reference`."""
        learned = super().set_reference(frames)
        self._follower.begin()
        return learned

    def _fit_to_model(self, v0: FloatArray) -> float:
        correlation = super()._fit_to_model(v0)
        self._warm = None
        return correlation

    def forget(self) -> None:
        """Forget the warm start and the touches that were followed."""
        self._warm = None
        self._tracker.forget()
        self._follower.let_go()

    def reconstruct(self, frame: FloatArray, *, touches: bool = True) -> Reconstruction:
        """One frame (m,) volts to image and touches.

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
            y, basis, masked = self.frame_stage(np.asarray(frame, dtype=np.float64))
        except FrameError:
            self._warm = None
            self._follower.let_go()
            raise
        o, norm = self.options, float(np.linalg.norm(y))
        lambda_noise = self._lambda_noise * self._noise_ratio
        correlation = self.seen.T @ y
        self._examiner.stale(correlation, o.sign, greatest(correlation, o.sign), lambda_noise)
        self._examiner.unlike(far=self._far)
        result, lam, lambda_max = self._solve(
            y, basis, lambda_noise, self._warm if o.warm_start else None
        )
        self._warm = result.x if result.stop in SOLVED else None
        assert self._v0 is not None
        self._follower.add(frame, self._v0, self._unusable)
        image = self._image(result)
        found: tuple[Touch, ...] = ()
        solved_ns = perf_counter_ns()
        if touches:
            whole = float((self._p**2).sum()) * (
                1.0 if self._whitening is None else self._whitening.energy_ratio
            )
            noise = self._noise_energy / len(self.model.fold.first) * whole
            threshold = self._detection_threshold
            reduced = Reduced(y, self._straight, self.seen, basis, threshold, noise)
            added = partial(self._interplay, basis) if self._couples else None
            found, self._examiner.found.unexplained, coupled, doubtful = find_touches(
                self.model, reduced, image, o, added, self._data_errors(basis)
            )
            if self._is_drift(lambda_max, lambda_noise):
                found = ()
                self._examiner.found.names.add("stale reference")
            clearness = lambda_max / lambda_noise if lambda_noise > 0 else np.inf
            self._examiner.crowd(found, o, clearness, doubtful=doubtful)
            many = len(found) > 1
            next_id = self._tracker.next_id
            followed = self._tracker.step(found, o, lambda_max, lambda_noise)
            if self._tracker.next_id != next_id:
                self._follower.let_go()
            grid = self.model.grid
            found = self._loaded(tuple(brought_onto_skin(grid, one) for one in followed))
            if o.second_pass and many and added is not None and o.touch_sweeps > 0:
                first = result.iterations
                result, lam, lambda_max = self._solve(coupled, basis, lambda_noise, None)
                if result.stop in SOLVED:
                    norm = float(np.linalg.norm(coupled))
                else:
                    result, lam, lambda_max = self._solve(y, basis, lambda_noise, None)
                result = replace(result, iterations=first + result.iterations)
                self._warm, image = result.x if result.stop in SOLVED else None, self._image(result)
            self._follow(found, lambda_max, basis)
        gap = result.certificate.gap
        info = Info(
            result.iterations, result.stop, int(np.count_nonzero(result.x)), masked,
            result.step_halvings, len(found), 0, 0,
            lam, lambda_max, lambda_noise, gap, gap / max(0.5 * norm**2, 1e-300),
            result.certificate.residual, norm,
            **self._examiner.of_frame(), regularisation=self._regularisation,
            solve_us=(solved_ns - began_ns) / 1000, touch_us=(perf_counter_ns() - solved_ns) / 1000,
        )  # fmt: skip
        return Reconstruction(image, result.x, found, info)

    def _is_drift(self, lambda_max: float, lambda_noise: float) -> bool:
        """Whether the touches found are the skin's own change."""
        found = self._examiner.found
        threshold = self._detection_threshold if lambda_noise > 0 else None
        taught = self.model.precision is not None and "stale reference" in self._examiner.wanted
        return taught and self._follower.drifts(found.unexplained, lambda_max, threshold)

    def _follow(self, touches: tuple[Touch, ...], lambda_max: float, basis: FloatArray) -> None:
        """Let the reference go after the skin: all of it, or its size alone."""
        assert self._v0 is not None
        v0, of_use = self._v0, "model mismatch" not in self._examiner.found.names
        mean = self._follower.mean(self._tracker.count if of_use else None, v0)
        if mean is None:
            return
        if self._tracker.count == 0:
            moved = self._follower.moved(mean, v0, lambda_max, self._best_match(basis, mean))
        elif self.model.data_kind == "difference":
            columns = self._at(touches)
            y, u = self._whole(mean), self._whole(2 * v0)
            moved = self._follower.grown(v0, gain_beside(u, y, columns))
        else:
            return
        if moved is not None:
            self._fit_to_model(moved)

    def _at(self, touches: tuple[Touch, ...]) -> FloatArray:
        """What S gives at touches, linear between centres of pixels (r, k)."""
        grid, weight = self.model.grid, self.model.column_weight.astype(np.float64)
        at = np.array([(t.x_mm, t.y_mm) for t in touches]).reshape(-1, 2)
        away = grid.index[None] + 0.5 - ((at - grid.origin_mm) / grid.pixel_mm)[:, None]
        share = np.maximum(1 - np.abs(away), 0).prod(axis=2)
        return np.asarray(self.seen @ (share / np.where(weight != 0, weight, np.inf)).T)

    def _best_match(self, basis: FloatArray, frame: FloatArray) -> float:
        """How much of |y|^2 of ``frame`` (m,) the column of S gives that gives most."""
        y = project(self._whole(frame), basis)
        match = self.seen.T @ y
        best = int(np.abs(match).argmax())
        column = project(self.seen[:, best], basis)
        if not abs(match[best]) > self._lambda_noise_floor:
            return 0.0
        return float(match[best] ** 2 / ((y @ y) * (column @ column)))

    def _loaded(self, touches: tuple[Touch, ...]) -> tuple[Touch, ...]:
        """With their loads, where the model is calibrated."""
        if self.model.load is None:
            return touches
        places = np.array([(t.x_mm, t.y_mm) for t in touches]).reshape(-1, 2)
        loads = self.model.load.forces_at(
            places, np.array([t.strength_s_per_m_mm2 for t in touches])
        )
        return tuple(
            replace(t, force_n=float(load)) for t, load in zip(touches, loads, strict=True)
        )

    def _image(self, result: SolveResult) -> FloatArray:
        return np.asarray(result.x * self.model.column_weight.astype(np.float64))

    @property
    def _couples(self) -> bool:
        """Whether this model can tell what touches do to each other, and is asked to."""
        model = self.model
        return (
            model.fields is not None
            and model.data_kind == "difference"
            and bool(self.options.touch_fit & INTERACTION)
        )

    def _interplay(self, basis: FloatArray, discs: Sequence[Disc]) -> FloatArray:
        """What discs add to y (r,) by what they do to each other."""
        return self._of_known(basis, interplay(self.model, discs))

    def _dipoles(self, basis: FloatArray, disc: Disc) -> FloatArray:
        """What a disc adds to y as a dipole that turns (2, r)."""
        return np.array([self._of_known(basis, d) for d in turned_dipoles(self.model, disc)])

    def _data_errors(self, basis: FloatArray) -> DataErrors | None:
        """What the frame's data may be wrong by; None where touches are not to be tested."""
        model, folded = self.model, self._folded
        errors, rows = model.model_errors, model.row_form
        if errors is None or rows is None or not self.options.touch_test:
            return None
        if len(basis) > 1:
            return None
        along, square = self._along(folded), float(folded.d @ folded.d)
        if along is not None and along @ along > 0:
            square = max(0.0, square - float(folded.d @ along) ** 2 / float(along @ along))
        least = (ERROR_MIN_NOISE * self._gain * self._v0_rms) ** 2
        known = folded.first | folded.second
        noise = max(self._noise_energy / max(1, int(known.sum())), least)
        see, of_noise = np.eye(model.rank), np.diag(rows.energy.astype(float))
        if self._whitening is not None:
            see, reduced = self._whitening.see, self._whitening.data @ self._p[:, known]
            of_noise = see @ of_noise @ see.T if folded.whole else reduced @ reduced.T
        error = ERROR_SHARE * square * (see @ errors.error @ see.T) + noise * of_noise
        fields, room = model.fields, model.rank * stride_for(model.rank)
        tells = fields is not None and stride_for(fields.columns.shape[1]) <= room
        dipoles = (
            partial(self._dipoles, basis) if tells and model.data_kind == "difference" else None
        )
        drift = see @ errors.drift @ see.T
        return DataErrors(error, drift, dipoles, self._distance, self._corrected, int(self._far))

    def _solve(
        self, y: FloatArray, basis: FloatArray, lambda_noise: float, start: FloatArray | None
    ) -> tuple[SolveResult, float, float]:
        """The coefficients for ``y``, with lambda and lambda_max."""
        o, norm = self.options, float(np.linalg.norm(y))
        lambda_max = greatest(self.seen.T @ y, o.sign)
        lam = o.lambda_abs or max(o.lambda_rel * lambda_max, o.lambda_noise_factor * lambda_noise)
        nothing, zero = Certificate(0.0, 0.5 * norm**2, norm), np.zeros(self.model.grid.n_pixels)
        if norm > 0 and lambda_max < self._detection_threshold:
            return SolveResult(zero, 0, "below-threshold", nothing, 0), lam, lambda_max
        if not lambda_max > lam or norm**2 < MIN_SQUARE:
            return SolveResult(zero, 0, "zero", nothing, 0), lam, lambda_max
        result = self._run(Problem(self.seen, y, lam, o.sign, basis), start)
        if result.stop == "diverged":
            result = SolveResult(zero, result.iterations, "diverged", nothing, result.step_halvings)
        return result, lam, lambda_max

    def _run(self, problem: Problem, last: FloatArray | None) -> SolveResult:
        """The chosen solver, from the ``last`` coefficients or from zero."""
        start, o = self._start(problem, last), self.options
        if o.solver == "active-set":
            return ActiveSet(problem, o, self.model.grid, self.model.lipschitz).run(start)
        return fista(
            problem.s, problem.y, problem.lam, self.model.lipschitz, o, problem.basis, start
        )

    def _start(self, problem: Problem, last: FloatArray | None) -> FloatArray | None:
        """The ``last`` coefficients, unless zero is the better start."""
        if last is None:
            return None
        residual = problem.residual(last)
        worse = residual @ residual + 2 * problem.lam * np.abs(last).sum() >= problem.y @ problem.y
        return None if worse else last
