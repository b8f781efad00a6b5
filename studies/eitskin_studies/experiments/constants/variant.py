"""A build of the C core in which the constants of tables/constants.toml are variables.

The product's headers stay as they are. Generated headers of the same names stand before them in the
compiler's search path: each constant is an element of a table there, and using it notes that it was
used. So one build serves every value of every constant, and tells which constants a scene reaches.
"""

import importlib.util
import platform
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from eitskin.config import load_toml
from eitskin.core.engine import WIDTHS
from eitskin.errors import UsageError
from eitskin_emulator.core_on_qemu import need_tools

NAME = "constants_core"
FLAGS = "-std=c11 -O2 -fPIC -w -fno-fast-math -ffp-contract=off -fno-math-errno"
AVX2 = "-mavx2 -mfma -mf16c -DEITS_BUILD_AVX2"
# sizes of arrays in structures: a variable cannot be one
SIZES = frozenset(
    {
        "FAST_MAX_TOUCHES",
        "FAST_MAX_ROWS",
        "FAST_HELD",
        "FAST_RING",
        "FAST_SUM_DRIVES",
        "FAST_MAP_DRIVES",
        "FAST_ANSWERS",
        "FAST_TOUCH_ANSWERS",
        "FAST_SEARCHED",
        "SPLIT_DIRECTIONS",
    }
)
# constants that the source writes out as a product: file, its text, and the text with a variable
WRITTEN_OUT = {
    "REST_POWER": (
        "frame/regularisation.c",
        "left * left * left",
        "({} == 3 ? left * left * left : powf(left, {}))",
    ),
    "NOISE_POWER": (
        "frame/whitening.c",
        "(ratio * eits_sqrt(eits_sqrt(ratio)))",
        "({} == R(1.25) ? ratio * eits_sqrt(eits_sqrt(ratio)) : powf(ratio, {}))",
    ),
}
# static objects that have constants in them, which C allows only for values that the compiler
# knows: file, its text, and the text for variables
STATIC_OBJECTS = (
    ("joint/fit.c", "static const eits_real most[EITS_JOINT_ELLIPSE]", "const eits_real most[]"),
    (
        "joint/prior.c",
        """static const kind LIGHT = {EITS_JOINT_LIGHT, EITS_JOINT_LIGHT_SPREAD},
                  STRONG = {EITS_JOINT_STRONG, EITS_JOINT_STRONG_SPREAD},
                  INSULATING = {EITS_JOINT_INSULATING, EITS_JOINT_INSULATING_SPREAD};
""",
        """static const kind *study_kind(int place, eits_real amplitude, eits_real spread)
{
    static kind kinds[3];
    kinds[place] = (kind){amplitude, spread};
    return &kinds[place];
}
#define LIGHT (*study_kind(0, EITS_JOINT_LIGHT, EITS_JOINT_LIGHT_SPREAD))
#define STRONG (*study_kind(1, EITS_JOINT_STRONG, EITS_JOINT_STRONG_SPREAD))
#define INSULATING (*study_kind(2, EITS_JOINT_INSULATING, EITS_JOINT_INSULATING_SPREAD))
""",
    ),
)
_DECLARED = """
extern float eits_study_real[{count}];
extern int eits_study_whole[{count}];
extern unsigned char eits_study_used[{count}];
"""


@dataclass(frozen=True)
class Constant:
    """A row of the table. ``place``: its element in the variant's tables; ``value``: in float32;
    ``by_hand``: so says its group of how it was chosen."""

    place: int
    module: str
    name: str
    value: float
    unit: str
    whole: bool
    by_hand: bool

    @property
    def is_size(self) -> bool:
        """Return whether no variable can stand for it."""
        return self.name in SIZES

    def changed(self) -> tuple[float, float]:
        """Half and twice the value; one less and one more of 0, whole numbers rounded down."""
        if self.value == 0:
            return -1.0, 1.0
        half = float(int(self.value) // 2) if self.whole else self.value / 2
        return half, 2 * self.value


def constants_of(root: Path) -> list[Constant]:
    """Return the constants of the core, in the table's order."""
    table = load_toml(root / "tables" / "constants.toml", "table of constants")
    listed: list[Constant] = []
    for module in table.get("module", table.get("room", [])):
        if "header" in module:  # of the firmware, which is no part of the core
            continue
        for group in module["group"]:
            for name, value, unit, *_ in group["rows"]:
                number, whole = _number(value)
                listed.append(
                    Constant(
                        len(listed), module["name"], name, number, unit, whole,
                        "by hand" in group["chosen"],
                    )
                )  # fmt: skip
    return listed


def _number(value: Any) -> tuple[float, bool]:
    """In float32, and whether C has a whole number."""
    if isinstance(value, list):
        return _number(value[0])[0], False
    if isinstance(value, str):
        if value.startswith("0x"):
            return float.fromhex(value), False
        return float(value.removesuffix("f")), False
    return float(value), isinstance(value, int)


@dataclass(frozen=True, eq=False)
class Variant:
    """The compiled variant and its constants."""

    module: ModuleType
    constants: list[Constant]

    @cached_property
    def _tables(self) -> tuple[Any, Any, Any]:
        lib = self.module.lib
        return lib.eits_study_real, lib.eits_study_whole, lib.eits_study_used

    def set(self, constant: Constant, value: float) -> None:
        """Give it another value."""
        real, whole, _ = self._tables
        if constant.whole:
            whole[constant.place] = int(value)
        real[constant.place] = value

    def used(self) -> frozenset[int]:
        """Places of the constants that were used since the last call."""
        table = self._tables[2]
        found = frozenset(k for k in range(len(self.constants)) if table[k])
        for k in range(len(self.constants)):
            table[k] = 0
        return found

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """Within it, this is the core of float32 that ``eitskin`` loads."""
        name = f"eitskin.core.{WIDTHS['float32']}"
        before = sys.modules.get(name)
        sys.modules[name] = self.module
        try:
            yield
        finally:
            if before is None:
                del sys.modules[name]
            else:
                sys.modules[name] = before


def build_variant(folder: Path, root: Path) -> Variant:
    """Compile the core of the checkout ``root`` into ``folder``.

    Raises:
        UsageError: there is no compiler, or the sources do not compile.
    """
    need_tools("cc")
    constants = constants_of(root)
    sources = write_sources(folder, root, constants)
    binding = _binding(folder, root, len(constants))
    target = folder / f"{NAME}.so"
    compile_sources(
        target, folder, root, [*sources, binding], (f"-I{_python_include()}", "-fvisibility=hidden")
    )
    return Variant(_imported(target), constants)


def write_sources(
    folder: Path, root: Path, constants: list[Constant], more: str = ""
) -> list[Path]:
    """The variant's headers, and all of its sources; ``more`` C stands below the tables."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_headers(folder, constants, more)
    return _sources(folder, root, constants)


def compile_sources(
    target: Path, folder: Path, root: Path, sources: Sequence[Path], flags: Sequence[str]
) -> None:
    """A shared library of ``sources``, whose generated headers are in ``folder``.

    Raises:
        UsageError: they do not compile.
    """
    fast = AVX2.split() if _has_avx2() else []
    command = ["cc", *FLAGS.split(), *fast, *flags, "-shared", f"-I{folder}", f"-I{root}/csrc/src",
               f"-I{root}/csrc/include", *map(str, sources), "-lm", "-o", str(target)]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        errors = [line for line in done.stderr.splitlines() if "error" in line] or [done.stderr]
        raise UsageError(f"constants: the variant of the core does not compile: {errors[0]}")


def _write_headers(folder: Path, constants: list[Constant], more: str) -> None:
    """``MODULE/constants.h`` for each module of the core, and the tables that they name."""
    count = len(constants)
    tables = "\n".join(_DECLARED.format(count=count).strip().splitlines())
    (folder / "study_tables.h").write_text(
        f"#ifndef EITSKIN_STUDY_TABLES_H\n#define EITSKIN_STUDY_TABLES_H\n{tables}\n#endif\n",
        encoding="ascii",
    )
    values = ", ".join(f"{one.value!r}f" for one in constants)
    whole = ", ".join(str(int(one.value) if one.whole else 0) for one in constants)
    (folder / "study_tables.c").write_text(
        f'#include "study_tables.h"\nfloat eits_study_real[{count}] = {{{values}}};\n'
        f"int eits_study_whole[{count}] = {{{whole}}};\n"
        f"unsigned char eits_study_used[{count}];\n{more}",
        encoding="ascii",
    )
    for module in dict.fromkeys(one.module for one in constants):
        guard = f"EITSKIN_{module.upper()}_CONSTANTS_H"
        lines = [f"#ifndef {guard}", f"#define {guard}", '#include "base/vec.h"']
        lines.append('#include "study_tables.h"')
        lines += [_define(one) for one in constants if one.module == module]
        (folder / module).mkdir(exist_ok=True)
        text = "\n".join([*lines, "#endif", ""])
        (folder / module / "constants.h").write_text(text, encoding="ascii")


def _define(one: Constant) -> str:
    if one.is_size:
        return f"#define EITS_{one.name} {int(one.value)}"
    kind = "whole" if one.whole and one.name not in WRITTEN_OUT else "real"
    return (
        f"#define EITS_{one.name} (eits_study_used[{one.place}] = 1,"
        f" eits_study_{kind}[{one.place}])"
    )


def _sources(folder: Path, root: Path, constants: list[Constant]) -> list[Path]:
    """The core's sources, rewritten where a variable cannot stand as the constant does."""
    base = root / "csrc" / "src"
    left_out = {"m7.c"} if _has_avx2() else {"m7.c", "avx2.c"}
    found = [path for path in sorted(base.glob("*/*.c")) if path.name not in left_out]
    known = {one.name for one in constants}
    for name, (file, text, varied) in WRITTEN_OUT.items():
        if name in known:
            header = f'#include "{Path(file).parent}/constants.h"\n#include <math.h>\n'
            new = varied.format(f"EITS_{name}", f"EITS_{name}")
            _rewrite(folder, base, found, file, text, new, header)
    for file, text, varied in STATIC_OBJECTS:
        _rewrite(folder, base, found, file, text, varied)
    return [*found, folder / "study_tables.c"]


def _rewrite(
    folder: Path, base: Path, sources: list[Path], file: str, text: str, new: str, header: str = ""
) -> None:
    """Replace a source by a copy in ``folder`` in which ``new`` stands for ``text``.

    Raises:
        UsageError: the source does not have ``text``.
    """
    original = (base / file).read_text(encoding="ascii")
    if text not in original:
        raise UsageError(f"constants: {file} does not have {text!r}")
    (folder / file).write_text(header + original.replace(text, new), encoding="ascii")
    sources[sources.index(base / file)] = folder / file


def _binding(folder: Path, root: Path, count: int) -> Path:
    """The C source of the Python module, as python/build_cffi.py writes it for the product."""
    import cffi

    spec = importlib.util.spec_from_file_location("build_cffi", root / "python" / "build_cffi.py")
    assert spec is not None and spec.loader is not None
    build_cffi = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build_cffi)
    public = root / "csrc" / "include" / "eitskin" / "eitskin.h"
    ffi = cffi.FFI()
    ffi.cdef("typedef float eits_real;")
    ffi.cdef(build_cffi.declarations(public, set()))
    ffi.cdef(_DECLARED.format(count=count))
    ffi.set_source(NAME, '#include "eitskin/eitskin.h"\n#include "study_tables.h"')
    path = folder / f"{NAME}.c"
    ffi.emit_c_code(str(path))
    return path


def _python_include() -> str:
    import sysconfig

    return sysconfig.get_path("include")


def _has_avx2() -> bool:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return platform.machine() == "x86_64" and " avx2 " in text and " fma " in text


def _imported(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(NAME, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
