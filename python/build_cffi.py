"""Write the C source of one cffi module: ``build_cffi.py MODULE CDEF HEADER OUTPUT.c [TYPE NAME]``,
with ``typedef TYPE NAME`` before what the file CDEF declares. Called by CMake."""

import sys
from pathlib import Path

import cffi


def main(module: str, cdef: str, header: str, output: str, *typedef: str) -> None:
    ffi = cffi.FFI()
    if typedef:
        ffi.cdef(f"typedef {' '.join(typedef)};")
    ffi.cdef(Path(cdef).read_text(encoding="utf-8"))
    ffi.set_source(module, f'#include "{header}"', py_limited_api=True)
    ffi.emit_c_code(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
