"""The same steps on the host's own kernels, on plain C, and on the emulated Cortex-M7: every bit
must be the same."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine
from eitskin.core.results import Info, Options, known_touch
from eitskin.errors import EitskinError
from eitskin.model.eitm import decode_model
from eitskin.model.options import default_options
from eitskin_emulator.core_on_qemu import EmulatedFrame, EmulatedRun, run_steps
from eitskin_emulator.core_steps import (
    Choose,
    Forget,
    Load,
    Mask,
    Play,
    Solve,
    Step,
    TareStep,
)
from printed_touches import bits, printed_touches

NUMBERS = ("lambda_", "lambda_max", "lambda_noise", "gap", "gap_rel", "residual", "data_norm")


@dataclass(frozen=True, eq=False)
class Outcome:
    """One frame as a host gave it: status 0 or the core's error, ``image`` (n,) S/m,
    ``coefficients`` (n,), touches and info; an error leaves an image of zeros."""

    status: int
    image: np.ndarray
    coefficients: np.ndarray
    touches: tuple[Touch, ...]
    info: Info

    def finite(self) -> bool:
        """Whether every number of the outcome is finite."""
        numbers = [getattr(self.info, name) for name in NUMBERS]
        for t in self.touches:
            numbers += [value for value in astuple(t) if value is not None]
        return bool(
            np.isfinite(self.image).all()
            and np.isfinite(self.coefficients).all()
            and np.isfinite(numbers).all()
        )


class Host(CoreEngine):
    """A context that keeps on after an error and gives its status."""

    def status_of(self, step: Choose | TareStep) -> int:
        """Return the C core's status for options or untouched frames."""
        if isinstance(step, Choose):
            try:
                self.set_options(step.options)
            except EitskinError as error:
                return int(str(error).split("status ")[1].rstrip(")"))
            return 0
        count, status = len(step.untouched_v), 0
        if count >= 4:
            status = self._lib.eits_reference_begin(self._context, count)
        for frame in step.untouched_v:
            if status == 0:
                self._frame[:] = frame
                take = self._lib.eits_reference_add if count >= 4 else self._lib.eits_reference_set
                status = take(self._context, self._frame_pointer, self.n_rows)
        if status == 0 and count >= 4:
            status = self._lib.eits_reference_finish(self._context)
        return int(status)

    def outcome(self, numbers: np.ndarray, reduced: bool = False) -> Outcome:
        """Return the outcome of one frame, or of one vector of reduced data."""
        if reduced:
            reduced_data = self._reals(np.array(numbers, dtype=self.dtype))
            status = int(self._lib.eits_solve(self._context, reduced_data))
        else:
            status = self.solve_frame(numbers)
        self._lib.eits_find_touches(
            self._context, self._touches, len(self._touches), self._touch_count
        )
        each = (self._touches[k] for k in range(self._touch_count[0]))
        found = tuple(known_touch([getattr(t, f.name) for f in fields(Touch)]) for t in each)
        return Outcome(status, self._image.copy(), self.coefficients(), found, self.last_info())


def as_float32(values: np.ndarray) -> np.ndarray:
    """Rounded to float32, without a word on what overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(values).astype(np.float32)


def on_host(
    steps: Sequence[Step], width: str = "float32", *, prepared: bool = True, portable: bool = False
) -> tuple[list[int], list[Outcome]]:
    """The statuses of models, options and tares, and the outcomes of frames; all rounded to float32
    first."""
    statuses: list[int] = []
    outcomes: list[Outcome] = []
    host: Host | None = None
    for step in steps:
        if isinstance(step, Load):
            host = Host(step.blob, width, prepared=prepared, portable=portable)
            statuses.append(0)
            continue
        assert host is not None, "the first step must be a model"
        if isinstance(step, TareStep):
            statuses.append(host.status_of(TareStep(as_float32(step.untouched_v))))
        elif isinstance(step, Choose):
            statuses.append(host.status_of(step))
        elif isinstance(step, Mask):
            host.mask_rows(step.rows)
        elif isinstance(step, Forget):
            host.forget()
        else:
            reduced = isinstance(step, Solve)
            numbers = as_float32(step.data if isinstance(step, Solve) else step.frames_v)
            with np.errstate(invalid="ignore", over="ignore"):
                outcomes += [host.outcome(each, reduced) for each in numbers]
    return statuses, outcomes


def as_printed(outcome: Outcome) -> tuple[object, ...]:
    """In the emulated program's words."""
    i = outcome.info
    of_electrodes = (i.open_electrodes, i.bridged_electrodes, i.noisy_electrodes)
    numbers = [
        *map(str, (i.nonzeros, i.masked, i.step_halvings)),
        *(bits(getattr(i, name)) for name in NUMBERS),
        *map(str, (i.diagnostics, i.saturated, i.outliers)),
        *map(bits, (i.model_mismatch, i.unexplained)),
        *(f"{sum(1 << e for e in each):016x}" for each in of_electrodes),
    ]
    image, info = zlib.crc32(outcome.image.tobytes()), ":".join(numbers)
    touches = printed_touches(outcome.touches)
    return outcome.status, i.stop, i.iterations, i.macs, i.touch_macs, image, info, touches


def _of_board(frame: EmulatedFrame) -> tuple[object, ...]:
    return (
        frame.status, frame.stop, frame.iterations, frame.solve_macs, frame.touch_macs,
        frame.image_crc, frame.info, frame.touches,
    )  # fmt: skip


class SameEverywhere:
    """Runs steps on all three and asserts that they agree; gives the host's outcomes, which are
    then the Cortex-M7's too."""

    width, real = "float32", np.float32

    def __init__(self, program: Path, new_folder: Callable[[], Path]) -> None:
        self.program, self.new_folder = program, new_folder

    def __call__(
        self,
        blob: bytes,
        untouched_v: np.ndarray,
        frames_v: np.ndarray,
        options: Options | None = None,
        masked: np.ndarray | None = None,
    ) -> list[Outcome]:
        """Return the outcomes of frames (k, m) after a tare on untouched frames (q, m), in V. The
        tare must succeed. ``options`` None: those of the model."""
        chosen = options or default_options(decode_model(blob, "model"))
        masks = [] if masked is None else [Mask(masked)]
        statuses, outcomes = self.steps(
            [Load(blob), Choose(chosen), *masks, TareStep(untouched_v), Play(frames_v)]
        )
        assert statuses == [0, 0, 0], statuses
        return outcomes

    def steps(self, steps: Sequence[Step]) -> tuple[list[int], list[Outcome]]:
        """Run steps, and return the statuses of models, options and tares, and the outcomes. Give
        many models per call, because each start of QEMU takes a second."""
        statuses, own = on_host(steps)
        for prepared, portable in ((False, False), (False, True)):
            others, plain = on_host(steps, prepared=prepared, portable=portable)
            assert others == statuses
            for k, (one, other) in enumerate(zip(own, plain, strict=True)):
                assert as_printed(other) == as_printed(one), k
                assert (other.coefficients == one.coefficients).all()
        board = self.board(steps)
        assert [status for _, status in board.statuses] == statuses
        for k, (one, emulated) in enumerate(zip(own, board.frames, strict=True)):
            assert _of_board(emulated) == as_printed(one), k
        return statuses, own

    def board(self, steps: Sequence[Step]) -> EmulatedRun:
        return run_steps(self.program, self.new_folder(), steps)
