"""The tracker of the C core: touches after each drive of a scan, and of whole frames
(csrc/include/eitskin/fast.h)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, IntArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine, aligned, c_touches, touch_of
from eitskin.core.results import Info, Reconstruction
from eitskin.errors import FrameError
from eitskin.threads import one_at_a_time, refuse_copy


@dataclass(frozen=True)
class FastTouch:
    """A touch at the middle of the last drive, in mm, mm/s and S/m mm^2. ``id`` stays the same
    while it is tracked; ``confirmed`` is set once a whole frame has shown it."""

    id: int
    x_mm: float
    y_mm: float
    vx_mm_per_s: float
    vy_mm_per_s: float
    strength_s_per_m_mm2: float
    confirmed: bool
    radius_mm: float
    x_variance_mm2: float
    xy_covariance_mm2: float
    y_variance_mm2: float


@dataclass(frozen=True, eq=False)
class AlignedFrame:
    """A frame (m,) in V as if all rows had been measured with its last drive. ``explained`` tells
    whether every drive of it is explained; ``trusted`` tells whether the results of the whole-frame
    solver for it may be reported."""

    volts: AnyArray
    explained: bool
    trusted: bool


class FastCore:
    """The tracker that works beside a core ``engine`` and uses its reference, its options and its
    lock. ``rows`` are those of each drive that it can take: none if the model has no fields, or a
    drive too many rows. It then follows touches from frame to frame."""

    def __init__(self, engine: CoreEngine) -> None:
        self._engine, self.lock = engine, engine.lock
        with self.lock:
            self._begin_beside(*engine.handles)

    def _begin_beside(self, lib: Any, ffi: Any, model: Any, context: Any) -> None:
        self._lib, self._ffi = lib, ffi
        self.bytes = int(self._lib.eits_fast_size(model))
        self._memory = aligned(self.bytes)
        state = self._ffi.new("eits_fast **")
        memory = self._ffi.from_buffer(self._memory)
        self._check(self._lib.eits_fast_init(memory, self.bytes, context, state))
        self._state = state[0]
        self._touches = self._ffi.new("eits_fast_touch[]", int(self._lib.EITS_FAST_TOUCHES))
        self._frame = self._ffi.new("eits_touch[]", int(self._lib.EITS_MAX_TOUCHES))
        self._number = self._ffi.new("uint32_t *")
        self.rows = [self._rows_of(k) for k in range(self._lib.eits_fast_drives(self._state))]

    def __reduce__(self) -> NoReturn:
        refuse_copy("a fast path", "make one beside the other engine")

    def _check(self, status: int) -> None:
        if status:
            text = self._ffi.string(self._lib.eits_status_text(status)).decode()
            raise FrameError(f"fast path: {text} (C core, status {int(status)})")

    def _rows_of(self, drive: int) -> IntArray:
        first = self._lib.eits_fast_rows(self._state, drive, self._number)
        return np.array(self._ffi.unpack(first, self._number[0]), dtype=np.int64)

    @one_at_a_time
    def begin(self) -> None:
        """Start without touches, with the engine's reference.

        Raises:
            FrameError: there is no reference, or it has no noise because it was taken from fewer
                than four frames.
        """
        self._check(self._lib.eits_fast_begin(self._state))

    @one_at_a_time
    def drive(self, number: int, volts: npt.ArrayLike, time_s: float) -> list[FastTouch]:
        """Process the rows ``self.rows[number]`` (r,) in V, nan if there is no value, measured at
        about ``time_s``; return the touches.

        Raises:
            FrameError: the number of rows is wrong, there is no such drive, or no reference.
        """
        given = np.ascontiguousarray(volts, dtype=self._engine.dtype)
        pointer = self._ffi.from_buffer("eits_real[]", given)
        time_us = round(1e6 * time_s) & 0xFFFFFFFF
        self._check(self._lib.eits_fast_drive(self._state, number, pointer, given.size, time_us))
        return self.touches()

    @one_at_a_time
    def touches(self) -> list[FastTouch]:
        """Return the touches as of the last drive."""
        capacity = len(self._touches)
        self._check(self._lib.eits_fast_touches(self._state, self._touches, capacity, self._number))
        return [
            FastTouch(
                int(one.id), one.x_mm, one.y_mm, one.vx_mm_per_s, one.vy_mm_per_s,
                one.strength_s_per_m_mm2, bool(one.confirmed), one.radius_mm,
                one.x_variance_mm2, one.xy_covariance_mm2, one.y_variance_mm2,
            )
            for one in self._touches[0 : self._number[0]]
        ]  # fmt: skip

    @one_at_a_time
    def aligned(self, volts: npt.ArrayLike) -> AlignedFrame:
        """Return the rows (m,) in V of the last scan, corrected to the instant of its last drive.
        Call this once per frame.

        Raises:
            FrameError: the number of rows is wrong, or there is no reference.
        """
        given = np.array(volts, dtype=self._engine.dtype)
        pointer = self._ffi.from_buffer("eits_real[]", given)
        self._check(
            self._lib.eits_fast_align(self._state, pointer, given.size, pointer, self._number)
        )
        state = self._number[0]
        return AlignedFrame(
            given,
            bool(state & self._lib.EITS_FAST_EXPLAINED),
            bool(state & self._lib.EITS_FAST_TRUSTED),
        )

    @one_at_a_time
    def confirm(self, found: Sequence[Touch]) -> list[FastTouch]:
        """Pass on the touches that the engine found in the last aligned frame; return the touches.
        Rows of electrodes that the engine named faulty are left out.

        Raises:
            FrameError: there are more touches than the core can report.
        """
        given = self._ffi.new("eits_touch[]", c_touches(found) or 1)
        self._check(self._lib.eits_fast_confirm(self._state, given, len(found)))
        return self.touches()

    @one_at_a_time
    def report(self, found: Sequence[Touch] | None) -> tuple[Touch, ...]:
        """Return the touches of a frame, the strongest first. ``found`` are those that the engine
        found in it, None if it was not solved. After :meth:`aligned` the result is the touches that
        drives followed at that time, with the engine's results for them; otherwise it is the
        touches that the engine found, with ids that follow them from frame to frame. Call this once
        per frame.

        Raises:
            FrameError: there are more touches than the core can report.
        """
        null = self._ffi.NULL
        given = null if found is None else self._ffi.new("eits_touch[]", c_touches(found) or 1)
        count = 0 if found is None else len(found)
        self._check(
            self._lib.eits_fast_report(self._state, given, count, self._frame, self._number)
        )
        return tuple(touch_of(self._frame[k]) for k in range(self._number[0]))

    def followed(self, result: Reconstruction) -> Reconstruction:
        """Return ``result`` of a frame with the touches that :meth:`report` gives of its own. The
        image of the touches shows the frame only if all that were found are among them."""
        touches = self.report(result.touches)
        info, image = replace(result.info, touches=len(touches)), result.touch_image
        if sum(touch.explained > 0 for touch in touches) < len(result.touches):
            info, image = replace(info, shown="solver"), None
        return replace(result, touches=touches, info=info, touch_image=image)

    @one_at_a_time
    def forget(self) -> None:
        """Forget all touches; ids count on. Drives are refused until :meth:`begin`."""
        self._lib.eits_fast_forget_all(self._state)

    @one_at_a_time
    def named(self, found: Info) -> Info:
        """Return ``found`` with the diagnostics of the last aligned frame that may be reported: if
        touches changed during its scan, only those that the two solved frames before also had. Call
        this once per solved frame."""
        names = "open_electrodes", "bridged_electrodes", "noisy_electrodes"
        given = {name: sum(1 << one for one in getattr(found, name)) for name in names}
        info = self._ffi.new("eits_info *", {"diagnostics": found.diagnostics, **given})
        self._check(self._lib.eits_fast_name(self._state, info))
        kept: dict[str, Any] = {
            name: getattr(found, name) if getattr(info, name) else () for name in names
        }
        return replace(found, diagnostics=int(info.diagnostics), **kept)
