"""Reconstruct many independent frames in threads. Each thread has its own context, and C runs
without Python's lock."""

import os
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from eitskin.arrays import BoolArray, FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.core.results import (
    LearnedReference,
    Options,
    Reconstruction,
    check_options,
    check_shape,
    frame_numbers,
)
from eitskin.errors import FrameError, UsageError
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.threads import OneReader, OneThreadAtATime

MAX_THREADS = 256
MAX_IN_BLOCK = 32
T = TypeVar("T")


def check_threads(threads: int | None) -> int:
    """Return ``threads``, or, if it is None, as many as this process may use.

    Raises:
        UsageError: the number is out of range.
    """
    if threads is None:
        known = hasattr(os, "sched_getaffinity")
        count = len(os.sched_getaffinity(0)) if known else os.cpu_count() or 1
        return min(count, MAX_THREADS)
    if not 1 <= threads <= MAX_THREADS:
        raise UsageError(f"{threads} threads is out of range; use 1 to {MAX_THREADS}")
    return threads


class Batch:
    """Contexts of the C core, one per thread, with the same model, options and reference.

    Each frame is reconstructed independently, as after :meth:`Reconstructor.forget`: bits and
    counts are the same for any number of threads, and ids number the touches of each frame.
    ``engine`` is "c" or "c64"; ``threads`` None uses all processors. While a thread goes through
    ``each``, other threads are refused: a batch uses the processors by itself. Pickled or copied,
    it keeps model, options, masked rows and reference.

    Raises:
        UsageError: the engine is unknown, an option or the number of threads is out of range, or
            the core is not built.
        ModelError: the core rejects the model.
    """

    def __init__(
        self,
        model: Model,
        *,
        threads: int | None = None,
        engine: str = "c",
        options: Options | None = None,
        blob: bytes | None = None,
    ) -> None:
        if engine not in ("c", "c64"):
            raise UsageError(f"batches: engine {engine!r} has no threads; use c or c64")
        self.threads = check_threads(threads)
        chosen = options or default_options(model)
        check_options(chosen)
        content = blob or encode_model(model)
        width = "float32" if engine == "c" else "float64"
        self._engines = [CoreEngine(content, width) for _ in range(self.threads)]
        self._on_each(lambda one: one.set_options(chosen))
        self._made_of = model, threads, engine, chosen, content
        self._masked: BoolArray | None = None
        self._untouched: FloatArray | None = None
        advice = "make a Batch per thread, or let that one finish"
        self._turn = OneReader("the results of this Batch", advice)
        # the last usable frame, if any
        self._last = np.zeros((0, self._engines[0].n_rows))

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (*self._made_of, self._masked, self._untouched)

    def _on_each(self, call: Callable[[CoreEngine], T]) -> T:
        first, *_ = [call(engine) for engine in self._engines]
        return first

    def tare(self, untouched_v: npt.ArrayLike) -> LearnedReference:
        """Take the reference from untouched frames (k, m) or one (m,), in V; four or more also give
        the noise.

        Raises:
            FrameError: a frame cannot be used.
            UsageError: another thread goes through ``each``.
        """
        self._turn.check()
        frames = np.atleast_2d(frame_numbers(untouched_v, "reference"))
        check_shape(frames, self._engines[0].n_rows, "reference", least=1)
        self._last = self._last[:0]
        learned = self._on_each(lambda one: one.set_reference(frames))
        self._untouched = frames.copy()
        return learned

    def mask_rows(self, rows: BoolArray) -> None:
        """Leave the rows of the protocol where ``rows`` (m,) is true out of every frame; call this
        before ``tare``. Raises a UsageError while another thread goes through ``each``."""
        self._turn.check()
        self._on_each(lambda one: one.mask_rows(rows))
        self._masked = rows.copy()

    def each(
        self, frames_v: npt.ArrayLike, *, touches: bool = True
    ) -> Iterator[Reconstruction | FrameError]:
        """Yield the results of frames (k, m) in V, in their order; for a frame that cannot be used,
        yield its error. Ids count up from 1.

        Raises:
            UsageError: another thread goes through ``each``.
        """
        advice = "read it in one thread"
        return OneThreadAtATime(self._each(frames_v, touches), "this batch", advice)

    def _each(
        self, frames_v: npt.ArrayLike, touches: bool
    ) -> Generator[Reconstruction | FrameError, None, None]:
        mine = object()
        self._turn.begin(mine)
        try:
            yield from self._numbered(mine, frames_v, touches)
        finally:
            self._turn.end(mine)

    def _numbered(
        self, mine: object, frames_v: npt.ArrayLike, touches: bool
    ) -> Iterator[Reconstruction | FrameError]:
        frames = frame_numbers(frames_v, "frames")
        check_shape(frames, self._engines[0].n_rows, "frames")
        size = max(1, min(MAX_IN_BLOCK, len(frames) // (4 * self.threads)))
        free: SimpleQueue[CoreEngine] = SimpleQueue()
        for engine in self._engines[1:]:
            free.put(engine)

        def run(start: int) -> list[Reconstruction | FrameError]:
            # the very first block uses the engine without earlier frames
            engine = free.get() if start > 0 else self._engines[0]
            try:
                with engine.lock:
                    before = frames[max(0, start - MAX_IN_BLOCK) : start]
                    engine.follow(np.vstack([self._last, before]))
                    return engine.reconstruct_block(frames[start : start + size], touches=touches)
            finally:
                free.put(engine)

        number, last = 0, self._last
        with ThreadPoolExecutor(self.threads) as pool:
            for results in pool.map(run, range(0, len(frames), size)):
                self._turn.go_on(mine)
                for result in results:
                    number += 1
                    if isinstance(result, FrameError):
                        yield result
                        continue
                    last = frames[number - 1 : number].copy()
                    yield result
        self._last = last


def _again(
    model: Model,
    threads: int | None,
    engine: str,
    options: Options,
    blob: bytes,
    masked: BoolArray | None,
    untouched: FloatArray | None,
) -> Batch:
    """The batch that was pickled."""
    made = Batch(model, threads=threads, engine=engine, options=options, blob=blob)
    if masked is not None:
        made.mask_rows(masked)
    if untouched is not None:
        made.tare(untouched)
    return made


def reconstruct_many(
    model: Model,
    frames_v: npt.ArrayLike,
    untouched_v: npt.ArrayLike,
    *,
    threads: int | None = None,
    options: Options | None = None,
    touches: bool = True,
) -> list[Reconstruction]:
    """Return images and touches of frames (k, m) in V after a tare on ``untouched_v`` (q, m) or
    (m,); see :class:`Batch`.

    Raises:
        FrameError: a frame cannot be used; the text has its number.
        UsageError, ModelError: as :class:`Batch`.
    """
    batch = Batch(model, threads=threads, options=options)
    batch.tare(untouched_v)
    found: list[Reconstruction] = []
    for number, result in enumerate(batch.each(frames_v, touches=touches)):
        if isinstance(result, FrameError):
            raise FrameError(f"frame {number} (from 0): {str(result).removeprefix('frame: ')}")
        found.append(result)
    return found
