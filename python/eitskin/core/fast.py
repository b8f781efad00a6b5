"""The C core's fast path: touches after each drive of a scan (csrc/include/eitskin/fast.h)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray, IntArray
from eitskin.core.diagnostics_table import Touch
from eitskin.core.engine import CoreEngine, aligned
from eitskin.core.results import Info
from eitskin.errors import FrameError, UsageError


@dataclass(frozen=True)
class FastTouch:
    """A touch as of the middle of the last drive: mm, mm/s, S/m mm^2; ``id`` as long as it is
    followed, ``confirmed`` once a whole frame has shown it."""

    id: int
    x_mm: float
    y_mm: float
    vx_mm_per_s: float
    vy_mm_per_s: float
    strength_s_per_m_mm2: float
    confirmed: bool


@dataclass(frozen=True, eq=False)
class AlignedFrame:
    """A frame (m,) in V as if all its rows had been measured with its last drive; whether every
    drive of it is accounted for; and whether what the whole-frame solver says of it may be told."""

    volts: AnyArray
    explained: bool
    trusted: bool


class FastCore:
    """The fast path beside a core ``engine``, whose reference and options it takes."""

    def __init__(self, engine: CoreEngine) -> None:
        self._engine, (self._lib, self._ffi, model, context) = engine, engine.handles
        self.bytes = int(self._lib.eits_fast_size(model))
        if not self.bytes:
            raise UsageError(
                "fast path: the model has no fields (section FLDS), or a drive over"
                f" {self._lib.EITS_FAST_ROWS} rows; build it again, of difference data"
            )
        self._memory = aligned(self.bytes)
        state = self._ffi.new("eits_fast **")
        memory = self._ffi.from_buffer(self._memory)
        self._check(self._lib.eits_fast_init(memory, self.bytes, context, state))
        self._state = state[0]
        self._touches = self._ffi.new("eits_fast_touch[]", int(self._lib.EITS_FAST_TOUCHES))
        self._number = self._ffi.new("uint32_t *")
        self.rows = [self._rows_of(k) for k in range(self._lib.eits_fast_drives(self._state))]

    def _check(self, status: int) -> None:
        if status:
            text = self._ffi.string(self._lib.eits_status_text(status)).decode()
            raise FrameError(f"fast path: {text} (C core, status {int(status)})")

    def _rows_of(self, drive: int) -> IntArray:
        first = self._lib.eits_fast_rows(self._state, drive, self._number)
        return np.array(self._ffi.unpack(first, self._number[0]), dtype=np.int64)

    def begin(self) -> None:
        """Begin without touches, with the engine's reference.

        Raises:
            FrameError: it has none, or one without noise: of fewer than four frames.
        """
        self._check(self._lib.eits_fast_begin(self._state))

    def drive(self, number: int, volts: npt.ArrayLike, time_s: float) -> list[FastTouch]:
        """The rows ``self.rows[number]`` (r,) in V, nan where there is none, measured about
        ``time_s``; returns what touches the skin.

        Raises:
            FrameError: another number of rows, no such drive, or no reference.
        """
        given = np.ascontiguousarray(volts, dtype=self._engine.dtype)
        pointer = self._ffi.from_buffer("eits_real[]", given)
        time_us = round(1e6 * time_s) & 0xFFFFFFFF
        self._check(self._lib.eits_fast_drive(self._state, number, pointer, given.size, time_us))
        return self.touches()

    def touches(self) -> list[FastTouch]:
        """What touches the skin, as of the last drive."""
        room = len(self._touches)
        self._check(self._lib.eits_fast_touches(self._state, self._touches, room, self._number))
        return [
            FastTouch(
                int(one.id), one.x_mm, one.y_mm, one.vx_mm_per_s, one.vy_mm_per_s,
                one.strength_s_per_m_mm2, bool(one.confirmed),
            )
            for one in self._touches[0 : self._number[0]]
        ]  # fmt: skip

    def aligned(self, volts: npt.ArrayLike) -> AlignedFrame:
        """The last scan's rows (m,) in V, brought to the instant of its last drive; once a frame.

        Raises:
            FrameError: another number of rows, or no reference.
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

    def confirm(self, found: Sequence[Touch]) -> list[FastTouch]:
        """What the engine found in the last aligned frame; rows of electrodes that it named are
        left out.

        Raises:
            FrameError: more touches than the core gives.
        """
        names = ("x_mm", "y_mm", "strength_s_per_m_mm2")
        given = self._ffi.new(
            "eits_touch[]", [{name: getattr(one, name) for name in names} for one in found] or 1
        )
        self._check(self._lib.eits_fast_confirm(self._state, given, len(found)))
        return self.touches()

    def named(self, found: Info) -> Info:
        """What may be reported of the diagnostics ``found`` in the last aligned frame: where
        touches changed in its scan, only what the two solved frames before had. Once a solved
        frame.
        """
        names = "open_electrodes", "bridged_electrodes", "noisy_electrodes"
        given = {name: sum(1 << one for one in getattr(found, name)) for name in names}
        info = self._ffi.new("eits_info *", {"diagnostics": found.diagnostics, **given})
        self._check(self._lib.eits_fast_name(self._state, info))
        kept: dict[str, Any] = {
            name: getattr(found, name) if getattr(info, name) else () for name in names
        }
        return replace(found, diagnostics=int(info.diagnostics), **kept)
