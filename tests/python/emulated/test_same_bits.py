"""The Cortex-M7, under QEMU, gives the bits that the host gives: images and touches, all storages, with faults and warm starts.

The same program prints exact instruction counts (-icount), and they are held to their bound; pytest -s shows them.
"""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from eitskin.core.engine import CoreEngine
from eitskin.core.results import SIGNS, SOLVERS, STOPS, Options, Reconstruction
from eitskin.model.eitm import encode_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_prebuilt
from eitskin.model.storage import STORAGES, store
from eitskin.scene.random_touches import Scene, Touch, TouchSet
from eitskin.scene.simulate import simulate
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.solve.options import default_options
from small_models import session as simulated_session
from small_models import small, small_blob, small_model

ROOT = Path(__file__).resolve().parents[3]
TOOLS = ("arm-none-eabi-gcc", "qemu-system-arm", "cmake", "ninja")
LINE = re.compile(
    r"frame (\d+) status (-?\d+) stop (\d) iterations (\d+) macs (\d+) solve (\d+) touch (\d+) "
    r"image ([0-9a-f]{8}) touches (\d+)(.*)"
)


@dataclass(frozen=True)
class Emulated:
    """One frame as the emulated board printed it."""

    status: int
    stop: str
    iterations: int
    macs: int
    solve_instructions: int
    touch_instructions: int
    image_crc: int
    touches: str


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    absent = [tool for tool in TOOLS if shutil.which(tool) is None]
    assert not absent, f"missing {', '.join(absent)}: scripts/test installs them"
    build = tmp_path_factory.mktemp("m7")
    toolchain = ROOT / "cmake" / "arm-cortex-m7.cmake"
    configure = ["cmake", "-S", str(ROOT), "-B", str(build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"]
    for command in ([*configure, f"-DCMAKE_TOOLCHAIN_FILE={toolchain}", "-DEITSKIN_TESTS=OFF"], ["cmake", "--build", str(build)]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return build / "tests" / "emulated" / "frames_m7.elf"


def run(
    program: Path, folder: Path, blob: bytes, quiet: np.ndarray, frames: np.ndarray, options: Options
) -> list[Emulated]:
    """The emulated board's results for ``frames`` (k, m) after taring on ``quiet`` (q, m).

    Of ``options``, those that the program takes: warm start, sign and solver; all others are the model's defaults.
    """
    (folder / "model.eitm").write_bytes(blob)
    chosen = int(options.warm_start), SIGNS.index(options.sign), SOLVERS.index(options.solver)
    (folder / "plan.txt").write_text(" ".join(map(str, (len(quiet), len(frames), *chosen))) + "\n")
    (folder / "frames.f32").write_bytes(np.vstack([quiet, frames]).astype("<f4").tobytes())
    command = ["qemu-system-arm", "-M", "mps2-an500", "-nographic", "-monitor", "none", "-semihosting-config"]
    command += ["enable=on,target=native", "-icount", "shift=6", "-kernel", str(program)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL)
    found = [LINE.match(line) for line in done.stdout.splitlines() if line.startswith("frame")]
    assert done.returncode == 0 and len(found) == len(frames), done.stdout + done.stderr
    assert "kernels cortex-m7" in done.stdout
    results = []
    for match in found:
        assert match is not None, done.stdout
        g = match.groups()
        results.append(Emulated(int(g[1]), STOPS[int(g[2])], *map(int, g[3:7]), int(g[7], 16), f"{g[8]}{g[9]}"))
    return results


def bits(value: float) -> str:
    return f"{struct.unpack('<I', struct.pack('<f', value))[0]:08x}"


def as_printed(result: Reconstruction) -> str:
    """Touches in the emulated program's words."""
    words = [
        f" {t.id}:" + ":".join(map(bits, (t.x_mm, t.y_mm, t.radius_mm, t.strength_s_per_m_mm2, t.confidence)))
        for t in result.touches
    ]
    return f"{len(words)}{''.join(words)}"


def session(model: Model, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """16 quiet frames and ``count`` frames of one to three touches by the model's own linear answer, with noise at 60 dB."""
    rng = np.random.default_rng(seed)
    reference = model.golden.reference_v.astype(np.float64)
    noise = 1e-3 * np.sqrt(np.mean(reference**2))
    change = model.golden.frame_v.astype(np.float64) - reference
    quiet = reference + noise * rng.standard_normal((16, len(reference)))
    strength = rng.uniform(0.3, 1.5, (count, 1))
    return quiet, reference + strength * change + noise * rng.standard_normal((count, len(reference)))


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("warm", [False, True])
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_same_bits_as_the_host(program: Path, tmp_path: Path, solver: str, storage: str, warm: bool) -> None:
    model, _ = load_prebuilt()
    blob = encode_model(replace(model, stored=store(model.sensitivity, storage)))
    quiet, frames = session(model, 5, 4)
    frames[2, [3, 77]] = np.nan  # two channels lost for one frame
    frames[3] = quiet.mean(axis=0)  # no touch
    host = CoreEngine(blob)
    options = replace(default_options(model), warm_start=warm, solver=solver)
    host.set_options(options)
    host.set_baseline(quiet.astype(np.float32).astype(np.float64))
    board = run(program, tmp_path, blob, quiet, frames, options)
    for frame, emulated in zip(frames, board, strict=True):
        expected = host.reconstruct(frame.astype(np.float32))
        assert emulated.status == 0
        assert emulated.image_crc == zlib.crc32(expected.image.tobytes())
        assert emulated.touches == as_printed(expected)
        assert (emulated.stop, emulated.iterations) == (expected.info.stop, expected.info.iterations)
        assert emulated.macs == expected.info.macs + expected.info.touch_macs
    assert board[0].touches[0] != "0" and board[3].touches == "0"
    assert board[2].image_crc != board[1].image_crc


def test_instructions_are_counted_exactly(program: Path, tmp_path: Path) -> None:
    model, blob = load_prebuilt()
    quiet, frames = session(model, 6, 2)
    for solver in SOLVERS:
        options = replace(default_options(model), solver=solver)
        first = run(program, tmp_path, blob, quiet, frames, options)
        assert first == run(program, tmp_path, blob, quiet, frames, options)
        for result in first:
            per_mac = (result.solve_instructions + result.touch_instructions) / result.macs
            print(f"{solver}: {result.solve_instructions} + {result.touch_instructions} instructions, {per_mac:.2f} a MAC")
            assert per_mac < (3 if "fista" in solver or "working" in solver else 4)


def moving_touches() -> tuple[np.ndarray, np.ndarray]:
    """Quiet frames and 12 frames of two fingers, simulated nonlinearly, that come down at once, move by 2 mm a frame (100 mm/s
    at 48 frames a second) and are joined by a third at frame 6."""
    fingers = [(-50.0, 20.0, 9.0, 6.0), (30.0, -35.0, 11.0, 8.0), (45.0, 45.0, 8.0, 4.0)]
    scenes = tuple(
        Scene(str(k), tuple(Touch(x + 2.0 * k, y, r, c) for x, y, r, c in fingers[: 2 if k < 6 else 3])) for k in range(12)
    )
    simulated = simulate(paper_skin(), adjacent(16), TouchSet("moving", 1, scenes))
    return simulated.quiet_v, simulated.frames_v


MOST_INSTRUCTIONS = 2_500_000


@pytest.mark.parametrize("warm", [False, True])
def test_a_default_frame_costs_at_most_2_5_million_instructions(program: Path, tmp_path: Path, warm: bool) -> None:
    """Solve and touches, each frame, also the first and those where a touch comes: moving touches, and 20 random scenes that
    follow each other without any rest."""
    model, blob = load_prebuilt()
    random = simulated_session()
    for quiet, frames in (moving_touches(), (random.quiet_v, random.frames_v)):
        options = replace(default_options(model), warm_start=warm)
        board = run(program, tmp_path, blob, quiet, frames, options)
        costs = [result.solve_instructions + result.touch_instructions for result in board]
        print(f"{'warm' if warm else 'cold'}: mean {np.mean(costs):.0f}, most {max(costs)} instructions")
        assert all(result.touches[0] in "123" for result in board)
        assert max(costs) <= MOST_INSTRUCTIONS


@pytest.mark.parametrize("sign", ["decrease", "both"])
def test_the_other_signs_too(program: Path, tmp_path: Path, sign: str) -> None:
    model, blob = load_prebuilt()
    quiet, frames = session(model, 7, 2)
    frames[0] = 2 * quiet.mean(axis=0) - frames[0]
    host = CoreEngine(blob)
    options = replace(default_options(model), sign=sign)
    host.set_options(options)
    host.set_baseline(quiet.astype(np.float32).astype(np.float64))
    for frame, emulated in zip(frames, run(program, tmp_path, blob, quiet, frames, options), strict=True):
        expected = host.reconstruct(frame.astype(np.float32))
        assert emulated.image_crc == zlib.crc32(expected.image.tobytes())
        assert emulated.touches == as_printed(expected)


@pytest.mark.parametrize("rank", [5, 16, 37, 48])
@pytest.mark.parametrize("solver", SOLVERS)
def test_ranks_that_no_block_fits(program: Path, tmp_path: Path, solver: str, rank: int) -> None:
    """Rows and columns that the blocks of the processor's own products leave over."""
    model, blob = small_model(rank=rank), small_blob(rank=rank)
    quiet, frames = small().quiet(31, 8), small().frames(30, 3)
    frames[1, 17:25] = np.nan
    options = replace(default_options(model), solver=solver, warm_start=True)
    host = CoreEngine(blob)
    host.set_options(options)
    host.set_baseline(quiet.astype(np.float32).astype(np.float64))
    for frame, emulated in zip(frames, run(program, tmp_path, blob, quiet, frames, options), strict=True):
        expected = host.reconstruct(frame.astype(np.float32))
        assert emulated.image_crc == zlib.crc32(expected.image.tobytes())
        assert emulated.touches == as_printed(expected)
        assert np.abs(expected.image).max() > 0
