"""A core whose compiler changes bits refuses to be built, or to start."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from build_tools import CSRC, run, tool

PROGRAM = """
#include "base/arithmetic.h"
int main(void)
{
    eits_real contracted, reordered;
    eits_try_arithmetic(&contracted, &reordered);
    return -eits_judge_arithmetic(contracted, reordered);
}
"""
ARITHMETIC = 16  # -EITS_E_ARITHMETIC


def compile_with(folder: Path, *flags: str) -> list[str]:
    (folder / "main.c").write_text(PROGRAM)
    sources = [str(folder / "main.c"), str(CSRC / "src" / "base" / "arithmetic.c")]
    include = [f"-I{CSRC / 'src'}", f"-I{CSRC / 'include'}"]
    return [tool("cc", "gcc"), "-std=gnu11", *flags, *include, *sources, "-lm", "-o", "program"]


@pytest.mark.parametrize("width", [[], ["-DEITS_DOUBLE"]], ids=["float", "double"])
@pytest.mark.parametrize(
    ("flags", "status"),
    [
        (["-O2", "-ffp-contract=off"], 0),
        (["-O0"], 0),
        (["-O2", "-ffp-contract=fast", "FUSED"], ARITHMETIC),
        (["-O2", "-ffp-contract=off", "-fassociative-math", "-fno-signed-zeros",
          "-fno-trapping-math"], ARITHMETIC),
    ],
)  # fmt: skip
def test_contraction_and_reordered_sums_are_found_at_the_start(
    tmp_path: Path, flags: list[str], status: int, width: list[str]
) -> None:
    """``eits_init`` returns what this program does."""
    if "FUSED" in flags:
        cpu = Path("/proc/cpuinfo").read_text()
        if "fma" not in cpu and "asimd" not in cpu:
            pytest.skip("this processor has no fused multiply-add: nothing can be contracted")
        flags = [flag for flag in flags if flag != "FUSED"] + ["-mfma"] * ("asimd" not in cpu)
    command = compile_with(tmp_path, *flags, *width)
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "program"], check=False).returncode == status


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["-ffast-math"], "without -ffast-math"),
        (["-ffinite-math-only"], "without -ffast-math and -ffinite-math-only"),
        (["-D__FLT_EVAL_METHOD__=2"], "without excess precision"),
        (["-D__FLT_EVAL_METHOD__=1"], "without excess precision"),
    ],
)
def test_what_the_compiler_says_of_its_flags_is_refused(
    tmp_path: Path, flags: list[str], said: str
) -> None:
    done = subprocess.run(
        compile_with(tmp_path, *flags), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0 and said in done.stderr


def test_double_may_be_as_wide_as_the_processor_s_registers_of_double(tmp_path: Path) -> None:
    run(*compile_with(tmp_path, "-D__FLT_EVAL_METHOD__=1", "-DEITS_DOUBLE", "-fsyntax-only"))
