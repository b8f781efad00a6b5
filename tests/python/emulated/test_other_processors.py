"""AArch64, 32-bit ARM and RISC-V give the bits that the host gives; a big-endian one is refused by
the compiler."""

import subprocess
from pathlib import Path

import pytest

from cross_build import ROOT
from frames_of_programs import assert_the_bits_of_the_host

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
    program = built(processor, tmp_path / "build")
    assert_the_bits_of_the_host(program, tmp_path, [f"qemu-{processor}"])


def test_a_big_endian_processor_is_refused():
    command = ["cc", "-fsyntax-only", "-x", "c", "-", "-I", str(ROOT / "csrc" / "include")]
    command += ["-U__BYTE_ORDER__", "-D__BYTE_ORDER__=__ORDER_BIG_ENDIAN__"]
    source = "#include <eitskin/eitskin.h>\n"
    done = subprocess.run(command, input=source, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "eitskin reads little-endian models in place; this target is big-endian" in done.stderr
