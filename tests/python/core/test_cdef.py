"""What cffi is told of the core, held against the headers: cffi itself notices neither a wrong
result type nor a lost field."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import pytest
from build_tools import CSRC, ROOT, run, tool
from c_declarations import Declarations, Struct, differences, parse

CDEF = (ROOT / "python" / "eitskin" / "core" / "core.cdef").read_text(encoding="utf-8")
HEADERS = "\n".join(
    path.read_text(encoding="utf-8") for path in sorted((CSRC / "include" / "eitskin").glob("*.h"))
)
MODULES = {"f32": "eitskin.core._core_f32", "f64": "eitskin.core._core_f64"}


def test_the_cdef_says_what_the_headers_say() -> None:
    assert differences(parse(CDEF), parse(HEADERS)) == []


def test_the_comparison_reads_all_there_is() -> None:
    """Counted by other means than the parser's: nothing of either text is passed over."""
    for text in (CDEF, HEADERS):
        found, bare = parse(text), re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
        assert len(found.enums) == len(re.findall(r"\btypedef enum\b", bare)) >= 5
        assert (
            len(found.structs) + len(found.opaque)
            == len(re.findall(r"\btypedef struct\b", bare))
            >= 6
        )
        assert len(found.functions) == len(re.findall(r"\beits_\w+\([^()]*\);", bare)) >= 18
        assert found.not_understood == []
    header = parse(HEADERS)
    assert dict(header.enums["eits_status"])["EITS_E_NOT_FINITE"] == -15
    assert header.functions["eits_crc32"] == (
        "uint32_t",
        (("uint32_t", "crc"), ("const void *", "bytes"), ("size_t", "size")),
    )
    reference = dict(header.structs["eits_reference_info"].fields)
    assert reference["v0"] == "const eits_real *"
    assert reference["gain"] == reference["noise_v"] == "eits_real"
    assert header.opaque == {"eits_context"}  # nobody outside knows its fields


# (what is changed, into what, what must be said of it)
CDEF_MUTATIONS = [
    ("eits_status eits_solve(", "uint32_t eits_solve(", "function eits_solve"),
    (
        "size_t eits_workspace_size(",
        "uint32_t eits_workspace_size(",
        "function eits_workspace_size",
    ),
    ("uint64_t eits_protocol_hash(", "uint32_t eits_protocol_hash(", "function eits_protocol_hash"),
    (
        "const char *eits_version_text(void)",
        "char eits_version_text(void)",
        "function eits_version_text",
    ),
    ("void eits_forget(", "int eits_forget(", "function eits_forget"),
    (
        "eits_status eits_solve(eits_context *ctx, const eits_real *y);",
        "",
        "function eits_solve",
    ),
    ("uint32_t row, int masked", "uint32_t row, uint32_t masked", "function eits_mask_row"),
    (
        "uint32_t *masked, uint64_t *macs",
        "uint64_t *macs, uint32_t *masked",
        "function eits_frame_stage",
    ),
    (
        "const eits_real *frame, size_t length, eits_real *image",
        "const eits_real *frame, eits_real *image",
        "eits_reconstruct",
    ),
    ("    uint32_t step_halvings;\n", "", "struct eits_info"),
    ("    eits_real data_norm;\n", "", "struct eits_info"),
    ("    uint64_t macs;\n", "    uint32_t macs;\n", "struct eits_info"),
    (
        "    eits_real gap;\n    eits_real gap_rel;\n",
        "    eits_real gap_rel;\n    eits_real gap;\n",
        "struct eits_info",
    ),
    ("    eits_real follow_mm;\n", "    float follow_mm;\n", "struct eits_options"),
    (
        "uint32_t max_touches;\n    uint32_t max_masked;",
        "uint32_t max_masked;\n    uint32_t max_touches;",
        "struct eits_options",
    ),
    (
        "touch_min_radius_mm, touch_max_radius_mm,",
        "touch_max_radius_mm, touch_min_radius_mm,",
        "struct eits_options",
    ),
    ("    eits_real x_mm, y_mm;", "    eits_real x_mm;", "struct eits_touch"),
    ("    const eits_real *v0;\n", "    const float *v0;\n", "struct eits_reference_info"),
    (
        "const uint8_t *eits_get_row_states(",
        "uint8_t *eits_get_row_states(",
        "function eits_get_row_states",
    ),
    (
        "EITS_SIGN_INCREASE, EITS_SIGN_DECREASE",
        "EITS_SIGN_DECREASE, EITS_SIGN_INCREASE",
        "enum eits_sign",
    ),
    (
        "EITS_TOUCH_FIT_LOG_DATA, EITS_TOUCH_FIT_SPLIT_MERGE",
        "EITS_TOUCH_FIT_SPLIT_MERGE, EITS_TOUCH_FIT_LOG_DATA",
        "enum eits_touch_fit",
    ),
    ("EITS_STOP_GAP, ", "", "enum eits_stop"),
    ("EITS_E_NOT_FINITE, ... }", "... }", "enum eits_status"),
    ("EITS_STORAGE_F32,", "EITS_STORAGE_F32 = 1,", "enum eits_storage"),
    ("#define EITS_MAX_TOUCHES ...", "#define EITS_ALL_TOUCHES ...", "macro EITS_ALL_TOUCHES"),
    ("typedef struct {", "typedef union {", "not understood"),
]
HEADER_MUTATIONS = [
    (
        "uint32_t touch_sweeps;",
        "uint32_t fresh;\n    uint32_t touch_sweeps;",
        "struct eits_options",
    ),
    ("eits_real gap;", "double gap;", "struct eits_info"),
    ("eits_status eits_find_touches(", "uint32_t eits_find_touches(", "function eits_find_touches"),
    ("void eits_forget(", "void eits_fresh(void);\nvoid eits_forget(", "function eits_fresh"),
    (
        "EITS_DATA_NORMALISED = 1,",
        "EITS_DATA_FRESH = 1, EITS_DATA_NORMALISED = 2,",
        "enum eits_data_kind",
    ),
    ("eits_real residual;   /*", "/*", "struct eits_info"),
]


@pytest.mark.parametrize(("old", "new", "complaint"), CDEF_MUTATIONS)
def test_a_wrong_cdef_is_noticed(old: str, new: str, complaint: str) -> None:
    assert old in CDEF
    wrong = differences(parse(CDEF.replace(old, new, 1)), parse(HEADERS))
    assert any(complaint in line for line in wrong), wrong


@pytest.mark.parametrize(("old", "new", "complaint"), HEADER_MUTATIONS)
def test_a_changed_header_is_noticed(old: str, new: str, complaint: str) -> None:
    assert old in HEADERS
    wrong = differences(parse(CDEF), parse(HEADERS.replace(old, new, 1)))
    assert any(complaint in line for line in wrong), wrong


def layout_program(declared: Declarations) -> str:
    """A C program that prints the value of each enum member and the size and place of each struct
    and field of the cdef."""
    lines = ['#include "eitskin/eitskin.h"', "#include <stdio.h>", "int main(void) {"]
    lines += [
        f'printf("{name} %lld\\n", (long long){name});'
        for members in declared.enums.values()
        for name, _ in members
    ]
    lines += [f'printf("{name} %lld\\n", (long long){name});' for name in sorted(declared.macros)]
    for name, struct in declared.structs.items():
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        lines += [
            f'printf("{name}.{part} %zu\\nsize:{name}.{part} %zu\\n", offsetof({name}, {part}),'
            f" sizeof((({name} *)0)->{part}));"
            for part, _ in struct.fields
        ]
    return "\n".join([*lines, "return 0; }", ""])


def layout_by_the_compiler(width: str, folder: Path) -> dict[str, int]:
    source, program = folder / "layout.c", folder / "layout"
    source.write_text(layout_program(parse(CDEF)), encoding="ascii")
    width_flag = ["-DEITS_DOUBLE"] if width == "f64" else []
    run(
        tool("cc", "gcc", "clang"),
        "-std=c11",
        *width_flag,
        "-I",
        CSRC / "include",
        source,
        "-o",
        program,
    )
    return {
        name: int(value) for name, value in (line.split() for line in run(program).splitlines())
    }


def layout_by_cffi(module: Any, declared: Declarations) -> dict[str, int]:
    ffi, lib = module.ffi, module.lib
    seen = {name: getattr(lib, name) for members in declared.enums.values() for name, _ in members}
    seen |= {name: getattr(lib, name) for name in declared.macros}
    for name, struct in declared.structs.items():
        fields = dict(ffi.typeof(name).fields)
        assert sorted(fields) == sorted(part for part, _ in struct.fields)
        seen[name] = ffi.sizeof(name)
        for part, info in fields.items():
            seen[f"{name}.{part}"], seen[f"size:{name}.{part}"] = info.offset, ffi.sizeof(info.type)
    return seen


@pytest.mark.parametrize("width", MODULES)
def test_the_built_modules_lie_as_the_compiler_lays(width: str, tmp_path: Path) -> None:
    """Values, sizes and places, of the modules that Python loads; a difference may also mean that
    they want building anew."""
    by_compiler, declared = layout_by_the_compiler(width, tmp_path), parse(CDEF)
    assert len(by_compiler) > 150
    assert layout_by_cffi(importlib.import_module(MODULES[width]), declared) == by_compiler


@pytest.mark.parametrize("width", MODULES)
def test_enum_names_of_the_modules_are_the_headers(width: str) -> None:
    ffi = importlib.import_module(MODULES[width]).ffi
    for name, members in parse(HEADERS).enums.items():
        assert ffi.typeof(name).relements == dict(members)


def test_complete_structs_are_complete() -> None:
    """What Python makes itself (options) or reads whole (info, touches) leaves nothing to the
    compiler."""
    structs: dict[str, Struct] = parse(CDEF).structs
    for name in ("eits_options", "eits_info", "eits_touch"):
        assert not structs[name].open
