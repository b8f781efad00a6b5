"""The C core as somebody else uses it: installed, found by CMake and pkg-config, or as a
subproject."""

import re
import shutil
import subprocess
import tarfile
from importlib import resources
from pathlib import Path

import pytest
from build_tools import ROOT, build_core, run

from eitskin.model.prebuilt import load_prebuilt
from eitskin.solve.reconstructor import Reconstructor

EXAMPLES = ROOT / "examples" / "c"


@pytest.fixture(scope="module")
def prefix(tmp_path_factory) -> Path:
    """Install the core, and return the folder."""
    folder = tmp_path_factory.mktemp("installed")
    run("cmake", "--install", build_core(), "--component", "core", "--prefix", folder)
    return folder


@pytest.fixture(scope="module")
def programs(prefix, tmp_path_factory) -> Path:
    """The examples, built by find_package on the installed copy."""
    build = tmp_path_factory.mktemp("examples")
    run("cmake", "-S", EXAMPLES, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", build)
    return build


@pytest.mark.parametrize("program", ["minimal", "minimal_double", "minimal_cpp"])
def test_an_example_finds_the_touches_that_python_finds(programs, program):
    """Both find the touches of the prebuilt model's golden frame."""
    with resources.as_file(resources.files("eitskin.model") / "paper.eitm") as file:
        text = run(programs / program, file)
    model, _ = load_prebuilt()
    skin = Reconstructor(model)
    skin.tare(model.golden.reference_v)
    expected = skin.reconstruct(model.golden.frame_v).touches
    found = re.findall(r"touch \d+: \((\S+), (\S+)\) mm, radius (\S+) mm", text)
    assert len(found) == len(expected) >= 1
    for one, touch in zip(found, expected, strict=True):
        known = touch.x_mm, touch.y_mm, touch.radius_mm
        assert tuple(map(float, one)) == pytest.approx(known, abs=0.06)  # printed to 0.1 mm


def test_an_example_says_what_is_wrong_with_a_file(programs, tmp_path):
    (tmp_path / "no.eitm").write_bytes(b"not a model" * 20)
    done = subprocess.run(
        [programs / "minimal", tmp_path / "no.eitm"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "not an .eitm model" in done.stderr


def test_pkg_config_gives_what_a_compiler_needs(prefix, tmp_path):
    """Also from a prefix that was moved."""
    prefix = shutil.copytree(prefix, tmp_path / "elsewhere")
    tool = shutil.which("pkg-config")
    assert tool, "pkg-config is missing; install it:  apt-get install pkgconf"
    for name in ("eitskin", "eitskin64"):
        flags = run(
            "env", f"PKG_CONFIG_PATH={prefix}/lib/pkgconfig", tool, "--cflags", "--libs", name
        )
        run("cc", EXAMPLES / "minimal.c", "-o", tmp_path / name, *flags.split())


def test_as_a_subproject_it_brings_neither_tests_nor_werror(tmp_path):
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(user LANGUAGES C)\n"
        f'add_subdirectory("{ROOT}" eitskin)\n'
        f'add_executable(user "{EXAMPLES}/minimal.c")\n'
        "target_link_libraries(user PRIVATE eitskin::core)\n"
    )
    run("cmake", "-S", tmp_path, "-B", tmp_path / "build", "-G", "Ninja")
    rules = (tmp_path / "build" / "build.ninja").read_text()
    assert "csrc/src/solve/fista.c" in rules
    assert "-Werror" not in rules
    assert "tests/c" not in rules
    assert "firmware" not in rules


BARE_METAL = """
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_C_FLAGS_INIT "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -mthumb")
"""


def test_a_project_for_a_microcontroller_gets_the_core_and_its_kernels(tmp_path):
    """By its own toolchain file; no program of eitskin is built beside it, with another board's
    memory map."""
    (tmp_path / "board.cmake").write_text(BARE_METAL)
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(user LANGUAGES C)\nset(EITSKIN_M7 ON)\n"
        f'add_subdirectory("{ROOT}" eitskin)\n'
        f'add_library(user STATIC "{EXAMPLES}/minimal.c")\n'
        "target_link_libraries(user PRIVATE eitskin::core)\n"
    )
    toolchain = f"-DCMAKE_TOOLCHAIN_FILE={tmp_path / 'board.cmake'}"
    run("cmake", "-S", tmp_path, "-B", tmp_path / "build", "-G", "Ninja", toolchain)
    built = run("cmake", "--build", tmp_path / "build", "--", "-n", "-v")
    assert "csrc/src/solve/fista.c" in built and "csrc/src/kernels/m7.c" in built
    assert ".elf" not in built and "mps2" not in built and "fw_app" not in built


def test_fetched_content_is_the_core_alone(tmp_path):
    """From an archive, as from a repository."""
    archive = tmp_path / "eitskin.tar.gz"
    with tarfile.open(archive, "w:gz", compresslevel=1) as tar:
        for name in ("CMakeLists.txt", "cmake", "csrc"):
            tar.add(ROOT / name, f"eitskin/{name}")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(user LANGUAGES C)\ninclude(FetchContent)\n"
        f"FetchContent_Declare(eitskin URL {archive} DOWNLOAD_EXTRACT_TIMESTAMP ON)\n"
        "FetchContent_MakeAvailable(eitskin)\n"
        f'add_executable(user "{EXAMPLES}/minimal.c")\n'
        "target_link_libraries(user PRIVATE eitskin::core)\n"
    )
    run("cmake", "-S", tmp_path, "-B", tmp_path / "build", "-G", "Ninja")
    rules = (tmp_path / "build" / "build.ninja").read_text()
    assert "csrc/src/solve/fista.c" in rules and "fw_app" not in rules and "-Werror" not in rules


def test_memory_table_of_the_page_is_what_the_macros_give(programs):
    page = (ROOT / "docs" / "reference" / "c-api.md").read_text(encoding="utf-8")
    for row in run(programs / "memory").splitlines():
        assert row in page, f"docs/reference/c-api.md lacks the row  {row}"
