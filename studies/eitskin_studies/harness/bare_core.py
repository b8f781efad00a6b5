"""Calls of the C core with nothing of Python around them, for clocks."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.arrays import AnyArray
from eitskin.core.engine import CoreEngine


def bare_calls(
    engine: CoreEngine, frame: npt.NDArray[np.floating[Any]]
) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """The two C calls for ``frame``, solve and touches, with nothing of Python around them."""
    engine._frame[:] = frame
    lib, context, null = engine._lib, engine._context, engine._null
    return (
        lambda: lib.eits_reconstruct(context, engine._frame_pointer, engine.n_rows, null, null),
        lambda: lib.eits_find_touches(
            context, engine._touches, len(engine._touches), engine._touch_count
        ),
    )


def bare_solve(engine: CoreEngine, y: npt.NDArray[np.floating[Any]]) -> Callable[[], Any]:
    """The solver's C call alone on reduced data ``y`` (r,), which it takes now; the result is
    in ``engine.coefficients()``."""
    lib, context = engine._lib, engine._context
    pointer = engine._reals(np.array(y, dtype=engine.dtype))
    return lambda: lib.eits_solve(context, pointer)


def bare_solves(engine: CoreEngine, many: npt.NDArray[np.floating[Any]]) -> AnyArray:
    """``bare_solve`` of each of ``many`` (k, r), one after another: their x (k, n)."""
    x = np.empty((len(many), engine.n_pixels), dtype=engine.dtype)
    solve, context = engine._lib.eits_solve, engine._context
    for k, y in enumerate(np.ascontiguousarray(many, dtype=engine.dtype)):
        solve(context, engine._reals(y))
        x[k] = engine._view(engine._lib.eits_get_coefficients(context), engine.n_pixels)
    return x


def bare_block(engine: CoreEngine, frames: npt.NDArray[np.floating[Any]]) -> Callable[[], Any]:
    """The one C call of ``CoreEngine.reconstruct_block`` for ``frames`` (k, m)."""
    given, count = np.ascontiguousarray(frames, dtype=engine.dtype), len(frames)
    images, coefficients = (
        np.empty((count, engine.n_pixels), dtype=engine.dtype) for _ in range(2)
    )
    found = engine._ffi.new("eits_touch[]", count * int(engine._lib.EITS_MAX_TOUCHES))
    results = engine._ffi.new("eits_result[]", count)
    pointers = [engine._reals(array) for array in (given, images, coefficients)]
    return lambda: engine._lib.eits_reconstruct_batch(
        engine._context, pointers[0], engine.n_rows, count, pointers[1], pointers[2], found, results
    )
