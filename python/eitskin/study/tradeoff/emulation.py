"""Instructions of a frame on a Cortex-M7, counted exactly by QEMU (mps2-an500, -icount), where toolchain and sources are."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import eitskin
from eitskin.core.results import SIGNS, SOLVERS
from eitskin.errors import VerificationError
from eitskin.study.tradeoff.accuracy import Solved
from eitskin.study.tradeoff.configuration import Configuration
from eitskin.study.tradeoff.engines import Built
from eitskin.study.tradeoff.scene_sets import Measured

TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm", "cmake", "ninja")
PROGRAM = "tests/emulated/frames_m7.c"
LINE = re.compile(
    r"frame (\d+) status (-?\d+) stop (\d+) iterations (\d+) macs (\d+) (?:touchmacs (\d+) )?solve (\d+) touch (\d+) "
)
TIMEOUT_S = 600


@dataclass(frozen=True)
class Emulator:
    """The program that runs frames as a board would."""

    program: Path


def find_sources() -> Path | None:
    """The checkout that this package runs from, or the current folder; None where neither has the C sources."""
    for root in (Path(eitskin.__file__).resolve().parents[2], Path.cwd()):
        if (root / PROGRAM).is_file():
            return root
    return None


def make_emulator(folder: Path) -> Emulator | str:
    """Build the program below ``folder``; where that cannot be, why."""
    absent = [tool for tool in TOOLS if shutil.which(tool) is None]
    if absent:
        return f"{', '.join(absent)} not installed"
    root = find_sources()
    if root is None:
        return "no C sources beside this installation; run in a checkout"
    build = folder / "cortex-m7"
    configure = ["cmake", "-S", str(root), "-B", str(build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DEITSKIN_TESTS=OFF"]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={root / 'cmake' / 'arm-cortex-m7.cmake'}"]
    for command in (configure, ["cmake", "--build", str(build), "--target", "frames_m7"]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return f"building for the Cortex-M7 failed: {(done.stdout + done.stderr).strip().splitlines()[-1]}"
    return Emulator(build / "tests" / "emulated" / "frames_m7.elf")


def chosen_scenes(solved: Solved, spread: int, most: int) -> tuple[list[int], list[int]]:
    """``spread`` scenes evenly over all, for the mean; and the ``most`` with the most MACs, for the worst."""
    count = len(solved.results)
    even = sorted({round(k * (count - 1) / max(spread - 1, 1)) for k in range(min(spread, count))})
    costs = [one.info.macs + one.info.touch_macs for one in solved.results]
    return even, sorted(np.argsort(costs, kind="stable")[::-1][:most].tolist())


def count_instructions(
    emulator: Emulator, one: Configuration, built: Built, measured: Measured, solved: Solved, spread: int, most: int
) -> dict[str, Any]:
    """Instructions of solve and touches, mean over evenly chosen scenes and most over those and the costliest, on the judged
    frames; where held, the most also counts the frames before.

    Raises:
        VerificationError: the emulated core does other work than the host's.
    """
    even, costly = chosen_scenes(solved, spread, most)
    scenes = [*even, *(k for k in costly if k not in even)]
    frames = measured.frames_v[scenes].reshape(-1, measured.frames_v.shape[2])
    found = _run(emulator, one, built, measured.quiet_v, frames)
    last = found[one.held - 1 :: one.held]
    if not one.warm_start:
        for k, row in zip(scenes, last, strict=True):
            info = solved.results[k].info
            if (row[0], row[1]) != (info.iterations, info.macs + info.touch_macs):
                macs = info.macs + info.touch_macs
                raise VerificationError(f"configuration {one.name!r}: the emulated core does {row[1]} MACs, this host's {macs}")
    mean = np.mean([row[2:] for row in last[: len(even)]], axis=0)
    return {
        "kind": "counted",
        "frames": len(scenes),
        "solve_mean": round(float(mean[0])),
        "touch_mean": round(float(mean[1])),
        "mean": round(float(mean.sum())),
        "most": max(row[2] + row[3] for row in found),
        "macs_mean": round(float(np.mean([row[1] for row in last[: len(even)]]))),
    }


def _run(emulator: Emulator, one: Configuration, built: Built, quiet_v: Any, frames_v: Any) -> list[tuple[int, int, int, int]]:
    """Iterations, MACs, instructions of solve and touches of each frame."""
    options = built.reconstructor(one).options
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "model.eitm").write_bytes(built.blob)
        plan = len(quiet_v), len(frames_v), int(options.warm_start), SIGNS.index(options.sign), SOLVERS.index(options.solver)
        (folder / "plan.txt").write_text(" ".join(map(str, plan)) + "\n")
        settings = {name: value for name, value in one.solver_settings.items() if name not in ("warm_start", "solver")}
        (folder / "options.txt").write_text("".join(f"{name} {value:.9g}\n" for name, value in settings.items()))
        (folder / "frames.f32").write_bytes(np.vstack([quiet_v, frames_v]).astype("<f4").tobytes())
        command = ["qemu-system-arm", "-M", "mps2-an500", "-nographic", "-monitor", "none", "-semihosting-config"]
        command += ["enable=on,target=native", "-icount", "shift=6", "-kernel", str(emulator.program.resolve())]
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT_S, check=False, stdin=subprocess.DEVNULL
            )
        except subprocess.TimeoutExpired:
            raise VerificationError(f"configuration {one.name!r}: {TIMEOUT_S} s did not suffice under emulation") from None
    rows = [match.groups() for match in map(LINE.match, done.stdout.splitlines()) if match is not None]
    if done.returncode or len(rows) != len(frames_v) or any(row[1] != "0" for row in rows):
        last = (done.stdout + done.stderr).strip().splitlines()[-1:]
        raise VerificationError(f"configuration {one.name!r}: the emulated core gave no result: {' '.join(last) or 'no output'}")
    return [(int(row[3]), int(row[4]) + int(row[5] or 0), int(row[6]), int(row[7])) for row in rows]
