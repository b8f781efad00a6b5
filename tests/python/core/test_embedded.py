"""The results of scripts/embed: one file, and a package for Arduino, PlatformIO, ESP-IDF
and Zephyr. The toolchains of these are not here: their rules are read by stand-ins, and the sources
are compiled by the processor's own compiler."""

import json
import platform
import re
import subprocess
from pathlib import Path

import pytest
from build_tools import ROOT, run, tool

from eitskin.model.options import default_options
from eitskin.model.prebuilt import load_prebuilt
from eitskin_emulator.core_on_qemu import run_steps
from eitskin_emulator.core_steps import Choose, Load, Play, TareStep
from frames_of_programs import assert_the_bits_of_the_host
from small_models import session

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


def amalgamated(compiler: str, flags: list[str], made: Path, folder: Path) -> Path:
    one = made / "amalgamation"
    include = [f"-I{one}", f"-I{ROOT / 'csrc' / 'include'}"]
    program = folder / "frames"
    run(compiler, *flags, *include, one / "eitskin.c", PROGRAM, "-lm", "-o", program)
    return program


def test_one_file_gives_the_bits_of_the_library(made, tmp_path):
    """Although the compiler is asked to contract."""
    flags = ["-O1", "-fexpensive-optimizations", "-std=gnu11", "-ffp-contract=fast", *fused()]
    program = amalgamated(tool("gcc", "cc"), flags, made, tmp_path)
    assert_the_bits_of_the_host(program, tmp_path, ["env"], most=4)


@pytest.mark.long("the same by gcc")
def test_one_file_gives_the_bits_by_clang(made, tmp_path):
    program = amalgamated(tool("clang"), ["-O3", "-std=gnu11", *fused()], made, tmp_path)
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


def test_it_writes_over_nothing(made):
    done = subprocess.run(
        [ROOT / "scripts" / "embed", made], capture_output=True, text=True, check=False
    )
    assert done.returncode != 0 and "exists already" in done.stderr
