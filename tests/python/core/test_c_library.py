"""The C core as a library: functions that it needs from outside, memory that it keeps, names that
it exports; and its sources."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from build_tools import CSRC, build_core, run, tool

SOURCES = sorted((CSRC / "src").rglob("*.[ch]"))
HEADERS = sorted((CSRC / "include" / "eitskin").glob("*.h"))
MAX_LINES = 400
MEMORY = {"memcpy", "memset", "memmove", "memcmp"}
ARITHMETIC = {"f32": {"fmaf", "sqrtf"}, "f64": {"fma", "sqrt"}}
# what a compiler refers to by itself: the processor's features, position-independent code,
# hardening
PROCESSOR = {"__cpu_model", "__cpu_features2", "__cpu_indicator_init"}
LINKING = {"_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail", "__memcpy_chk", "__memset_chk"}
OF_THE_COMPILER = PROCESSOR | LINKING
WIDTHS = ("f32", "f64")


@dataclass(frozen=True)
class Symbol:
    """One line of nm: class as its letter, e.g. "T" code, "U" undefined, "D" data."""

    name: str
    kind: str
    section: str


@pytest.fixture(scope="module")
def libraries() -> dict[str, Path]:
    """Both widths."""
    folder = build_core()
    return {width: folder / f"libeitskin_{width}.a" for width in WIDTHS}


def symbols(library: Path) -> list[Symbol]:
    """All symbols of all members."""
    found = []
    for line in run(tool("nm"), "--format=sysv", library).splitlines():
        words = [word.strip() for word in line.split("|")]
        if len(words) == 7 and words[0] != "Name":
            found.append(Symbol(words[0], words[2], words[6]))
    assert found
    return found


def asked_of_others(library: Path) -> set[str]:
    """Names that the library uses and does not define."""
    names = {kind: {s.name for s in symbols(library) if (s.kind == "U") == kind} for kind in (0, 1)}
    return names[1] - names[0]


def writable(library: Path) -> set[str]:
    """Return the variables that can be written after the start, and the sections that contain such
    bytes. Tables of constant pointers (.data.rel.ro) do not count, because they are only relocated
    once."""
    of_section = {
        f"section {name}"
        for name, size in re.findall(
            r"^\s*\d+\s+(\S+)\s+([0-9a-f]{8,16})\s", run(tool("objdump"), "-h", library), re.M
        )
        if re.match(r"\.t?(data|bss)", name)
        and not name.startswith(".data.rel.ro")
        and int(size, 16) > 0
    }
    return of_section | {
        s.name
        for s in symbols(library)
        if s.kind in "DdBbCcGgSs" and not s.section.startswith(".data.rel.ro")
    }


def shown(library: Path) -> set[str]:
    """Names that a program linked with the library sees."""
    return {s.name for s in symbols(library) if s.kind.isupper() and s.kind != "U"}


@pytest.mark.parametrize("width", WIDTHS)
def test_asks_only_for_memory_moves_and_arithmetic(libraries, width):
    """No malloc, no printf, no file, no clock: nothing but what is listed here."""
    asked = asked_of_others(libraries[width])
    assert asked - OF_THE_COMPILER <= MEMORY | ARITHMETIC[width]
    assert "memcpy" in asked or "memset" in asked  # the list was read at all


@pytest.mark.parametrize("width", WIDTHS)
def test_keeps_nothing_between_calls(libraries, width):
    """No writable variable, global or static: neither a symbol nor a byte."""
    assert writable(libraries[width]) == set()


@pytest.mark.parametrize("width", WIDTHS)
def test_shows_only_names_of_its_own(libraries, width):
    names = shown(libraries[width])
    assert {name for name in names if not name.startswith("eits_")} == set()
    assert {"eits_model_open", "eits_init", "eits_reconstruct", "eits_find_touches"} <= names
    assert names == shown(libraries["f32"])


@pytest.mark.parametrize("width", WIDTHS)
def test_every_source_is_built(libraries, width):
    listed = run(tool("ar"), "t", libraries[width]).split()
    members = {name.removesuffix(".o").removesuffix(".obj") for name in listed}
    sources = {path.name for path in SOURCES if path.suffix == ".c"}
    assert sources - members <= {"avx2.c", "m7.c"}  # for one family of processors only
    assert members <= sources


def test_files_are_short():
    """Lines of code: an explanation does not make a file long."""
    for path in (*SOURCES, *HEADERS):
        text = path.read_text(encoding="ascii")  # and plain
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        assert sum(bool(line.strip()) for line in code.splitlines()) <= MAX_LINES, path
        assert "\t" not in text, path
        assert not [line for line in text.splitlines() if line != line.rstrip()], path


def test_includes_are_the_allowed_ones():
    """The standard library's integers, sizes, memory moves and arithmetic; and files of the
    core."""
    for path in (*SOURCES, *HEADERS):
        assert_includes(path)


def assert_includes(path: Path) -> None:
    allowed = {"stdint.h", "stddef.h", "string.h", "math.h", "float.h"} | (
        {"immintrin.h"} if path.name == "avx2.c" else set()
    )
    if path in HEADERS:
        allowed -= {"math.h", "string.h"}  # a user of the core gets no more than types
    text = path.read_text(encoding="ascii")
    assert set(re.findall(r"^\s*#\s*include\s*<([^>]+)>", text, re.M)) <= allowed, path
    for name in re.findall(r'^\s*#\s*include\s*"([^"]+)"', text, re.M):
        assert (CSRC / "include" / name).is_file() or (
            (CSRC / "src" / name).is_file() and path in SOURCES
        ), (path, name)
    for rest in re.findall(r"^\s*#\s*include\b(.*)", text, re.M):
        assert re.match(r'\s*(<[^>]+>|"[^"]+")', rest), path  # spelled out, not by a macro


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("path", HEADERS, ids=lambda path: path.name)
def test_each_header_stands_alone(path, width, tmp_path):
    """Included first and alone, as C11 without extensions and, where there is a C++ compiler, as
    C++."""
    program = tmp_path / "alone.c"
    program.write_text(f'#include "eitskin/{path.name}"\nint main(void) {{ return 0; }}\n')
    strict = ["-fsyntax-only", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{CSRC / 'include'}"]
    strict += ["-DEITS_DOUBLE"] if width == "f64" else []
    run(tool("cc", "gcc", "clang"), "-std=c11", *strict, program)
    plus = shutil.which("c++") or shutil.which("g++")
    if plus:
        run(plus, "-x", "c++", "-std=c++11", *strict, program)
