"""The cost of a method on this computer: time for one frame, and bytes that it keeps."""

from dataclasses import dataclass
from time import perf_counter
from typing import Protocol, runtime_checkable

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_studies.compare.families import FindsTouches, Method
from eitskin_studies.datasets.exchange import ReturnedImages

TIMED_FRAMES = 20


@runtime_checkable
class SaysWhatItKeeps(Protocol):
    """A method that states the bytes that it keeps from frame to frame."""

    @property
    def kept_bytes(self) -> int:
        """Bytes of matrices, models and workspaces."""


@dataclass(frozen=True)
class Cost:
    """The median time in ms of one frame alone, through Python, and kB kept from frame to frame;
    NaN for a method that another program has run."""

    frame_ms: float
    kept_kb: float


def cost(method: Method, dv: FloatArray) -> Cost:
    """Measure ``method`` on the first of the difference frames (k, m), one at a time, as they come
    live: from voltages to the image, or to touches where the method finds them itself."""
    if isinstance(method, ReturnedImages):
        return Cost(np.nan, np.nan)
    solve = method.touches if isinstance(method, FindsTouches) else method.reconstruct
    times_s = []
    solve(dv[:1].copy())
    for frame in dv[:TIMED_FRAMES]:
        one = frame[None].copy()
        start = perf_counter()
        solve(one)
        times_s.append(perf_counter() - start)
    return Cost(1e3 * float(np.median(times_s)), kept_bytes(method) / 1e3)


def kept_bytes(method: Method) -> int:
    """Return the bytes that the method reports to keep, or else the bytes of its arrays."""
    if isinstance(method, SaysWhatItKeeps):
        return method.kept_bytes
    return sum(one.nbytes for one in vars(method).values() if isinstance(one, np.ndarray))
