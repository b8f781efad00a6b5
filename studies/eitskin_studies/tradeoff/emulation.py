"""Instructions of a frame on a Cortex-M7, counted exactly by QEMU (mps2-an500, -icount), where
toolchain and sources are."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.errors import UsageError, VerificationError
from eitskin.tuning.configuration import Configuration
from eitskin_emulator.core_on_qemu import (
    BUILD_TOOLS,
    PROGRAM,
    QEMU,
    EmulatedFrame,
    build_cortex_m7,
    checkout_root,
    need_tools,
    run_frames,
)
from eitskin_studies.harness.sessions import MeasuredFrames
from eitskin_studies.tradeoff.accuracy import SolvedSet
from eitskin_studies.tradeoff.engines import Built


@dataclass(frozen=True)
class Emulator:
    """The program that runs frames as a board would."""

    program: Path


def make_emulator(folder: Path) -> Emulator | str:
    """Build the program below ``folder``; where that cannot be, why."""
    try:
        need_tools(*BUILD_TOOLS, QEMU)
        return Emulator(
            build_cortex_m7(checkout_root(), folder / "cortex-m7", "frames_m7") / PROGRAM
        )
    except UsageError as error:
        return str(error).splitlines()[0]


def chosen_scenes(solved: SolvedSet, spread: int, most: int) -> tuple[list[int], list[int]]:
    """``spread`` scenes evenly over all, for the mean; and the ``most`` with the most MACs, for the
    worst."""
    count = len(solved.results)
    even = sorted({round(k * (count - 1) / max(spread - 1, 1)) for k in range(min(spread, count))})
    costs = [one.info.macs + one.info.touch_macs for one in solved.results]
    return even, sorted(np.argsort(costs, kind="stable")[::-1][:most].tolist())


def count_instructions(
    emulator: Emulator,
    one: Configuration,
    built: Built,
    measured: MeasuredFrames,
    solved: SolvedSet,
    spread: int,
    most: int,
) -> dict[str, Any]:
    """Instructions of solve and touches, mean over evenly chosen scenes and most over those and the
    costliest, on the judged frames; where held, the most also counts the frames before.

    Raises:
        VerificationError: the emulated core does other work than the host's.
    """
    even, costly = chosen_scenes(solved, spread, most)
    scenes = [*even, *(k for k in costly if k not in even)]
    frames = measured.frames_v[scenes].reshape(-1, measured.frames_v.shape[2])
    found = _run(emulator, one, built, measured.untouched_v, frames)
    last = found[one.held - 1 :: one.held]
    if not one.warm_start:
        for k, row in zip(scenes, last, strict=True):
            info = solved.results[k].info
            if (row.iterations, row.macs) != (info.iterations, info.macs + info.touch_macs):
                macs = info.macs + info.touch_macs
                raise VerificationError(
                    f"configuration {one.name!r}: the emulated core does {row.macs} MACs, this"
                    f" host's {macs}"
                )
    mean = np.mean(
        [(row.solve_instructions, row.touch_instructions) for row in last[: len(even)]], axis=0
    )
    return {
        "kind": "counted",
        "frames": len(scenes),
        "solve_mean": round(float(mean[0])),
        "touch_mean": round(float(mean[1])),
        "mean": round(float(mean.sum())),
        "most": max(row.instructions for row in found),
        "macs_mean": round(float(np.mean([row.macs for row in last[: len(even)]]))),
    }


def _run(
    emulator: Emulator, one: Configuration, built: Built, untouched_v: Any, frames_v: Any
) -> tuple[EmulatedFrame, ...]:
    """Return the emulated core's result for each frame."""
    options = built.reconstructor(one).options
    with tempfile.TemporaryDirectory() as name:
        try:
            done = run_frames(
                emulator.program.resolve(), Path(name), built.blob, untouched_v, frames_v, options
            )
        except UsageError as error:
            raise VerificationError(f"configuration {one.name!r}: {error}") from None
    if any(frame.status != 0 for frame in done.frames):
        raise VerificationError(
            f"configuration {one.name!r}: the emulated core refuses a frame that this host takes"
        )
    return done.frames
