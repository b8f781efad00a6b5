"""The results of scripts/embed: one file, and a package for Arduino, PlatformIO, ESP-IDF
and Zephyr. The toolchains of these are not here: their rules are read by stand-ins, and the sources
are compiled by the processor's own compiler."""

import json
import math
import platform
import re
import subprocess
from pathlib import Path

import pytest
from build_tools import ROOT, run, tool

from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor
from eitskin_emulator.core_on_qemu import run_steps
from eitskin_emulator.core_steps import Choose, Load, Play, TareStep
from frames_of_programs import assert_the_bits_of_the_host
from small_models import session, small_blob

PROGRAM = ROOT / "tests" / "emulated" / "frames_m7.c"
MODEL = ROOT / "python" / "eitskin" / "model" / "paper.eitm"
LIKE_ARDUINO = ["-Os", "-std=gnu11", "-ffunction-sections", "-w"]  # no word on contraction
M4F = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
M4F += ["-mfp16-format=ieee"]
M33 = ["-mcpu=cortex-m33", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard"]
M33 += ["-mfp16-format=ieee"]
RV32 = ["-march=rv32imafc", "-mabi=ilp32f", "--specs=picolibc.specs"]


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("embedded")
    run(ROOT / "scripts" / "embed", folder / "out", "--model", MODEL)
    return folder / "out"


def fused() -> list[str]:
    """The flag for fused multiply-adds, which a compiler would contract to."""
    return ["-mfma"] if platform.machine() in ("x86_64", "AMD64") else []


def with_frames(compiler: str, flags: list[str], core: Path, folder: Path) -> Path:
    include = [f"-I{core.parent}", f"-I{ROOT / 'csrc' / 'include'}"]
    program = folder / "frames"
    run(compiler, *flags, *include, core, PROGRAM, "-lm", "-o", program)
    return program


CONTRACTED = ["-O1", "-fexpensive-optimizations", "-std=gnu11", "-ffp-contract=fast", *fused()]


@pytest.fixture(scope="module")
def one_object(made) -> Path:
    """The amalgamation, compiled by a compiler that is asked to contract."""
    one = made / "amalgamation" / "eitskin.o"
    run(tool("gcc", "cc"), *CONTRACTED, "-c", one.with_suffix(".c"), "-o", one)
    return one


def test_one_file_gives_the_bits_of_the_library(one_object, tmp_path):
    """Although the compiler is asked to contract."""
    program = with_frames(tool("gcc", "cc"), CONTRACTED, one_object, tmp_path)
    assert_the_bits_of_the_host(program, tmp_path, ["env"], most=4)


def test_the_stream_of_a_firmware_follows_its_touches(one_object, tmp_path):
    """From static memory: a touch is reported after a drive of the frame in which it landed, and
    keeps its id and the golden frame's place."""
    source, program = ROOT / "examples" / "c" / "stream.c", tmp_path / "stream"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{one_object.parent}"]
    run(tool("gcc", "cc"), *flags, source, one_object, "-lm", "-o", program)
    untouched, *frames = re.split(r"^frame \d+: ", run(program), flags=re.MULTILINE)[1:]
    assert re.search(r"^0 touches\nframe 1, drive \d+: a touch at ", untouched)
    model, _ = load_prebuilt()
    skin = Reconstructor(model)
    skin.tare(model.golden.reference_v)
    places = {(touch.x_mm, touch.y_mm) for touch in skin.reconstruct(model.golden.frame_v).touches}
    seen = []
    for text in frames:
        found = re.findall(r"^touch (\d+): \((\S+), (\S+)\) mm", text, re.MULTILINE)
        assert len(found) == len(places) == 2
        seen.append({one: (float(x), float(y)) for one, x, y in found})
        for place in seen[-1].values():
            assert min(math.dist(place, other) for other in places) < 4
    assert all(ids.keys() == seen[0].keys() for ids in seen) and len(seen) == 5


def test_mistakes_get_the_answers_of_the_page(one_object, tmp_path):
    """Those of "Calls that fail", in its order."""
    source, program = Path(__file__).parent / "misuse.c", tmp_path / "misuse"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{one_object.parent}"]
    run(tool("gcc", "cc"), *flags, source, one_object, "-lm", "-o", program)
    said = [line.rsplit(": ", 1) for line in run(program).splitlines()]
    numbers = {what: int(number) for what, number in said if not what.startswith("touches")}
    assert [number for what, number in said if what.startswith("touches")] == ["0"] * 4
    assert numbers.pop("masked") == numbers.pop("diagnosed") == 1
    types = (ROOT / "csrc" / "include" / "eitskin" / "types.h").read_text()
    status = {name: int(n) for name, n in re.findall(r"(EITS_\w+) = (-?\d+)", types)}
    page = (ROOT / "docs" / "reference" / "c-api.md").read_text(encoding="utf-8")
    answered = {
        name
        for line in page.split("## Calls that fail")[1].split("## Memory")[0].splitlines()
        if line.startswith("| ")
        for name in re.findall(r"`(EITS_(?:OK|E_\w+))`", line)
    }
    assert {status[name] for name in answered} == set(numbers.values())
    expected = {
        "unaligned": "EITS_E_MODEL_ALIGNMENT",
        "cut": "EITS_E_MODEL_TRUNCATED",
        "changed": "EITS_E_MODEL_CRC",
        "small workspace": "EITS_E_WORKSPACE",
        "unaligned workspace": "EITS_E_WORKSPACE",
        "begin with 3": "EITS_E_ARGUMENT",
        "add without begin": "EITS_E_ARGUMENT",
        "finish without begin": "EITS_E_REFERENCE_SHORT",
        "finish too early": "EITS_E_REFERENCE_SHORT",
        "no reference": "EITS_E_NO_REFERENCE",
        "length": "EITS_E_FRAME_LENGTH",
        "NaN in a row": "EITS_OK",
        "NaN": "EITS_E_FRAME_ROWS",
        "zeros": "EITS_E_FRAME_ZERO",
        "mV": "EITS_OK",
        "option": "EITS_E_ARGUMENT",
        "row": "EITS_E_ARGUMENT",
        "tracker without noise": "EITS_E_REFERENCE_SHORT",
    }
    assert numbers == {what: status[name] for what, name in expected.items()}


@pytest.mark.long("the same by gcc")
def test_one_file_gives_the_bits_by_clang(made, tmp_path):
    core = made / "amalgamation" / "eitskin.c"
    program = with_frames(tool("clang"), ["-O3", "-std=gnu11", *fused()], core, tmp_path)
    assert_the_bits_of_the_host(program, tmp_path, ["env"])


def test_the_package_names_what_it_holds(made):
    package = made / "eitskin"
    held = {path.relative_to(package).as_posix() for path in package.glob("src/**/*.c")}
    for name, before in (("CMakeLists.txt", ""), ("zephyr/CMakeLists.txt", "../")):
        text = (package / name).read_text()
        listed = re.findall(rf"^    {re.escape(before)}(src/\S+\.c)\)?$", text, re.M)
        assert set(listed) == held and len(listed) == len(held) > 80
        assert "-ffp-contract=off" in text and "@" not in text
    facts = json.loads((package / "library.json").read_text())
    properties = dict(
        line.split("=", 1) for line in (package / "library.properties").read_text().splitlines()
    )
    assert facts["name"] == properties["name"] == "eitskin"
    assert facts["version"] == properties["version"]
    assert not any("avx2" in path.name for path in package.rglob("*"))


SERIAL = """
struct Port { void begin(long) {} template <class T> void print(T) {}
              template <class T> void println(T) {} };
static Port Serial;
"""


def test_the_sketch_compiles(made, tmp_path):
    (tmp_path / "sketch.cpp").write_text(
        f'{SERIAL}#include "{made}/eitskin/examples/Touches/Touches.ino"\n'
        "int main() { setup(); loop(); }\n"
    )
    run(tool("g++"), "-fsyntax-only", f"-I{made}/eitskin/src", tmp_path / "sketch.cpp")


STANDINS = {
    "esp-idf": """
function(idf_component_register)
    cmake_parse_arguments(C "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
    add_library(component STATIC ${C_SRCS})
    target_include_directories(component PUBLIC ${C_INCLUDE_DIRS})
    set(COMPONENT_LIB component PARENT_SCOPE)
endfunction()
include(PACKAGE/CMakeLists.txt)
""",
    "zephyr": """
set(CONFIG_EITSKIN y)
function(zephyr_library_named name)
    add_library(${name} STATIC)
    set(ZEPHYR_LIBRARY ${name} PARENT_SCOPE)
endfunction()
function(zephyr_library_sources)
    target_sources(${ZEPHYR_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_include_directories)
    target_include_directories(${ZEPHYR_LIBRARY} PUBLIC ${ARGN})
endfunction()
function(zephyr_library_compile_options)
    target_compile_options(${ZEPHYR_LIBRARY} PRIVATE ${ARGN})
endfunction()
add_subdirectory(PACKAGE/zephyr module)
""",
}


@pytest.mark.long(
    "test_the_package_names_what_it_holds, test_one_file_gives_the_bits_of_the_library"
)
@pytest.mark.parametrize(
    ("system", "compiler", "flags"),
    [("esp-idf", "riscv64-unknown-elf-gcc", RV32), ("zephyr", "arm-none-eabi-gcc", M33)],
)
def test_the_package_builds_by_the_rules_of(system, compiler, flags, made, tmp_path):
    rules = STANDINS[system].replace("PACKAGE", str(made / "eitskin"))
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.25)\nproject(standin LANGUAGES C)\n{rules}"
    )
    if system == "esp-idf":  # whose list is relative to the component
        (tmp_path / "src").symlink_to(made / "eitskin" / "src")
    cross = ["-DCMAKE_SYSTEM_NAME=Generic", f"-DCMAKE_C_COMPILER={tool(compiler)}"]
    cross += [
        "-DCMAKE_TRY_COMPILE_TARGET_TYPE=STATIC_LIBRARY",
        f"-DCMAKE_C_FLAGS={' '.join(flags)}",
    ]
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-G", "Ninja", *cross)
    run("cmake", "--build", tmp_path / "b")


@pytest.mark.long("test_the_sketch_compiles, test_the_package_names_what_it_holds")
def test_every_file_compiles_as_in_a_sketch(made, tmp_path):
    """With Arduino's flags for a Cortex-M4F, which say nothing of contraction; the FPU's kernels
    are chosen."""
    objects = []
    for path in (made / "eitskin" / "src").glob("**/*.c"):
        objects.append(tmp_path / f"{path.parent.name}_{path.stem}.o")
        flags = [*LIKE_ARDUINO, *M4F, f"-I{made / 'eitskin' / 'src'}"]
        run(tool("arm-none-eabi-gcc"), *flags, "-c", path, "-o", objects[-1])
    names = run("arm-none-eabi-nm", *objects)
    assert re.search(r" [RrDd] eits_kernels_m7", names)


MPS2 = ROOT / "firmware" / "boards" / "mps2_an500"
SEMIHOSTING = ["-nographic", "-monitor", "none", "-semihosting-config", "enable=on,target=native"]
BARE = ["-O3", *LIKE_ARDUINO[1:], "-fdata-sections", "-Wl,--gc-sections"]


def on_arm(machine: str) -> list[str]:
    return ["qemu-system-arm", "-M", machine, *SEMIHOSTING]


# standard output is standard error's under QEMU's RISC-V semihosting
ON_RV32 = ["sh", "-c", '"$@" 2>&1', "x", "qemu-system-riscv32", "-M", "virt", "-bios", "none"]
ON_RV32 += ["-m", "64M", *SEMIHOSTING]
RV32_MEMORY = {"flash": 0x80000000, "flash_size": 0x400000, "ram": 0x80400000,
               "ram_size": 0x1000000}  # fmt: skip
RV32_LINKED = [*RV32, "--oslib=semihost", "--crt0=hosted"]
RV32_LINKED += [f"-Wl,--defsym=__{name}={value}" for name, value in RV32_MEMORY.items()]
M7 = ["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard", "-mfp16-format=ieee"]
PROCESSORS = {
    "cortex-m4f": ("arm-none-eabi-gcc", M4F, on_arm("mps2-an386"), "cortex-m7"),
    "cortex-m7": ("arm-none-eabi-gcc", M7, on_arm("mps2-an500"), "cortex-m7"),
    "cortex-m33": ("arm-none-eabi-gcc", M33, on_arm("mps2-an505"), "cortex-m7"),
    "rv32imafc": ("riscv64-unknown-elf-gcc", RV32_LINKED, ON_RV32, "portable"),
    "aarch64": ("aarch64-linux-gnu-gcc", ["-static"], ["qemu-aarch64"], "portable"),
    "x86-64": ("gcc", ["-static"], ["qemu-x86_64", "-cpu", "max"], "portable"),
}


@pytest.mark.long("test_one_file_gives_the_bits_of_the_library")
@pytest.mark.parametrize("processor", PROCESSORS)
def test_the_package_gives_the_bits_and_costs(processor, made, tmp_path):
    """Prints the instructions per frame that stand in docs/guide/embedding.md: those of ten frames
    more (pytest -rP)."""
    compiler, flags, emulator, kernels = PROCESSORS[processor]
    source, program = made / "eitskin" / "src", tmp_path / "frames"
    files = [*source.glob("**/*.c"), PROGRAM]
    if compiler == "arm-none-eabi-gcc":
        script = (MPS2 / "mps2_an500.ld").read_text()
        if processor == "cortex-m33":  # whose secure memory is elsewhere
            script = script.replace("0x00000000, LENGTH", "0x10000000, LENGTH")
            script = script.replace("0x20000000, LENGTH = 4M", "0x80000000, LENGTH = 16M")
        (tmp_path / "memory.ld").write_text(script)
        files.append(MPS2 / "startup.c")
        flags = [*flags, "-nostartfiles", "--specs=rdimon.specs", f"-T{tmp_path / 'memory.ld'}"]
    run(tool(compiler), *flags, *BARE, f"-I{source}", *files, "-lm", "-o", program)
    plugin = tmp_path / "libcount.so"
    run("gcc", "-shared", "-fPIC", ROOT / "tests" / "tools" / "count_plugin.c", "-o", plugin)
    counted = [*emulator, "-plugin", str(plugin)]
    counted += ["-kernel"] if "qemu-system" in " ".join(emulator) else []
    assert_the_bits_of_the_host(program, tmp_path, counted, kernels)
    model, blob = load_prebuilt()
    frames, untouched = session().frames_v[:12], session().untouched_v[:16]
    totals = []
    for count in (2, 12):
        steps = (Load(blob), Choose(default_options(model)), TareStep(untouched))
        run_steps(program, tmp_path, (*steps, Play(frames[:count])), emulator=counted)
        totals.append(int((tmp_path / "count.txt").read_text()))
    print(f"{processor}: {(totals[1] - totals[0]) / 10:.0f} instructions per frame")
    assert totals[1] - totals[0] > 1_000_000


SIZES = """
#include "eitskin_model.h"
#include <stdio.h>
int main(void)
{
    static eits_model m;
    return eits_model_open(&m, eitskin_model, sizeof eitskin_model) != EITS_OK ||
           EITSKIN_MODEL_ROWS != m.n_rows || EITSKIN_MODEL_TRACKER != eits_fast_size(&m) ||
           EITSKIN_MODEL_WORKSPACE != eits_workspace_size(&m, 0);
}
"""


@pytest.mark.parametrize("data", ["difference", "normalised"])
def test_the_sizes_of_a_model_are_those_that_the_core_counts(data, one_object, tmp_path):
    """Also without fields, where the tracker has no drives."""
    (tmp_path / "m.eitm").write_bytes(small_blob("i8", data))
    (tmp_path / "sizes.c").write_text(SIZES)
    run(ROOT / "scripts" / "embed", tmp_path / "out", "--model", tmp_path / "m.eitm")
    include = f"-I{tmp_path / 'out' / 'amalgamation'}"
    run(tool("gcc", "cc"), include, tmp_path / "sizes.c", one_object, "-lm", "-o", tmp_path / "s")
    run(tmp_path / "s")


@pytest.mark.parametrize(
    "page", ["README.md", "docs/guide/embedding.md", "docs/reference/c-api.md"]
)
def test_a_page_has_the_flash_of_the_prebuilt_model(page):
    """As stored, and with S as i8, which then has scales, too."""
    blob = MODEL.read_bytes()
    model, _ = load_prebuilt()
    columns = model.stored.columns
    assert columns.itemsize == 4
    narrow = len(blob) - 3 * columns.size + 4 * len(columns)
    text = (ROOT / page).read_text(encoding="utf-8")
    full, small = round(len(blob), -3) // 1000, round(narrow, -3) // 1000
    assert re.search(rf"\b{full}\b.*?\b{small}\b|\b{small}\b.*?\b{full}\b", text), (full, small)


def test_it_writes_over_nothing(made):
    done = subprocess.run(
        [ROOT / "scripts" / "embed", made], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0 and "exists already" in done.stderr
