"""Batches of frames over threads beside one frame after another: frames a second, in turns in one run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np

from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.batch import Batch, check_threads
from eitskin.solve.reconstructor import Reconstructor
from eitskin.study.bench_frame import golden_session, machine
from eitskin.study.sections import markdown_table, text_table


@dataclass(frozen=True)
class Speed:
    """Microseconds a frame over the rounds: median and least, and the speed-up of the medians over one after another."""

    name: str
    threads: int
    us: float
    least_us: float
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


def run(frames: int, rounds: int, threads: Sequence[int]) -> BatchTimes:
    """Time ``rounds`` rounds of ``frames`` noisy golden frames one after another and by a batch of each of ``threads``."""
    model, blob = load_prebuilt()
    *_, noisy = golden_session()
    many = np.tile(noisy, (-(-frames // len(noisy)), 1))[:frames]
    quiet = model.golden.reference_v.astype(np.float64)
    single = Reconstructor(model, blob=blob)
    single.tare(quiet)
    batches = {count: Batch(model, threads=count, blob=blob) for count in threads}
    for batch in batches.values():
        batch.tare(quiet)

    def one_after_another() -> None:
        for frame in many:
            single.forget()
            single.reconstruct(frame)

    ways: dict[tuple[str, int], Any] = {("one after another", 1): one_after_another}
    for count, batch in batches.items():
        ways["batch", count] = lambda batch=batch: list(batch.each(many))
    spent: dict[tuple[str, int], list[float]] = {way: [] for way in ways}
    for _ in range(rounds):
        for way, call in ways.items():
            start = perf_counter()
            call()
            spent[way].append(1e6 * (perf_counter() - start) / frames)
    base = float(np.median(spent["one after another", 1]))
    speeds = tuple(
        Speed(name, count, float(np.median(us)), min(us), base / float(np.median(us))) for (name, count), us in spent.items()
    )
    return BatchTimes(frames, rounds, check_threads(None), machine(), speeds)


HEAD = ("way", "threads", "us a frame, median", "least", "speed-up")


def rows(result: BatchTimes) -> list[tuple[str, ...]]:
    """Rows under ``HEAD``."""
    return [(s.name, f"{s.threads}", f"{s.us:.0f}", f"{s.least_us:.0f}", f"{s.times:.2f}") for s in result.speeds]


def as_text(result: BatchTimes) -> str:
    """For a terminal."""
    head = f"{result.frames} frames, {result.rounds} rounds in turns, {result.processors} processors; {result.machine}"
    return f"{head}\n{text_table(HEAD, rows(result))}"


def as_markdown(result: BatchTimes, command: str) -> str:
    """The section "Batches"."""
    return "\n\n".join([
        f"Written by `{command}`: {result.frames} noisy golden frames, image and touches, {result.rounds} rounds in turns, "
        f"{result.processors} processors; {result.machine}.",
        markdown_table(HEAD, rows(result)),
        "A batch has a context a thread, and C runs without Python's lock; results, counts and ids are those of one frame after "
        "another, whatever the number of threads. Other work on the machine shows at once in the speed-up: the least time of "
        "each way says what it can be.",
    ])
