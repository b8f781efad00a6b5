"""Write the C source of one cffi module: ``build_cffi.py MODULE DECLARED HEADER OUTPUT.c [TYPE
NAME]``, with ``typedef TYPE NAME`` before what the file DECLARED declares. Called by CMake.

What Python sees of the core is all that the public headers declare: they are read, with what they
include, so that no declaration is written twice.
"""

import re
import sys
from pathlib import Path

import cffi

INCLUDE = Path(__file__).resolve().parents[1] / "csrc" / "include"
INTEGER = re.compile(r"-?(0x)?[0-9a-fA-F]+[uUlL]*")


def declarations(path: Path, seen: set[Path]) -> str:
    """Return the declarations of a header and of those that it includes, each once, for cffi."""
    if path in seen:
        return ""
    seen.add(path)
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
    text = re.sub(r"#ifdef (__cplusplus|EITS_DOUBLE)\n.*?#endif", "", text, flags=re.DOTALL)
    lines = re.sub(r"\\\n", " ", text).splitlines()
    return "\n".join(_directive(line, seen) if line.startswith("#") else line for line in lines)


def _directive(line: str, seen: set[Path]) -> str:
    """Includes and whole numbers are kept; the compiler has the rest."""
    include = re.fullmatch(r'#include "(\S+)"', line)
    number = re.fullmatch(r"#define (\w+)\s+(\S.*)", line)
    if include:
        return declarations(INCLUDE / include[1], seen)
    if number is None:
        return ""
    value = number[2].strip()
    return f"#define {number[1]} {value if INTEGER.fullmatch(value) else '...'}"


def main(module: str, declared: str, header: str, output: str, *typedef: str) -> None:
    ffi = cffi.FFI()
    if typedef:
        ffi.cdef(f"typedef {' '.join(typedef)};")
    ffi.cdef(declarations(Path(declared), set()))
    ffi.set_source(module, f'#include "{header}"', py_limited_api=True)
    ffi.emit_c_code(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
