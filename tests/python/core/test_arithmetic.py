"""A core whose compiler changes bits refuses to be built, or to start."""

import subprocess
from pathlib import Path

import pytest
from build_tools import CSRC, ROOT, build_core, run, tool

PROGRAM = """
#include "base/arithmetic.h"
#include <fenv.h>
#ifdef __SSE__
#include <xmmintrin.h>
#endif
int main(void)
{
#if defined(FLUSHED) && defined(__SSE__)
    _mm_setcsr(_mm_getcsr() | 0x8040u);
#elif defined(FLUSHED)
    return 16; /* another processor's way is not known here */
#endif
#ifdef ROUNDING
    fesetround(ROUNDING);
#endif
    eits_real left[EITS_ARITHMETIC_TRIALS];
    eits_try_arithmetic(left);
    return -eits_judge_arithmetic(left);
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
        (["-O2", "-ffp-contract=fast", "FUSED"], 0),  # the source forbids it
        (["-O2", "-ffp-contract=fast", "-DEITS_CONTRACTION_OFF", "FUSED"], ARITHMETIC),
        (["-O2", "-ffp-contract=off", "-fassociative-math", "-fno-signed-zeros",
          "-fno-trapping-math"], ARITHMETIC),
        (["-O2", "-DFLUSHED"], ARITHMETIC),
        (["-O2", "-DROUNDING=FE_UPWARD"], ARITHMETIC),
        (["-O2", "-DROUNDING=FE_TOWARDZERO"], ARITHMETIC),
    ],
)  # fmt: skip
def test_contraction_and_reordered_sums_are_found_at_the_start(tmp_path, flags, status, width):
    """``eits_init`` returns what this program does."""
    if "FUSED" in flags:
        cpu = Path("/proc/cpuinfo").read_text()
        if "fma" not in cpu and "asimd" not in cpu:
            pytest.skip("this processor has no fused multiply-add: nothing can be contracted")
        flags = [flag for flag in flags if flag != "FUSED"] + ["-mfma"] * ("asimd" not in cpu)
    command = compile_with(tmp_path, *flags, *width)
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "program"], check=False).returncode == status


def test_every_source_that_computes_forbids_contraction():
    """Text, copies of bytes and row orders need no arithmetic."""
    without = {"base/texts.c", "base/status.c", "link/link.c", "model/scan_order.c"}
    include = [f"-I{CSRC / 'src'}", f"-I{CSRC / 'include'}"]
    for path in CSRC.glob("src/*/*.c"):
        name = path.relative_to(CSRC / "src").as_posix()
        if name not in without and path.stem not in ("avx2", "m7"):
            used = run(tool("cc", "gcc"), "-MM", *include, path)
            assert "base/arithmetic.h" in used, name


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["-ffast-math"], "without -ffast-math"),
        (["-ffinite-math-only"], "without -ffast-math and -ffinite-math-only"),
        (["-D__FLT_EVAL_METHOD__=2"], "without excess precision"),
        (["-D__FLT_EVAL_METHOD__=1"], "without excess precision"),
    ],
)
def test_what_the_compiler_says_of_its_flags_is_refused(tmp_path, flags, said):
    command = compile_with(tmp_path, *flags)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and said in done.stderr


def test_double_may_be_as_wide_as_the_processor_s_registers_of_double(tmp_path):
    run(*compile_with(tmp_path, "-D__FLT_EVAL_METHOD__=1", "-DEITS_DOUBLE", "-fsyntax-only"))


SELF_TEST = """
#include "eitskin/eitskin.h"
#include <stdio.h>
int main(int count, char **word)
{
    static _Alignas(16) unsigned char blob[1 << 20], workspace[1 << 20];
    FILE *file = fopen(word[count - 1], "rb");
    eits_model model;
    eits_context *ctx;
    eits_real difference = -1;
    if (eits_model_open(&model, blob, fread(blob, 1, sizeof blob, file)) != EITS_OK ||
        eits_init(workspace, sizeof workspace, &model, &ctx) != EITS_OK)
        return 1;
    const int status = eits_self_test(ctx, &difference);
    printf("%g %d\\n", (double)difference, -status);
    return 0;
}
"""
UNFUSED = "#include <math.h>\n#define fmaf(a, b, c) ((a) * (b) + (c))\n"


@pytest.mark.parametrize(
    ("source", "fused", "status"),
    [
        ("base/texts.c", False, 0),  # no arithmetic: as it is
        ("solve/active_set.c", True, ARITHMETIC),
        ("touch/disc_fit.c", False, ARITHMETIC),
        ("frame/reference.c", False, ARITHMETIC),
        ("evidence/likelihood.c", False, ARITHMETIC),
    ],
)
def test_other_arithmetic_in_one_file_is_found_by_the_set_and_not_by_the_one_image(
    tmp_path, source, fused, status
):
    """Its products and sums contracted, or its fused ones taken apart: eits_init sees neither, the
    golden image has the same bits, a checksum of the set has not."""
    cpu = Path("/proc/cpuinfo").read_text()
    if fused and "fma" not in cpu:
        pytest.skip("this processor's compiler has no -mfma: nothing is contracted by it")
    (tmp_path / "main.c").write_text(SELF_TEST)
    (tmp_path / "unfused.h").write_text(UNFUSED)
    flags = (
        ["-ffp-contract=fast", "-DEITS_CONTRACTION_OFF", "-mfma"]
        if fused
        else ["-ffp-contract=off", "-include"]
    )
    flags += [] if fused else [str(tmp_path / "unfused.h")]
    compiler, include = tool("cc", "gcc"), [f"-I{CSRC / 'src'}", f"-I{CSRC / 'include'}"]
    planted, library = tmp_path / "planted.o", build_core() / "libeitskin_f32.a"
    run(compiler, "-O3", "-std=gnu11", *flags, *include, "-c", CSRC / "src" / source, "-o", planted)
    # before the library, so that the linker leaves the library's own out
    files = [tmp_path / "main.c", planted, library, "-lm", "-o", tmp_path / "program"]
    run(compiler, *include, *files)
    model = ROOT / "python" / "eitskin" / "model" / "paper.eitm"
    assert run(tmp_path / "program", model).split() == ["0", str(status)]
