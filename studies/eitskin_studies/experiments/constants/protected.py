"""Finds the C tests that fail if a constant is halved or doubled: a promise may depend on a
constant that changes no evaluation scene.

The object files of the preset `host` are linked once more, with a variant of the core as a shared
library, whose constants an environment variable sets. A test is run only where it uses the
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
HELPERS = "libeitskin_test_f32.a"
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
        UsageError: they are not built, or none of them runs with the variant.
    """

    def __init__(self, folder: Path) -> None:
        root, objects = checkout_root(), test_objects()
        self._folder = folder = folder.resolve()
        sources = write_sources(folder, root, constants_of(root), _HOOKS)
        compile_sources(folder / LIBRARY, folder, root, sources, ())
        programs = [self._linked(one) for one in objects]
        self.tests = [one for one in map(self._tested, programs) if one is not None]
        if not self.tests:
            raise UsageError("constants: no C test of the core passes with the variant of the core")

    def _linked(self, test: Path) -> Path:
        """The program of a test's object file and the variant."""
        program = self._folder / test.name.removesuffix(".c.o")
        helpers = test.parents[2] / HELPERS
        library = [f"-L{self._folder}", f"-l:{LIBRARY}", f"-Wl,-rpath,{self._folder}"]
        command = ["cc", str(test), str(helpers), *library, "-lm", "-o", str(program)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            errors = done.stderr.strip().splitlines() or ["no message"]
            raise UsageError(f"constants: {test.name} does not link with the variant: {errors[0]}")
        return program

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
        environment = {**os.environ, **more}
        try:
            done = subprocess.run(
                [program], env=environment, capture_output=True, check=False, timeout=LONGEST_S,
                cwd=self._folder,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return False
        return done.returncode == 0


def test_objects() -> list[Path]:
    """The object files of the core's C tests in float32, as the preset `host` builds them.

    Raises:
        UsageError: they are not built.
    """
    tests = checkout_root() / "build" / "host" / "tests" / "c"
    objects = sorted((tests / "CMakeFiles").glob("test_*_f32.dir/test_*.c.o"))
    if not objects or not (tests / HELPERS).exists():
        raise UsageError(
            "constants: the C tests are not built; run  cmake --preset host && cmake --build"
            " --preset host  in the checkout's root"
        )
    return objects


def protecting(tests: Tests, constants: Sequence[Constant]) -> dict[str, list[str]]:
    """Return for each constant the tests that fail with its half or its double."""
    return {
        one.name: sorted({name for value in one.changed() for name in tests.failing(one, value)})
        for one in constants
    }
