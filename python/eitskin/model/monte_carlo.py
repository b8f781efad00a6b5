"""Draw random skins (model.random_skins) on every processor core, and calculate the model errors
from them.

Each process runs this module itself, so any script can build a model, with or without a
``__main__`` guard. A process uses one thread, and samples are summed in their order, so the number
of processes does not change a bit of the result.
"""

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

import eitskin
from eitskin.arrays import FloatArray
from eitskin.errors import ModelError
from eitskin.model.model_errors import ModelErrors
from eitskin.model.random_skins import RandomSkins, Request
from eitskin.model.tare_places import metrics_of, row_errors, tare_places
from eitskin.progress import Progress, silent

METHODS: dict[str, Callable[..., Any]] = {
    "sample": RandomSkins.sample,
    "error": RandomSkins.error,
    "drift": RandomSkins.drift,
    "row_errors": RandomSkins.row_errors,
    "places": tare_places,
}
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def draw_model_errors(
    request: Request, *, jobs: int | None = None, progress: Progress = silent
) -> ModelErrors:
    """Return the model errors of ``request``, drawn by ``jobs`` processes (None: one per core).

    ``progress`` wraps the samples as they are done, and is given their number.

    Raises:
        ModelError: a process failed.
    """
    samples = request.uncertainty.samples
    count = max(1, min(jobs or os.cpu_count() or 1, samples))
    idle: SimpleQueue[_Process] = SimpleQueue()

    def ask(name: str, *arguments: Any) -> Any:
        process = idle.get()
        try:
            return process.ask(name, *arguments)
        finally:
            idle.put(process)

    processes: list[_Process] = []
    with ThreadPoolExecutor(count) as pool:
        try:
            for _ in range(count):
                processes.append(_Process(request))
                idle.put(processes[-1])
            drift = pool.submit(ask, "drift")
            drawn: Iterable[FloatArray] = pool.map(
                lambda number: ask("sample", number), range(samples)
            )
            rows = np.array(list(progress(drawn, samples)))
            rms_error, rms_shape_error = np.sqrt(np.mean(rows[:, -2:] ** 2, axis=0))
            vectors, distance = ask("row_errors", rows)
            metrics = metrics_of(vectors) if request.fits_jointly else []
            places = ask("places", metrics)
            return ModelErrors(
                error=ask("error", rows),
                drift=drift.result(),
                rms_error=float(np.float32(rms_error)),
                rms_shape_error=float(np.float32(rms_shape_error)),
                row_gains=request.uncertainty.row_gains,
                places=places.reduced,
                rows=row_errors(vectors, distance, places) if request.fits_jointly else None,
            )
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.stop()


class _Process:
    """A process that calls the methods of its own :class:`RandomSkins`."""

    def __init__(self, request: Request) -> None:
        root = str(Path(eitskin.__file__).parents[1])
        path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "eitskin.model.monte_carlo"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path, **dict.fromkeys(THREAD_VARIABLES, "1")},
        )
        self._send(request)

    def ask(self, name: str, *arguments: Any) -> Any:
        """Return the result of METHODS[``name``] for ``arguments``."""
        self._send((name, arguments))
        assert self._process.stdout is not None
        try:
            answer = pickle.load(self._process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            raise _failed("it ended early") from None
        if isinstance(answer, str):
            raise _failed(answer)
        return answer

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()

    def _send(self, what: object) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()
        except OSError:
            raise _failed("it ended early") from None


def _failed(why: str) -> ModelError:
    return ModelError(
        f"model: a process that draws random skins failed ({why}); build again, or without them by"
        " --samples 0"
    )


def main(asked: IO[bytes], answers: IO[bytes]) -> None:
    """Answer requests from ``asked`` until it ends. An answer that is a text reports an error."""
    request = pickle.load(asked)
    skins: RandomSkins | None = None
    while True:
        try:
            name, arguments = pickle.load(asked)
        except EOFError:
            return
        try:
            skins = skins or RandomSkins(request)
            answer = METHODS[name](skins, *arguments)
        except Exception as error:
            answer = f"{type(error).__name__}: {error}"
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main(sys.stdin.buffer, sys.stdout.buffer)
