"""Finds the C tests that fail if a constant is halved or doubled: a promise may depend on a
constant that changes no evaluation scene.

The tests of the preset `host` take the core from a shared library. They are run with a variant in
its place, whose constants an environment variable sets. A test is run only where it uses the
constant.
"""

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eitskin.errors import UsageError
from eitskin_emulator.core_on_qemu import checkout_root
from eitskin_studies.experiments.constants.variant import (
    Constant,
    compile_sources,
    constants_of,
    write_sources,
)

LIBRARY = "libeitskin_f32.so"
LONGEST_S = 60.0
# sets a constant before a test begins, and says at its end which were used
_HOOKS = """
#include <stdio.h>
#include <stdlib.h>
__attribute__((constructor)) static void eits_study_begin(void)
{
    const char *set = getenv("EITS_STUDY_SET");
    int place;
    double value;
    if (set && sscanf(set, "%d %lf", &place, &value) == 2) {
        eits_study_real[place] = (float)value;
        eits_study_whole[place] = (int)value;
    }
}
__attribute__((destructor)) static void eits_study_end(void)
{
    const char *name = getenv("EITS_STUDY_USED");
    FILE *out = name ? fopen(name, "wb") : NULL;
    if (out) {
        fwrite(eits_study_used, 1, sizeof eits_study_used, out);
        fclose(out);
    }
}
"""


@dataclass(frozen=True)
class Tested:
    """A C test, and the constants that it uses."""

    program: Path
    used: frozenset[int]

    @property
    def name(self) -> str:
        """As ctest has it."""
        return self.program.name.removeprefix("test_")


class Tests:
    """The C tests of the core in float32.

    Raises:
        UsageError: they are not built.
    """

    def __init__(self, folder: Path) -> None:
        root, programs = checkout_root(), test_programs()
        self._folder = folder
        sources = write_sources(folder, root, constants_of(root), _HOOKS)
        compile_sources(folder / LIBRARY, folder, root, sources, ())
        self.tests = [one for one in map(self._tested, programs) if one is not None]

    def _tested(self, program: Path) -> Tested | None:
        """None if it fails with the variant at the table's values: it has a constant of its own or
        takes too long."""
        used = self._folder / "used"
        used.unlink(missing_ok=True)
        if not self._passes(program, EITS_STUDY_USED=str(used)) or not used.exists():
            return None
        return Tested(program, frozenset(k for k, one in enumerate(used.read_bytes()) if one))

    def failing(self, constant: Constant, value: float) -> list[str]:
        """The tests that fail with this value."""
        setting = f"{constant.place} {value!r}"
        return [
            one.name
            for one in self.tests
            if constant.place in one.used and not self._passes(one.program, EITS_STUDY_SET=setting)
        ]

    def _passes(self, program: Path, **more: str) -> bool:
        environment = {**os.environ, "LD_LIBRARY_PATH": str(self._folder), **more}
        try:
            done = subprocess.run(
                [program], env=environment, capture_output=True, check=False, timeout=LONGEST_S,
                cwd=self._folder,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def test_programs() -> list[Path]:
    """The C tests of the core in float32, as the preset `host` builds them.

    Raises:
        UsageError: they are not built.
    """
    programs = sorted((checkout_root() / "build" / "host" / "tests" / "c").glob("test_*_f32"))
    if not programs:
        raise UsageError(
            "constants: the C tests are not built; run  cmake --preset host && cmake --build"
            " --preset host  in the checkout's root"
        )
    return programs


def protecting(tests: Tests, constants: Sequence[Constant]) -> dict[str, list[str]]:
    """Return for each constant the tests that fail with its half or its double."""
    return {
        one.name: sorted({name for value in one.changed() for name in tests.failing(one, value)})
        for one in constants
    }
