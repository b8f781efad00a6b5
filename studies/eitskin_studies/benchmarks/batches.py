"""Compare batches of frames on several threads with single frames, in frames per second, by turns
in one run."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from threading import Thread
from time import perf_counter, process_time
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.batch import Batch, check_threads
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.benchmarks.frame import golden_session
from eitskin_studies.harness.bare_core import bare_block
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling, text_table


@dataclass(frozen=True)
class Speed:
    """Microseconds a frame over the rounds: median and least elapsed, median of all processors'
    time; and the speed-up of the least times over one after another."""

    name: str
    threads: int
    us: float
    least_us: float
    processor_us: float
    times: float


@dataclass(frozen=True)
class BatchTimes:
    """All of a run."""

    frames: int
    rounds: int
    processors: int
    machine: str
    speeds: tuple[Speed, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def _batch(batch: Batch, frames: FloatArray) -> None:
    for _ in batch.each(frames):
        pass


def _c_alone(blob: bytes, untouched: FloatArray, parts: list[FloatArray]) -> Callable[[], None]:
    """One C call per thread: the limit of the machine."""
    calls = []
    for part in parts:
        engine = CoreEngine(blob)
        engine.set_reference(untouched[None])
        calls.append(bare_block(engine, part))

    def run_all() -> None:
        running = [Thread(target=call) for call in calls]
        for thread in running:
            thread.start()
        for thread in running:
            thread.join()

    return run_all


def run(frames: int, rounds: int, threads: Sequence[int]) -> BatchTimes:
    """Time ``rounds`` rounds of ``frames`` noisy golden frames one after another and by a batch of
    each of ``threads``."""
    model, blob = load_prebuilt()
    *_, noisy = golden_session()
    many = np.tile(noisy, (-(-frames // len(noisy)), 1))[:frames]
    untouched = model.golden.reference_v.astype(np.float64)
    single = Reconstructor(model, blob=blob)
    single.tare(untouched)

    def one_after_another() -> None:
        for frame in many:
            single.forget()
            single.reconstruct(frame)

    ways: dict[tuple[str, int], Callable[[], Any]] = {("one after another", 1): one_after_another}
    for count in threads:
        batch = Batch(model, threads=count, blob=blob)
        batch.tare(untouched)
        ways["batch", count] = partial(_batch, batch, many)
        ways["C alone", count] = _c_alone(blob, untouched, np.array_split(many, count))
    spent: dict[tuple[str, int], list[float]] = {way: [] for way in ways}
    used: dict[tuple[str, int], list[float]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, call in ways.items():
            start, processor = perf_counter(), process_time()
            call()
            used[way].append(1e6 * (process_time() - processor) / frames)
            spent[way].append(1e6 * (perf_counter() - start) / frames)
    base = min(spent["one after another", 1])
    speeds = tuple(
        Speed(*way, float(np.median(us)), min(us), float(np.median(used[way])), base / min(us))
        for way, us in spent.items()
    )
    return BatchTimes(frames, rounds, check_threads(None), machine(), speeds)


HEAD = ("way", "threads", "us a frame, median", "least", "processor time", "speed-up of the least")


def rows(result: BatchTimes) -> list[tuple[str, ...]]:
    """Rows under ``HEAD``."""
    return [
        (
            s.name,
            f"{s.threads}",
            f"{s.us:.0f}",
            f"{s.least_us:.0f}",
            f"{s.processor_us:.0f}",
            f"{s.times:.2f}",
        )
        for s in result.speeds
    ]


def as_text(result: BatchTimes) -> str:
    """For a terminal."""
    return f"{_conditions(result)}\n{text_table(HEAD, rows(result))}"


def _conditions(result: BatchTimes) -> str:
    return (
        f"{result.frames} frames, {result.rounds} rounds in turns, {result.processors} processors;"
        f" {result.machine}"
    )


def for_page(result: BatchTimes, command: str) -> Filling:
    """The marks of studies/results/benchmarks.md."""
    return {"batches-run": f"By `{command}`: {_conditions(result)}."}, {
        "batches": (HEAD, rows(result))
    }
