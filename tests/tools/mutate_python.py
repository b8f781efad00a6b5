"""Mutants of the Python package, tried by the tests that import what is changed.

Each is tried in a fork of this process, which has the libraries loaded but not the package: there,
the changed module is compiled from its changed source.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
import re
import signal
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType

from mutants import ROOT, Mutant

PACKAGE = ROOT / "python"
FOLDERS = ("solve", "device", "frames", "model")
TESTS = ROOT / "tests" / "python"
LIBRARIES = (
    "numpy",
    "scipy.sparse.linalg",
    "scipy.optimize",
    "cffi",
    "serial",
    "pytest",
    "_pytest",
)
MAX_SECONDS = 40
MAX_FILES = 4


def sources() -> list[str]:
    """The modules that are changed."""
    folders = [PACKAGE / "eitskin" / folder for folder in FOLDERS]
    files = (file for folder in folders for file in folder.rglob("*.py"))
    return sorted(file.relative_to(ROOT).as_posix() for file in files)


def module_name(file: str) -> str:
    """Of a source: python/eitskin/solve/batch.py is eitskin.solve.batch."""
    parts = Path(file).relative_to("python").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def tests_for(mutant: Mutant) -> list[str]:
    """The test files that name the function most, of those that import the module or its room."""
    module = module_name(mutant.file)
    room = module.split(".")[1]
    words = [word for word in re.split(r"\W+", mutant.function) if not word.startswith("_")]
    found = []
    for test in TESTS.rglob("test_*.py"):
        text = test.read_text()
        imports = len(re.findall(rf"\b{re.escape(module)}\b", text))
        named = sum(len(re.findall(rf"\b{word}\b", text)) for word in words)
        in_room = f"eitskin.{room}" in text and test.parent.name == room
        if imports or (in_room and (named or test.stem[5:] in module)):
            found.append((-bool(imports), test.parent.name != room, -named, str(test)))
    room_tests = [str(test) for test in sorted((TESTS / room).glob("test_*.py"))]
    return [name for *_, name in sorted(found)][:MAX_FILES] or room_tests[:MAX_FILES]


class _Changed(SourceFileLoader):
    """Loads a module from a source with a mutant in it."""

    mutant: Mutant

    def get_code(self, fullname: str) -> CodeType:
        source = self.mutant.applied((ROOT / self.mutant.file).read_text())
        return compile(source, self.path, "exec")


class _Finder(MetaPathFinder):
    def __init__(self, mutant: Mutant) -> None:
        self.mutant, self.name = mutant, module_name(mutant.file)

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        if name != self.name:
            return None
        spec = PathFinder.find_spec(name, path)  # type: ignore[arg-type]
        if spec is not None and spec.origin is not None:
            loader = _Changed(name, spec.origin)
            loader.mutant = self.mutant
            spec.loader = loader
        return spec


def prepare() -> None:
    """Load what does not change."""
    for name in LIBRARIES:
        importlib.import_module(name)


def try_mutant(mutant: Mutant | None, tests: list[str]) -> str:
    """Which test noticed; "does not end"; empty where none did."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _run_tests(mutant, tests, writer)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return "does not end" if os.WTERMSIG(status) == signal.SIGALRM else "crashes"
    return told if os.WEXITSTATUS(status) else ""


def _run_tests(mutant: Mutant | None, tests: list[str], writer: int) -> None:
    os.setpgrp()
    signal.alarm(MAX_SECONDS)
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    if mutant is not None:
        sys.meta_path.insert(0, _Finder(mutant))
    import pytest

    class First:
        failed = ""

        def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
            if report.failed and not self.failed:
                First.failed = report.nodeid

    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not long"]
    with contextlib.redirect_stdout(io.StringIO()):
        code = pytest.main([*options, "--rootdir", str(ROOT), *tests], plugins=[First()])
    os.write(writer, (First.failed or "collection").encode()[:200])
    os._exit(0 if code == 0 else 1)
