"""Microseconds of a frame on this host: solve and touches in C, all configurations interleaved,
medians."""

from collections.abc import Sequence
from time import perf_counter_ns
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.core.engine import CoreEngine
from eitskin.progress import Progress
from eitskin.tuning.configuration import Configuration
from eitskin_studies.harness.bare_core import bare_calls
from eitskin_studies.harness.sessions import MeasuredFrames
from eitskin_studies.tradeoff.engines import Built

SCENES = 8


def host_times(
    entries: Sequence[tuple[Configuration, Built, MeasuredFrames]], rounds: int, progress: Progress
) -> tuple[list[dict[str, Any]], str]:
    """p50 and p99 of each configuration over ``rounds`` rounds of eight scenes, ``most``: the
    median of the slowest scene (which, unlike p99, does not depend on what else the machine did),
    ``solve_p50``: the image alone, without touches, and the kernels' name. In each round every
    configuration has its turn, so that all meet the same disturbances."""
    engines = []
    for one, built, measured in entries:
        engine = CoreEngine(built.blob)
        engine.set_options(built.reconstructor(one).options)
        engine.set_reference(measured.untouched_v)
        engines.append(engine)
    samples: list[list[list[tuple[float, float]]]] = [[[] for _ in range(SCENES)] for _ in entries]
    for turn in progress(range(-1, rounds), "timing"):
        for engine, (one, _, measured), times in zip(engines, entries, samples, strict=True):
            count = len(measured.frames_v)
            for k in range(SCENES):
                if not one.warm_start:
                    engine.forget()
                frames_v = measured.frames_v[(k * count) // SCENES]
                for frame_v in frames_v[:-1]:
                    engine.reconstruct(frame_v)
                solve, touches = bare_calls(engine, frames_v[-1])
                start = perf_counter_ns()
                solve()
                solved = perf_counter_ns()
                touches()
                if turn >= 0:
                    both = perf_counter_ns() - start
                    times[k].append((both / 1000, (solved - start) / 1000))
    return [_row(np.array(times)) for times in samples], engines[0].kernels


def _row(times: FloatArray) -> dict[str, Any]:
    """Return the statistics of ``times`` (scenes, rounds, 2) in us: of solve and touches, and of
    the solve alone."""
    times, solve = times[..., 0], times[..., 1]
    return {
        "p50": round(float(np.median(times)), 1),
        "p99": round(float(np.percentile(times, 99)), 1),
        "most": round(float(np.median(times, axis=1).max()), 1),
        "solve_p50": round(float(np.median(solve)), 1),
        "frames": times.size,
    }
