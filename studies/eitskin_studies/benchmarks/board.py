"""The cost of a frame on the board: exact instruction counts under QEMU, memory, and the frame rate
of the emulated NUCLEO-F767ZI.

Instructions are exact. Times on silicon are an estimate from them: one a cycle at 216 MHz. A
Cortex-M7 issues up to two a cycle and waits for flash and memory; nobody has measured it here.
"""

import re
import shutil
import subprocess
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.core.results import Options
from eitskin.errors import UsageError
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin.model.storage import STORAGES, store
from eitskin.progress import Progress, silent
from eitskin.scene.random_touches import random_touches
from eitskin.scene.simulate import Simulated, simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_emulator.core_on_qemu import (
    PROGRAM,
    build_cortex_m7,
    checkout_root,
    need_tools,
    run_frames,
)
from eitskin_studies.harness.sections import Filling, Tabular, text_table

CLOCK_HZ = 216_000_000
IMAGE = "eitskin_nucleo_f767zi"
TARGETS = ("frames_m7", IMAGE, "eitskin_mps2_an500")
SCENE = "emu:two_touch"
TARE_FRAMES = 8
SOLVED_SHARE = 0.98  # of the scans; if fewer are solved, the solves bound the rate
CODE, STATICS, STACK = (
    (".vectors", ".text", ".ARM.exidx"),
    (".data", ".bss", ".dtcm", ".noinit"),
    ".stack",
)


@dataclass(frozen=True)
class ConfigurationCost:
    """One storage, start and build of the kernels over all scenes; instructions of solve and
    touches, MACs likewise."""

    storage: str
    kernels: str
    warm: bool
    solve_mean: float
    touches_mean: float
    gestures_most: int
    worst: int
    worst_tenth: float
    macs_mean: float
    model_bytes: int
    workspace_bytes: int
    stack_bytes: int

    @property
    def mean(self) -> float:
        """Instructions of solve and touches."""
        return self.solve_mean + self.touches_mean

    @property
    def per_mac(self) -> float:
        """Instructions a multiply-accumulate."""
        return self.mean / self.macs_mean


@dataclass(frozen=True)
class ImageSize:
    """Bytes of a firmware image: code and constants, statics, what is set aside for the stack."""

    board: str
    code_bytes: int
    static_bytes: int
    stack_bytes: int


@dataclass(frozen=True)
class BoardRate:
    """The emulated NUCLEO-F767ZI on a scene of two touches: rows and samples measured a frame, the
    time that takes, solve and touches on the board (interrupts included), frames per second, and
    the stack that the firmware used."""

    storage: str
    rows: int
    samples: int
    acquire_us: int
    solve_us_p50: float
    solve_us_worst: int
    rate_hz: float
    stack_used: int

    @property
    def bound(self) -> str:
        """The stage that bounds the frame rate. Single frames whose solve takes longer than a scan
        lower the rate, too, even if the median solve is shorter."""
        return "solve" if self.rate_hz * self.acquire_us < SOLVED_SHARE * 1e6 else "acquisition"


@dataclass(frozen=True)
class BoardCost:
    """All that ``eitskin bench board`` measures."""

    scenes: int
    seed: int
    compiler: str
    qemu: str
    costs: tuple[ConfigurationCost, ...]
    images: tuple[ImageSize, ...]
    rates: tuple[BoardRate, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        values = asdict(self)
        for cost, entry in zip(self.costs, values["costs"], strict=True):
            entry |= {"mean": cost.mean, "per_mac": cost.per_mac}
        for rate, entry in zip(self.rates, values["rates"], strict=True):
            entry["bound"] = rate.bound
        return values


def run(
    scenes: int,
    seed: int,
    *,
    frames: int = 8,
    build: Path | None = None,
    progress: Progress = silent,
) -> BoardCost:
    """Build, run ``scenes`` random scenes in every storage, cold and warm, and ``frames`` frames on
    the emulated board (0: none).

    ``build`` is where an earlier build may be, and this one stays; without it, a folder that is
    removed.

    Raises:
        UsageError: no checkout, a tool is missing, or the build fails.
        MissingExtraError: the mesher, or for ``frames`` the emulator, is not installed.
    """
    root = checkout_root()
    need_tools("arm-none-eabi-gcc", "qemu-system-arm", "cmake", "ninja")
    model, _ = load_prebuilt()
    blobs = {
        storage: encode_model(replace(model, stored=store(model.sensitivity, storage)))
        for storage in STORAGES
    }
    session = simulate(
        paper_skin(), adjacent(16), random_touches(paper_skin().outline, seed, scenes, "test")
    )
    with tempfile.TemporaryDirectory(prefix="eitskin-board-") as name:
        folder = Path(name)
        built = build_cortex_m7(root, build or folder / "build", *TARGETS)
        program = built / PROGRAM
        plans = [
            (storage, *how)
            for storage in STORAGES
            for how in ((True, False), (False, False), (False, True))
        ]
        costs = tuple(
            _cost(program, folder, model, blobs, session, *plan) for plan in progress(plans)
        )
        images = tuple(size_of(built / "firmware" / f"{image}.elf") for image in TARGETS[1:])
        rates: tuple[BoardRate, ...] = ()
        if frames:
            image = built / "firmware" / f"{IMAGE}.bin"
            scans = [(storage, check_every) for storage in STORAGES for check_every in (1, 0)]
            rates = tuple(
                measure_rate(blobs[s], s, image, check_every, frames)
                for s, check_every in progress(scans)
            )
    return BoardCost(
        scenes,
        seed,
        _first_line("arm-none-eabi-gcc"),
        _first_line("qemu-system-arm"),
        costs,
        images,
        rates,
    )


def _first_line(tool: str) -> str:
    done = subprocess.run([tool, "--version"], capture_output=True, text=True, check=True)
    return re.sub(r" emulator version|\s*\([^)]*\)", "", done.stdout.splitlines()[0])


def _cost(
    program: Path,
    folder: Path,
    model: Model,
    blobs: dict[str, bytes],
    session: Simulated,
    storage: str,
    portable: bool,
    warm: bool,
) -> ConfigurationCost:
    options: Options = replace(default_options(model), warm_start=warm)
    blob = blobs[storage]
    done = run_frames(
        program, folder, blob, session.untouched_v, session.frames_v, options, portable=portable
    )
    each = np.sort([frame.instructions for frame in done.frames])
    return ConfigurationCost(
        storage=storage,
        kernels=done.kernels,
        warm=warm,
        solve_mean=float(np.mean([frame.solve_instructions for frame in done.frames])),
        touches_mean=float(np.mean([frame.touch_instructions for frame in done.frames])),
        gestures_most=max(frame.gesture_instructions for frame in done.frames),
        worst=int(each[-1]),
        worst_tenth=float(each[-max(1, len(each) // 10) :].mean()),
        macs_mean=float(np.mean([frame.macs for frame in done.frames])),
        model_bytes=len(blob),
        workspace_bytes=done.workspace_bytes,
        stack_bytes=max(frame.stack_bytes for frame in done.frames),
    )


def size_of(elf: Path) -> ImageSize:
    """The sizes of an image.

    Raises:
        UsageError: there are no tools for it.
    """
    tool = shutil.which("arm-none-eabi-size")
    if tool is None:
        raise UsageError("missing arm-none-eabi-size; scripts/test installs it")
    done = subprocess.run([tool, "-A", str(elf)], capture_output=True, text=True, check=True)
    sizes = {
        name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)\s+\d+$", done.stdout, re.M)
    }
    code, statics = (sum(sizes.get(name, 0) for name in names) for names in (CODE, STATICS))
    return ImageSize(elf.stem.removeprefix("eitskin_"), code, statics, sizes.get(STACK, 0))


def measure_rate(
    blob: bytes, storage: str, image: Path, check_every: int, frames: int
) -> BoardRate:
    """Let the emulated board with the firmware ``image`` solve ``frames`` frames; ``check_every``
    as in ``ScanSettings``.

    Raises:
        MissingExtraError: the emulator is not installed.
        DeviceError: the board gives no frames.
    """
    from eitskin.device.open import open_device
    from eitskin.device.settings import ScanSettings, apply_scan
    from eitskin.device.wire.link_table import Stream
    from eitskin.session.assemble import read_frames
    from eitskin.session.frame import Frame
    from eitskin.session.set_up import begin_scene, take_reference

    solved: list[tuple[int, int]] = []
    with open_device(SCENE, model=blob, image=image) as device:
        apply_scan(device, ScanSettings(check_every=check_every))
        take_reference(device, TARE_FRAMES)
        begin_scene(device)
        for item in read_frames(device, Stream.TOUCHES, every=1, frames=frames):
            if isinstance(item, Frame) and item.info is not None:
                solved.append((item.time_us, item.info.solve_us + item.info.touch_us))
        stats, info = device.stats(), device.board
    times, costs = np.array(solved).T
    rate = 1e6 * (len(times) - 1) / float(times[-1] - times[0])
    return BoardRate(
        storage, info.measured_rows, info.samples, info.measured_rows * info.slot_us,
        float(np.median(costs)),
        int(costs.max()), rate, stats.stack_used,
    )  # fmt: skip


# ---- tables ----


def _million(value: float) -> str:
    return f"{value / 1e6:.2f}"


def _milliseconds(instructions: float) -> str:
    return f"{1e3 * instructions / CLOCK_HZ:.1f}"


COST_HEAD = (
    "storage", "kernels", "start", "solve", "touches", "mean", "mean of worst 10 %", "worst",
    "MACs", "a MAC", "ms at 216 MHz (estimate)", "model, flash", "workspace, RAM",
)  # fmt: skip
IMAGE_HEAD = ("image", "code and constants", "statics", "set aside for the stack")
RATE_HEAD = (
    "storage", "rows x samples", "acquisition", "solve and touches, p50", "worst",
    "frames a second", "bounded by",
    "stack used",
)  # fmt: skip


def cost_rows(result: BoardCost) -> list[tuple[str, ...]]:
    """The cost table's rows under ``COST_HEAD``; millions of instructions and of MACs, bytes."""
    return [
        (
            c.storage,
            "plain C" if c.kernels == "portable" else "M7",
            "warm" if c.warm else "cold",
            *map(
                _million,
                (c.solve_mean, c.touches_mean, c.mean, c.worst_tenth, c.worst, c.macs_mean),
            ),
            f"{c.per_mac:.2f}",
            _milliseconds(c.mean),
            f"{c.model_bytes}",
            f"{c.workspace_bytes}",
        )
        for c in result.costs
    ]


def image_rows(result: BoardCost) -> list[tuple[str, ...]]:
    """Rows under ``IMAGE_HEAD``."""
    return [
        (i.board, f"{i.code_bytes}", f"{i.static_bytes}", f"{i.stack_bytes or '-'}")
        for i in result.images
    ]


def rate_rows(result: BoardCost) -> list[tuple[str, ...]]:
    """Rows under ``RATE_HEAD``; times in ms."""
    return [
        (
            r.storage, f"{r.rows} x {r.samples}", f"{r.acquire_us / 1e3:.1f} ms",
            f"{r.solve_us_p50 / 1e3:.2f} ms",
            f"{r.solve_us_worst / 1e3:.2f} ms", f"{r.rate_hz:.1f}", r.bound, f"{r.stack_used}",
        )
        for r in result.rates
    ]  # fmt: skip


def as_text(result: BoardCost) -> str:
    """For a terminal."""
    parts = [f"{result.scenes} random scenes, seed {result.seed}; {result.compiler}; {result.qemu}"]
    gestures = max((cost.gestures_most for cost in result.costs), default=0)
    parts.append(f"gestures of a frame: at most {gestures} instructions")
    for head, rows in (
        (COST_HEAD, cost_rows(result)),
        (IMAGE_HEAD, image_rows(result)),
        (RATE_HEAD, rate_rows(result)),
    ):
        if rows:
            parts.append(text_table(head, rows))
    return "\n\n".join(parts)


def for_page(result: BoardCost, command: str) -> Filling:
    """The marks of studies/results/board-cost.md; ``rates`` where the emulated board ran."""
    stack = max(cost.stack_bytes for cost in result.costs if cost.kernels != "portable")
    gestures = max(cost.gestures_most for cost in result.costs)
    run = (
        f"By `{command}`: the prebuilt model with its default options (working set, 60 iterations,"
        f" rank 64), {result.scenes} random scenes of seed {result.seed} (1 to 3 touches, 60 dB),"
        f" {result.compiler}, {result.qemu}. Solve and touches take at most {stack} bytes of stack,"
        f" the gestures of a frame at most {gestures} instructions."
    )
    tables: dict[str, Tabular] = {
        "cost": (COST_HEAD, cost_rows(result)),
        "images": (IMAGE_HEAD, image_rows(result)),
    }
    if result.rates:
        tables["rates"] = (RATE_HEAD, rate_rows(result))
    return {"board-run": run}, tables
