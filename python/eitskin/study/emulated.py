"""The core on an emulated Cortex-M7 (QEMU's mps2-an500): built from a checkout, run on frames, instructions counted exactly.

``tests/emulated/frames_m7.c`` is the program; the tests and ``eitskin bench board`` run it by this module.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from eitskin.core.results import SIGNS, SOLVERS, STOPS, Options
from eitskin.errors import UsageError

BUILD_TOOLS = ("arm-none-eabi-gcc", "cmake", "ninja")
QEMU = "qemu-system-arm"
PROGRAM = Path("tests") / "emulated" / "frames_m7.elf"
MOST_SECONDS = 300
HEAD = re.compile(r"workspace (\d+) kernels (\S+)")
LINE = re.compile(
    r"frame (\d+) status (-?\d+) stop (\d+) iterations (\d+) macs (\d+) touchmacs (\d+) solve (\d+) touch (\d+) stack (\d+) "
    r"image ([0-9a-f]{8}) touches (\d+)(.*)"
)


@dataclass(frozen=True)
class EmulatedFrame:
    """One frame as the emulated board printed it. ``touches``: their number, then ids and numbers as hexadecimal bits;
    ``stack_bytes``: the deepest of solve and touches."""

    status: int
    stop: str
    iterations: int
    solve_macs: int
    touch_macs: int
    solve_instructions: int
    touch_instructions: int
    stack_bytes: int
    image_crc: int
    touches: str

    @property
    def macs(self) -> int:
        """Of solve and touches."""
        return self.solve_macs + self.touch_macs

    @property
    def instructions(self) -> int:
        """Of solve and touches."""
        return self.solve_instructions + self.touch_instructions


@dataclass(frozen=True)
class EmulatedRun:
    """What a run printed: the core's workspace in bytes, the name of its kernels, a result a frame."""

    workspace_bytes: int
    kernels: str
    frames: tuple[EmulatedFrame, ...]


def checkout_root() -> Path:
    """The source checkout that this package runs from, or that is the current folder.

    Raises:
        UsageError: there is none.
    """
    for root in (Path(__file__).resolve().parents[3], Path.cwd()):
        if (root / "cmake" / "arm-cortex-m7.cmake").is_file() and (root / "tests" / "emulated" / "frames_m7.c").is_file():
            return root
    raise UsageError("this needs the project's source checkout, which an installed package is not; run it in the checkout's root")


def need_tools(*names: str) -> None:
    """Refuse what cannot be done without programs that are absent.

    Raises:
        UsageError: naming them.
    """
    absent = [name for name in names if shutil.which(name) is None]
    if absent:
        raise UsageError(f"missing {', '.join(absent)}; scripts/test installs them")


def build_cortex_m7(source: Path, build: Path, *targets: str) -> Path:
    """Configure and build the checkout at ``source`` in the folder ``build``, which is returned; without ``targets``, all.

    Raises:
        UsageError: a tool is missing, or the build fails or warns.
    """
    need_tools(*BUILD_TOOLS)
    toolchain = source / "cmake" / "arm-cortex-m7.cmake"
    configure = ["cmake", "-S", str(source), "-B", str(build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={toolchain}", "-DEITSKIN_TESTS=OFF"]
    chosen = [word for target in targets for word in ("--target", target)]
    for command in (configure, ["cmake", "--build", str(build), *chosen]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        output = done.stdout + done.stderr
        if done.returncode != 0 or "warning:" in output:
            raise UsageError(f"the build for the Cortex-M7 failed or warned: {' '.join(command)}\n{output}")
    return build


def run_frames(
    program: Path,
    folder: Path,
    blob: bytes,
    quiet_v: npt.NDArray[Any],
    frames_v: npt.NDArray[Any],
    options: Options,
    *,
    portable: bool = False,
    settings: Mapping[str, float] | None = None,
) -> EmulatedRun:
    """The emulated board's results for ``frames_v`` (k, m) after taring on ``quiet_v`` (q, m), volts.

    Of ``options``, those that the program takes: warm start, sign and solver; all others are the model's defaults, or as
    ``settings`` say (those that frames_m7.c knows by name).
    ``folder`` is where the program finds its files. ``portable``: plain C instead of the processor's own kernels.

    Raises:
        UsageError: QEMU is missing or the program fails.
    """
    need_tools(QEMU)
    (folder / "model.eitm").write_bytes(blob)
    plan = len(quiet_v), len(frames_v), int(options.warm_start), SIGNS.index(options.sign), SOLVERS.index(options.solver)
    (folder / "plan.txt").write_text(" ".join(map(str, (*plan, int(portable)))) + "\n", encoding="ascii")
    lines = (f"{name} {value:.9g}\n" for name, value in (settings or {}).items())
    (folder / "options.txt").write_text("".join(lines), encoding="ascii")
    (folder / "frames.f32").write_bytes(np.vstack([quiet_v, frames_v]).astype("<f4").tobytes())
    command = [QEMU, "-M", "mps2-an500", "-nographic", "-monitor", "none", "-semihosting-config"]
    command += ["enable=on,target=native", "-icount", "shift=6", "-kernel", str(program)]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=MOST_SECONDS, check=False, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        raise UsageError(f"the emulated board did not end within {MOST_SECONDS} s") from None
    head = HEAD.search(done.stdout)
    found = [match for match in map(LINE.match, done.stdout.splitlines()) if match is not None]
    if done.returncode != 0 or head is None or len(found) != len(frames_v):
        raise UsageError(f"the emulated board failed: {(done.stdout + done.stderr).strip()[-500:]}")
    return EmulatedRun(int(head[1]), head[2], tuple(map(_frame, found)))


def _frame(match: re.Match[str]) -> EmulatedFrame:
    g = match.groups()
    iterations, macs, touch_macs, solve, touch, stack = map(int, g[3:9])
    return EmulatedFrame(
        int(g[1]), STOPS[int(g[2])], iterations, macs, touch_macs, solve, touch, stack, int(g[9], 16), f"{g[10]}{g[11]}"
    )
