"""AArch64, 32-bit ARM and RISC-V give the bits that the host gives; a big-endian one is refused by
the compiler."""

import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cross_build import ROOT
from eitskin.core.engine import CoreEngine
from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin_emulator.core_on_qemu import run_steps
from eitskin_emulator.core_steps import Choose, Load, Play, Step, TareStep
from printed_touches import printed_touches
from small_models import session

COMPILERS = {
    "aarch64": "aarch64-linux-gnu-",
    "arm": "arm-linux-gnueabihf-",
    "riscv64": "riscv64-linux-gnu-",
}


def built(processor: str, folder: Path) -> Path:
    """The program of tests/emulated for that processor's Linux."""
    made = ["-DCMAKE_SYSTEM_NAME=Linux", f"-DCMAKE_SYSTEM_PROCESSOR={processor}"]
    made += [f"-DCMAKE_C_COMPILER={COMPILERS[processor]}gcc", "-DEITSKIN_TESTS=OFF"]
    for command in (
        ["cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja", *made],
        ["cmake", "--build", str(folder), "--target", "frames_m7"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder / "tests" / "emulated" / "frames_m7"


@pytest.mark.long("the same bits on the Cortex-M7")
@pytest.mark.parametrize("processor", COMPILERS)
def test_the_same_bits_as_the_host(processor, tmp_path):
    """Ten frames of up to three touches by three solvers, cold and warm, tracked, with an electrode
    lost and with no touch: solve, touches, their test and tracks."""
    model, blob = load_prebuilt()
    random = session()
    frames = np.concatenate([random.frames_v[:8], random.frames_v[:2]])
    frames[2, (model.protocol.drive_measure == 6).any(axis=1)] = np.nan
    frames[3] = random.untouched_v.mean(axis=0)
    usual = default_options(model)
    ways = [
        usual,
        replace(usual, solver="active-set", sign="both", second_pass=True),
        replace(usual, solver="working-set", warm_start=True, track_confirm=2, track_hold=3),
    ]
    steps: list[Step] = []
    expected = []
    for options in ways:
        steps += [Load(blob), Choose(options), TareStep(random.untouched_v[:16]), Play(frames)]
        host = CoreEngine(blob)
        host.set_options(options)
        host.set_reference(random.untouched_v[:16].astype(np.float32).astype(np.float64))
        results = [host.reconstruct(frame.astype(np.float32)) for frame in frames]
        expected += [
            (zlib.crc32(r.solver_image.tobytes()), printed_touches(r.touches)) for r in results
        ]
    program = built(processor, tmp_path / "build")
    done = run_steps(program, tmp_path, steps, emulator=[f"qemu-{processor}"])
    assert done.kernels == "portable"
    assert [(frame.image_crc, frame.touches) for frame in done.frames] == expected
    assert sum(touches[0] != "0" for _, touches in expected) > len(expected) // 2


def test_a_big_endian_processor_is_refused():
    command = ["cc", "-fsyntax-only", "-x", "c", "-", "-I", str(ROOT / "csrc" / "include")]
    command += ["-U__BYTE_ORDER__", "-D__BYTE_ORDER__=__ORDER_BIG_ENDIAN__"]
    source = "#include <eitskin/eitskin.h>\n"
    done = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "eitskin reads little-endian models in place; this target is big-endian" in done.stderr
