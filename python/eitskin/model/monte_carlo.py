"""Random skins (model.random_skins) drawn on every core: the model errors of a model.

Each process is this module run by itself, so that any script may build a model; they use one thread
each, and sums are taken in the order of the samples. The number of processes changes no bit.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Any

import numpy as np
import numpy.typing as npt

import eitskin
from eitskin.errors import ModelError
from eitskin.model.model_errors import ModelErrors, as_covariance
from eitskin.model.random_skins import RandomSkins, Request

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[Iterable[Any], int], Iterable[Any]]

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
DRIFT = -1


def draw_model_errors(
    request: Request, *, jobs: int | None = None, progress: Progress | None = None
) -> ModelErrors:
    """The model errors of ``request``, drawn by ``jobs`` processes (None: one a core).

    ``progress`` wraps the samples as they are done, and is told how many there are.

    Raises:
        ModelError: a process failed.
    """
    samples = request.uncertainty.samples
    count = max(1, min(jobs or os.cpu_count() or 1, samples))
    idle: SimpleQueue[_Process] = SimpleQueue()

    def ask(number: int) -> FloatArray:
        process = idle.get()
        try:
            return process.ask(number)
        finally:
            idle.put(process)

    processes: list[_Process] = []
    pool = ThreadPoolExecutor(count)
    try:
        for _ in range(count):
            processes.append(_Process(request))
            idle.put(processes[-1])
        drift = pool.submit(ask, DRIFT)
        drawn: Iterable[FloatArray] = pool.map(ask, range(samples))
        rows = np.array(list(drawn if progress is None else progress(drawn, samples)))
        return _gathered(request, rows, drift.result())
    finally:
        for process in processes:
            process.stop()
        pool.shutdown(wait=True, cancel_futures=True)


def _gathered(request: Request, rows: FloatArray, drift: FloatArray) -> ModelErrors:
    """From samples (s, 2 r + 2) and P D P'."""
    rank, weight = len(request.projection), request.uncertainty.touch_shapes
    all_, shape = (
        np.einsum("si,sj->ij", part, part) / len(rows)
        for part in (rows[:, :rank], rows[:, rank : 2 * rank])
    )
    rms = np.sqrt(np.mean(rows[:, -2:] ** 2, axis=0)).astype(np.float32)
    return ModelErrors(
        error=as_covariance(all_ + weight * shape),
        drift=as_covariance(drift),
        rms_error=float(rms[0]),
        rms_shape_error=float(rms[1]),
        row_gains=request.uncertainty.row_gains,
    )


class _Process:
    """One process that draws samples by their numbers."""

    def __init__(self, request: Request) -> None:
        root = str(Path(eitskin.__file__).parents[1])
        path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "eitskin.model.monte_carlo"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path, **dict.fromkeys(THREAD_VARIABLES, "1")},
        )
        self._send(request)

    def ask(self, number: int) -> FloatArray:
        """The answer for one sample."""
        self._send(number)
        assert self._process.stdout is not None
        try:
            answer: FloatArray = pickle.load(self._process.stdout)
        except (EOFError, pickle.UnpicklingError):
            raise _failed() from None
        return answer

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def _send(self, what: object) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()
        except OSError:
            raise _failed() from None


def _failed() -> ModelError:
    return ModelError(
        "model: a process that draws random skins ended before its time; build again, or write"
        ' uncertainty = "none" into the skin\'s file'
    )


def main(asked: IO[bytes], answers: IO[bytes]) -> None:
    """Answer sample numbers until ``asked`` ends."""
    skins = RandomSkins(pickle.load(asked))
    while True:
        try:
            number = pickle.load(asked)
        except EOFError:
            return
        pickle.dump(skins.drift() if number == DRIFT else skins.sample(number), answers)
        answers.flush()


if __name__ == "__main__":
    main(sys.stdin.buffer, sys.stdout.buffer)
