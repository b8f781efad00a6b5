"""Write the C source of one cffi module: ``build_cffi.py MODULE float|double OUTPUT.c``. Called by
CMake."""

import sys
from pathlib import Path

import cffi


def main(module: str, width: str, output: str) -> None:
    cdef = (Path(__file__).parent / "eitskin" / "core" / "core.cdef").read_text(encoding="utf-8")
    ffi = cffi.FFI()
    ffi.cdef(f"typedef {width} eits_real;\n" + cdef)
    ffi.set_source(module, '#include "eitskin/eitskin.h"', py_limited_api=True)
    ffi.emit_c_code(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
