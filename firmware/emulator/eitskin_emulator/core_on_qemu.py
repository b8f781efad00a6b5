"""The core on an emulated Cortex-M7 (QEMU's mps2-an500): built from a checkout, run on frames,
instructions counted exactly.

``tests/emulated/frames_m7.c`` is the program; the tests and ``eitskin bench board`` run it by this
module.
"""

import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eitskin.arrays import AnyArray
from eitskin.core.diagnostics_table import STOPS
from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin_emulator.core_steps import (
    Choose,
    Drives,
    Load,
    Play,
    Solve,
    Step,
    TareStep,
    write_steps,
)

BUILD_TOOLS = ("arm-none-eabi-gcc", "cmake", "ninja")
QEMU = "qemu-system-arm"
BOARD = (
    *(QEMU, "-M", "mps2-an500", "-nographic", "-monitor", "none"),
    *("-semihosting-config", "enable=on,target=native", "-icount", "shift=6", "-kernel"),
)
PROGRAM = Path("tests") / "emulated" / "frames_m7.elf"
MAX_SECONDS = 300
STATUS = re.compile(
    r"(model|choose|quiet|fast) status (-?\d+)(?: workspace (\d+)(?: kernels (\S+))?)?"
)
LINE = re.compile(
    r"frame (\d+) status (-?\d+) stop (\d+) iterations (\d+) macs (\d+) touchmacs (\d+) solve (\d+)"
    r" touch (\d+) gesture (\d+) stack (\d+) "
    r"image ([0-9a-f]{8}) info (\S+) touches (\d+)(.*)"
)

DRIVE = re.compile(r"drive (\d+) status (-?\d+) fast (\d+) stack (\d+) touches (.*)")
SCAN = re.compile(r"scan status (-?\d+) align (\d+) confirm (\d+) state (\d+) frame ([0-9a-f]{8})")


@dataclass(frozen=True)
class EmulatedDrive:
    """One drive by the fast path, its touches as printed; ``stack_bytes`` the deepest."""

    drive: int
    status: int
    instructions: int
    stack_bytes: int
    touches: str


@dataclass(frozen=True)
class EmulatedScan:
    """An aligned frame: the instructions of the alignment and of the confirmation by the solver's
    touches, the bits of eits_fast_frame, and the CRC-32 of its rows."""

    status: int
    align_instructions: int
    confirm_instructions: int
    state: int
    frame_crc: int


@dataclass(frozen=True)
class EmulatedFrame:
    """One frame as the emulated board printed it. ``touches``: their number, then ids and numbers
    as hexadecimal bits; ``info``: non-zeros, masked rows, halvings, then lambda, lambda_max,
    lambda_noise, gap, gap_rel, residual and |y| as such bits, and what was found;
    ``stack_bytes``: the deepest of solve and touches."""

    status: int
    stop: str
    iterations: int
    solve_macs: int
    touch_macs: int
    solve_instructions: int
    touch_instructions: int
    gesture_instructions: int
    stack_bytes: int
    image_crc: int
    info: str
    touches: str

    @property
    def macs(self) -> int:
        """The multiply-accumulates of solve and touches together."""
        return self.solve_macs + self.touch_macs

    @property
    def instructions(self) -> int:
        """The instructions of solve and touches together."""
        return self.solve_instructions + self.touch_instructions


@dataclass(frozen=True)
class EmulatedRun:
    """The output of a run: the last model's workspace in bytes, the name of its kernels, a result a
    frame, drive and scan, the bytes of the last fast path (0: none), and the statuses of every
    model, choice of options, tare and fast path."""

    workspace_bytes: int
    kernels: str
    frames: tuple[EmulatedFrame, ...]
    statuses: tuple[tuple[str, int], ...]
    drives: tuple[EmulatedDrive, ...] = ()
    scans: tuple[EmulatedScan, ...] = ()
    fast_bytes: int = 0


def checkout_root() -> Path:
    """The source checkout that this package runs from, or that is the current folder.

    Raises:
        UsageError: there is none.
    """
    for root in (Path(__file__).resolve().parents[3], Path.cwd()):
        if (root / "cmake" / "arm-cortex-m7.cmake").is_file() and (
            root / "tests" / "emulated" / "frames_m7.c"
        ).is_file():
            return root
    raise UsageError(
        "this needs the project's source checkout, which an installed package is not; run it in the"
        " checkout's root"
    )


def need_tools(*names: str) -> None:
    """Reject what cannot be done without programs that are absent.

    Raises:
        UsageError: naming them.
    """
    absent = [name for name in names if shutil.which(name) is None]
    if absent:
        raise UsageError(f"missing {', '.join(absent)}; scripts/test installs them")


def build_cortex_m7(source: Path, build: Path, *targets: str) -> Path:
    """Configure and build the checkout at ``source`` in the folder ``build``, which is returned;
    without ``targets``, all.

    Raises:
        UsageError: a tool is missing, or the build fails or warns.
    """
    need_tools(*BUILD_TOOLS)
    toolchain = source / "cmake" / "arm-cortex-m7.cmake"
    configure = [
        "cmake",
        "-S",
        str(source),
        "-B",
        str(build),
        "-G",
        "Ninja",
        "-DCMAKE_BUILD_TYPE=Release",
    ]
    configure += [f"-DCMAKE_TOOLCHAIN_FILE={toolchain}", "-DEITSKIN_TESTS=OFF"]
    configure += ["-DEITSKIN_WERROR=ON"]  # as in the preset: nothing is compiled again for scripts
    chosen = [word for target in targets for word in ("--target", target)]
    for command in (configure, ["cmake", "--build", str(build), *chosen]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        output = done.stdout + done.stderr
        if done.returncode != 0 or "warning:" in output:
            raise UsageError(
                f"the build for the Cortex-M7 failed or warned: {' '.join(command)}\n{output}"
            )
    return build


def run_frames(
    program: Path,
    folder: Path,
    blob: bytes,
    untouched_v: AnyArray,
    frames_v: AnyArray,
    options: Options,
    *,
    portable: bool = False,
) -> EmulatedRun:
    """The emulated board's results for ``frames_v`` (k, m) after taring on ``untouched_v`` (q, m),
    volts.

    ``folder`` is where the program finds its files. ``portable``: plain C instead of the
    processor's own kernels.

    Raises:
        UsageError: QEMU is missing, the program fails, or the model, the options or an untouched
            frame are refused.
    """
    done = run_steps(
        program,
        folder,
        (Load(blob), Choose(options), TareStep(untouched_v), Play(frames_v)),
        portable=portable,
    )
    refused = [f"{word} (status {status})" for word, status in done.statuses if status != 0]
    if refused:
        raise UsageError(f"the emulated board refuses: {', '.join(refused)}")
    return done


def run_steps(
    program: Path,
    folder: Path,
    steps: Sequence[Step],
    *,
    portable: bool = False,
    emulator: Sequence[str] = BOARD,
) -> EmulatedRun:
    """Return the emulated board's results for ``steps``, including rejections; a model that is
    rejected must be the last step.

    ``folder`` is where the program finds its files. ``portable``: plain C instead of the
    processor's own kernels. ``emulator``: the command that runs the program.

    Raises:
        UsageError: QEMU is missing or the program fails.
    """
    need_tools(emulator[0])
    write_steps(folder, steps, portable=portable)
    try:
        done = subprocess.run(
            [*emulator, str(program)],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=MAX_SECONDS,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        raise UsageError(f"the emulated board did not end within {MAX_SECONDS} s") from None
    lines = done.stdout.splitlines()
    heads = [match for match in map(STATUS.match, lines) if match is not None]
    found = [match for match in map(LINE.match, lines) if match is not None]
    models = [match for match in heads if match[1] == "model"]
    wanted = sum(len(step.frames_v) for step in steps if isinstance(step, Play)) + sum(
        len(step.data) for step in steps if isinstance(step, Solve)
    )
    drives = [match.groups() for match in map(DRIVE.match, lines) if match is not None]
    scans = [match.groups() for match in map(SCAN.match, lines) if match is not None]
    fast = [match for match in heads if match[1] == "fast"]
    played = sum(len(step.scans_v) for step in steps if isinstance(step, Drives))
    short = len(found) != wanted or (len(scans) != played and all(one[2] == "0" for one in fast))
    refused = bool(models) and models[-1][2] != "0"
    if not models or (not refused and (done.returncode != 0 or short)):
        raise UsageError(f"the emulated board failed: {(done.stdout + done.stderr).strip()[-500:]}")
    statuses = tuple((match[1], int(match[2])) for match in heads)
    return EmulatedRun(
        int(models[-1][3]),
        models[-1][4],
        tuple(map(_frame, found)),
        statuses,
        tuple(map(_drive, drives)),
        tuple(map(_scan, scans)),
        int(fast[-1][3]) if fast else 0,
    )


def _drive(words: Sequence[str]) -> EmulatedDrive:
    drive, status, instructions, stack = map(int, words[:4])
    return EmulatedDrive(drive, status, instructions, stack, words[4])


def _scan(words: Sequence[str]) -> EmulatedScan:
    status, align, confirm, state = map(int, words[:4])
    return EmulatedScan(status, align, confirm, state, int(words[4], 16))


def _frame(match: re.Match[str]) -> EmulatedFrame:
    g = match.groups()
    iterations, macs, touch_macs, solve, touch, gesture, stack = map(int, g[3:10])
    image, info, touches = int(g[10], 16), g[11], f"{g[12]}{g[13]}"
    return EmulatedFrame(
        int(g[1]),
        STOPS[int(g[2])],
        iterations,
        macs,
        touch_macs,
        solve,
        touch,
        gesture,
        stack,
        image,
        info,
        touches,
    )
