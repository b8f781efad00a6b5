"""The C core through cffi, in either width: the same code that runs on the microcontroller, on the
host."""

import importlib
import struct
import threading
from collections.abc import Sequence
from dataclasses import asdict, fields
from time import perf_counter_ns
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, BoolArray, FloatArray
from eitskin.core.diagnostics import with_diagnostics
from eitskin.core.diagnostics_table import SHOWN, STOPS, InfoFields, Touch
from eitskin.core.options_table import CHOICES
from eitskin.core.results import (
    TAKE_REFERENCE,
    Info,
    LearnedReference,
    Options,
    Reconstruction,
    check_reference_frames,
    check_shape,
    known_touch,
)
from eitskin.errors import EitskinError, FrameError, ModelError, UsageError
from eitskin.threads import one_at_a_time, refuse_copy

WIDTHS = {"float32": "_core_f32", "float64": "_core_f64"}


def load_core(width: str) -> Any:
    """Return the compiled module of ``width`` ("float32" or "float64").

    Raises:
        UsageError: the core is not built.
    """
    try:
        return importlib.import_module(f"eitskin.core.{WIDTHS[width]}")
    except ImportError as error:
        raise UsageError(
            f"the C core is not built ({error}); install with  pip install .  in the project's root"
        ) from None


def aligned(size: int) -> npt.NDArray[np.uint8]:
    """Return ``size`` zeroed bytes that start at a 64-byte boundary."""
    whole = np.zeros(size + 64, dtype=np.uint8)
    start = -whole.ctypes.data % 64
    return whole[start : start + size]


class CoreEngine:
    """One context of the C core. ``prepared`` keeps a second copy of S in panels (faster, same
    bits); ``portable`` disables processor-specific kernels (slower, same bits).

    C allows one thread at a time in a context, so each method holds ``lock``. Whoever needs several
    calls in a row without another thread between them holds it, too.

    Raises:
    ModelError: the core rejects the model.
    UsageError: the core is not built.
    """

    def __init__(
        self, blob: bytes, width: str = "float32", *, prepared: bool = True, portable: bool = False
    ) -> None:
        module = load_core(width)
        self.lock = threading.RLock()
        self._lib, self._ffi = module.lib, module.ffi
        self.dtype = np.dtype(np.float32 if width == "float32" else np.float64)
        self._blob = aligned(len(blob))
        self._blob[:] = np.frombuffer(blob, dtype=np.uint8)
        self._model = self._ffi.new("eits_model *")
        self._check(
            self._lib.eits_model_open(self._model, self._ffi.from_buffer(self._blob), len(blob)),
            "model",
            ModelError,
        )
        self.workspace_bytes = int(self._lib.eits_workspace_size(self._model, int(prepared)))
        self._workspace = aligned(self.workspace_bytes)
        context = self._ffi.new("eits_context **")
        status = self._lib.eits_init(
            self._ffi.from_buffer(self._workspace), self.workspace_bytes, self._model, context
        )
        if status == self._lib.EITS_E_MODEL_VALUE:
            self._check(status, "model", ModelError)
        self._check(status, "workspace", UsageError)
        self._context = context[0]
        self._lib.eits_use_portable_kernels(self._context, int(portable))
        self.n_rows, self.n_pixels = int(self._model.n_rows), int(self._model.n_pixels)
        # Buffers and their pointers are made once: a cast in each call would take longer than the
        # call itself.
        self._frame = np.zeros(self.n_rows, dtype=self.dtype)
        self._frame_pointer = self._ffi.from_buffer("eits_real[]", self._frame)
        self._image = self._view(self._lib.eits_get_image(self._context), self.n_pixels)
        self._info = self._lib.eits_get_info(self._context)
        self._touches = self._ffi.new("eits_touch[]", int(self._lib.EITS_MAX_TOUCHES))
        self._touch_count = self._ffi.new("uint32_t *")
        self._null = self._ffi.NULL
        self._masked, self._saturation_v = np.zeros(self.n_rows, dtype=np.bool_), 0.0

    @property
    def kernels(self) -> str:
        """The name of the matrix kernels in use."""
        return str(self._ffi.string(self._lib.eits_kernels_name(self._context)).decode())

    @property
    def handles(self) -> tuple[Any, Any, Any, Any]:
        """The C functions, cffi's object for them, the eits_model and the eits_context, for other
        code that works on this context; it holds ``lock`` meanwhile."""
        return self._lib, self._ffi, self._model, self._context

    def __reduce__(self) -> NoReturn:
        refuse_copy(
            "a context of the C core",
            "pickle the Reconstructor, or make a context of the model's bytes",
        )

    def _view(self, pointer: Any, count: int) -> AnyArray:
        """Return an array over ``count`` reals in the context's memory, without a copy."""
        return np.frombuffer(
            self._ffi.buffer(pointer, count * self.dtype.itemsize), dtype=self.dtype
        )

    def _check(self, status: int, what: str, kind: type[EitskinError]) -> None:
        if status != 0:
            raise kind(f"{what}: {self._status_text(status)}")

    def _status_text(self, status: int) -> str:
        text = self._ffi.string(self._lib.eits_status_text(status)).decode()
        if status == self._lib.EITS_E_NO_REFERENCE:
            return f"{text}; {TAKE_REFERENCE}"
        return f"{text} (C core, status {int(status)})"

    @one_at_a_time
    def set_options(self, options: Options) -> None:
        """Set all options of the core.

        Raises:
            UsageError: an option has a wrong type or is out of range.
        """
        values = asdict(options)
        try:
            values |= {name: known[values[name]] for name, known in CHOICES.items()}
            given = self._ffi.new(
                "eits_options *", {name: _plain(value) for name, value in values.items()}
            )
        except (KeyError, TypeError, OverflowError) as error:
            raise UsageError(f"options: {error}") from None
        self._check(self._lib.eits_set_options(self._context, given), "options", UsageError)
        self._saturation_v = float(options.saturation_v)

    @one_at_a_time
    def set_reference(self, frames: FloatArray) -> LearnedReference:
        """Take the reference from untouched ``frames`` (k, m) in V. Four frames or more also give
        the noise; fewer are averaged.

        Raises:
            FrameError: a frame cannot be used.
        """
        check_reference_frames(frames, self._masked, self._saturation_v)
        if len(frames) < 4:
            self._frame[:] = frames.mean(axis=0)
            self._check_frame(
                self._lib.eits_reference_set(self._context, self._frame_pointer, self.n_rows),
                "reference frame",
            )
        else:
            self._check_frame(
                self._lib.eits_reference_begin(self._context, len(frames)), "reference frames"
            )
            for number, frame in enumerate(frames):
                self._frame[:] = frame
                status = self._lib.eits_reference_add(
                    self._context, self._frame_pointer, self.n_rows
                )
                self._check_frame(status, f"reference frame {number} (from 0)")
            self._check_frame(self._lib.eits_reference_finish(self._context), "reference frames")
        b = self._ffi.new("eits_reference_info *")
        self._check(self._lib.eits_get_reference(self._context, b), "reference", UsageError)
        return LearnedReference(
            int(b.count),
            b.correlation,
            b.gain,
            b.v0_rms,
            b.noise_v,
            b.lambda_noise,
            int(b.outliers),
        )

    @one_at_a_time
    def mask_rows(self, rows: BoolArray) -> None:
        """Leave the rows of the protocol where ``rows`` (m,) is true out of every frame."""
        self._masked = rows.copy()
        for row in range(self.n_rows):
            self._check(
                self._lib.eits_mask_row(self._context, row, int(rows[row])), "mask", UsageError
            )

    @one_at_a_time
    def forget(self) -> None:
        """Forget the coefficients for the warm start."""
        self._lib.eits_forget(self._context)

    def _check_frame(self, status: int, what: str) -> None:
        if status != 0:
            self._check(status, what, FrameError)

    @one_at_a_time
    def solve_frame(self, frame: npt.NDArray[np.floating[Any]]) -> int:
        """Run only the frame stage and the solver, leave the results in the core, and return the
        status. Benchmarks use it."""
        self._frame[:] = frame
        return int(
            self._lib.eits_reconstruct(
                self._context, self._frame_pointer, self.n_rows, self._null, self._null
            )
        )

    @one_at_a_time
    def coefficients(self) -> AnyArray:
        """Return x of the last solve, (n,)."""
        return self._view(self._lib.eits_get_coefficients(self._context), self.n_pixels).copy()

    @one_at_a_time
    def reduced_data(self) -> AnyArray:
        """Return y of the last frame as the solver used it, after projection, (stride,)."""
        stride = (int(self._model.rank) + 7) // 8 * 8
        return self._view(self._lib.eits_get_reduced_data(self._context), stride).copy()

    @one_at_a_time
    def reconstruct(
        self, frame: npt.NDArray[np.floating[Any]], *, touches: bool = True
    ) -> Reconstruction:
        """Reconstruct image and touches from one ``frame`` (m,) in V.

        Raises:
            FrameError: the frame has another length, or the core rejects it.
        """
        if frame.shape != (self.n_rows,):
            raise FrameError(
                f"frame: has shape {frame.shape}, but the model's protocol has {self.n_rows} rows"
            )
        began_ns = perf_counter_ns()
        status = self.solve_frame(frame)
        if status != 0:
            raise FrameError(
                with_diagnostics(f"frame: {self._status_text(status)}", self.last_info())
            )
        solved_ns = found_ns = perf_counter_ns()
        found: tuple[Touch, ...] = ()
        if touches:
            self._lib.eits_find_touches(
                self._context, self._touches, len(self._touches), self._touch_count
            )
            found_ns = perf_counter_ns()
            found = tuple(touch_of(self._touches[k]) for k in range(self._touch_count[0]))
        coefficients = self.coefficients()
        info = _info(self._info, solved_ns - began_ns, found_ns - solved_ns)
        drawn = self._drawn(self._touches, len(found), info)
        return Reconstruction(self._image.copy(), coefficients, found, info, touch_image=drawn)

    def _drawn(self, touches: Any, count: int, info: Info) -> AnyArray | None:
        """Return the image of ``count`` touches (n,) if it shows the frame, else None."""
        if info.shown != "touches":
            return None
        image = np.empty(self.n_pixels, dtype=self.dtype)
        self._lib.eits_draw_touches(self._model, touches, count, self._reals(image))
        return image

    @one_at_a_time
    def follow(self, frames: npt.NDArray[np.floating[Any]]) -> None:
        """Bring the frame stage to the state after ``frames`` (k, m) in V, so that the next frame
        costs as much as it does there. Only the last usable frame counts: the directions to ignore
        are built again if other rows are usable than in the frame before."""
        masked, macs = self._ffi.new("uint32_t *"), self._ffi.new("uint64_t *")
        for frame in frames[::-1]:
            self._frame[:] = frame
            status = self._lib.eits_frame_stage(
                self._context, self._frame_pointer, self.n_rows, masked, macs
            )
            if status in (self._lib.EITS_OK, self._lib.EITS_E_NOT_FINITE):
                return

    @one_at_a_time
    def reconstruct_block(
        self, frames: npt.NDArray[np.floating[Any]], *, touches: bool = True
    ) -> list[Reconstruction | FrameError]:
        """Reconstruct ``frames`` (k, m) in V, each as after :meth:`forget`, in one call of C, which
        runs without Python's lock. For a frame that cannot be used the list holds its error; the
        others are reconstructed."""
        check_shape(frames, self.n_rows, "frames")
        count = len(frames)
        given = np.ascontiguousarray(frames, dtype=self.dtype)
        images, coefficients = (
            np.empty((count, self.n_pixels), dtype=self.dtype) for _ in range(2)
        )
        results = self._ffi.new("eits_result[]", max(count, 1))
        room = int(self._lib.EITS_MAX_TOUCHES)
        found = self._ffi.new("eits_touch[]", max(count, 1) * room) if touches else self._null
        status = self._lib.eits_reconstruct_batch(
            self._context,
            self._reals(given),
            self.n_rows,
            count,
            self._reals(images),
            self._reals(coefficients),
            found,
            results,
        )
        self._check(status, "batch", UsageError)
        done: list[Reconstruction | FrameError] = []
        for k in range(count):
            r = results[k]
            if r.status != 0:
                done.append(
                    FrameError(
                        with_diagnostics(f"frame: {self._status_text(r.status)}", _info(r.info))
                    )
                )
                continue
            each = tuple(touch_of(found[room * k + i]) for i in range(r.count))
            info = _info(r.info)
            drawn = self._drawn(found + room * k, r.count, info) if touches else None
            done.append(Reconstruction(images[k], coefficients[k], each, info, touch_image=drawn))
        return done

    def _reals(self, array: AnyArray) -> Any:
        return self._ffi.from_buffer("eits_real[]", array)

    @one_at_a_time
    def last_info(self) -> Info:
        """Return the info of the last frame, whichever method ran it."""
        return _info(self._info)

    @one_at_a_time
    def self_test(self) -> float:
        """Run the model's golden frame; return the greatest difference from its image, relative to
        the peak.

        Raises:
            FrameError: the golden frame cannot be run, or its image is right but a checksum of the
                set of frames is not.
        """
        difference = self._ffi.new("eits_real *")
        self._check_frame(self._lib.eits_self_test(self._context, difference), "golden frame")
        return float(difference[0])

    @one_at_a_time
    def self_test_sums(self) -> bytes:
        """Return section SUMS of this model: the core's revision, and a checksum of each frame of
        the set. The engine must be new and float32.

        Raises:
            FrameError: the golden reference cannot be used.
        """
        sums = self._ffi.new("uint32_t[]", self._lib.EITS_SELF_TEST_SUMS)
        self._check_frame(self._lib.eits_self_test_sums(self._context, sums), "golden frame")
        return struct.pack(f"<I{len(sums)}I", self._lib.EITS_SELF_TEST_REVISION, *sums)


def _plain(value: Any) -> Any:
    return int(value) if isinstance(value, bool) else value


_INFO_NAMES = tuple(one.name for one in fields(InfoFields))
_ELECTRODE_NAMES = ("open_electrodes", "bridged_electrodes", "noisy_electrodes")
_TOUCH_NAMES = tuple(one.name for one in fields(Touch))


def _info(i: Any, solve_ns: int = 0, touch_ns: int = 0) -> Info:
    values = {name: getattr(i, name.rstrip("_")) for name in _INFO_NAMES}
    values["stop"], values["shown"] = STOPS[i.stop], SHOWN[i.shown]
    values |= {name: _bits(values[name]) for name in _ELECTRODE_NAMES}
    return Info(**values, solve_us=solve_ns / 1000, touch_us=touch_ns / 1000)


def _bits(word: int) -> tuple[int, ...]:
    return tuple(bit for bit in range(64) if word >> bit & 1) if word else ()


def touch_of(t: Any) -> Touch:
    return known_touch([getattr(t, name) for name in _TOUCH_NAMES])


def c_touches(touches: Sequence[Touch]) -> list[dict[str, Any]]:
    """Return ``touches`` as eits_touch takes them: 0 if something is not known."""
    return [{name: getattr(one, name) or 0 for name in _TOUCH_NAMES} for one in touches]
