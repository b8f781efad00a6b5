"""Mutants of the Python package, tried by the tests that call what is changed.

The tests run once on the sources as they are, while it is noted which functions each calls and how
much of the processor's time it takes; of a mutant those run that call its function, quick ones
first. All of this happens in forks of this process, which has the libraries loaded but not the
package: there, the changed module is compiled from its changed source. A limit is one of the
processor's time, so that other work on the machine changes nothing.
"""

import ast
import contextlib
import functools
import importlib
import importlib.util
import io
import json
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from mutants import ROOT, Mutant

PACKAGE = ROOT / "python"
ROOMS = ("solve", "device", "frames", "model")
FOLDERS = (*(f"eitskin/{room}" for room in ROOMS), "eitskin_reference")
PACKAGES = ("eitskin.", "eitskin_reference.")
TESTS = ROOT / "tests" / "python"
TEST_FOLDERS = (*ROOMS, "reference", "bytes", "core", "calibration")
LIBRARIES = (
    "numpy",
    "scipy.sparse.linalg",
    "scipy.optimize",
    "cffi",
    "hypothesis",
    "serial",
    "pytest",
    "_pytest",
)
OPTIONS = (
    *("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not long"),
    *("--hypothesis-profile", "fixed", "--rootdir", str(ROOT)),
)
MAX_CPU_SECONDS = 15  # that a mutant's tests take on the sources as they are
MIN_LIMIT_SECONDS = 10
SLOWDOWN = 3
WAITING = 20  # by how much a test may take longer than its limit of processor time, idle


@dataclass(frozen=True)
class Test:
    """What a test calls, as a module's name and the first line of a function, and seconds of
    processor time."""

    name: str
    calls: frozenset[tuple[str, int]]
    seconds: float


def sources() -> list[str]:
    """The modules that are changed."""
    folders = [PACKAGE / folder for folder in FOLDERS]
    files = (file for folder in folders for file in folder.rglob("*.py"))
    return sorted(file.relative_to(ROOT).as_posix() for file in files)


def module_name(file: str) -> str:
    """Of a source: python/eitskin/solve/batch.py is eitskin.solve.batch."""
    parts = Path(file).relative_to("python").with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def first_line(mutant: Mutant) -> int:
    """Of the innermost function around the mutant, decorators included; 0 where there is none."""
    source = (ROOT / mutant.file).read_text()
    line = source.count("\n", 0, mutant.start) + 1
    found = 0
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        body = node.body[0].lineno  # defaults belong to what is around the function
        if body <= line <= (node.end_lineno or 0):
            first = min([node.lineno, *(word.lineno for word in node.decorator_list)])
            found = max(found, first)
    return found


def tests_for(mutant: Mutant, tests: Sequence[Test]) -> list[Test]:
    """Those that call the function, else those that call any of its module, quick ones first; as
    many as take MAX_CPU_SECONDS, and one at least."""
    module, line = module_name(mutant.file), first_line(mutant)
    calling = [test for test in tests if (module, line) in test.calls]
    if not line:
        calling = [test for test in tests if any(name == module for name, _ in test.calls)]
    chosen: list[Test] = []
    total = 0.0
    for test in sorted(calling, key=lambda test: test.seconds):
        total += test.seconds
        if chosen and total > MAX_CPU_SECONDS:
            break
        chosen.append(test)
    return chosen


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


class _Watch:
    """A plugin of pytest that notes what each test calls and takes, and which test fails first."""

    def __init__(self) -> None:
        self.failed = ""
        self.tests: dict[str, tuple[list[tuple[str, int]], float]] = {}

    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        seen: dict[CodeType, str] = {}

        def note(frame: FrameType, event: str, argument: object) -> None:
            if frame.f_code not in seen:
                seen[frame.f_code] = frame.f_globals.get("__name__", "")

        began = time.process_time()
        threading.settrace(note)
        sys.settrace(note)
        yield
        sys.settrace(None)
        threading.settrace(None)
        calls = [
            (name, code.co_firstlineno) for code, name in seen.items() if name.startswith(PACKAGES)
        ]
        self.tests[item.nodeid] = (calls, time.process_time() - began)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid


class _First:
    """A plugin of pytest that notes which test fails first."""

    failed = ""

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid


def _forked(work: Callable[[], str], cpu_seconds: float) -> tuple[str, int]:
    """What ``work`` returns in a fork of this process, and the signal that ended it, or 0. What
    the fork started and left behind ends with it."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.setpgrp()
        limit = round(cpu_seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
        signal.alarm(WAITING * limit)
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, 0)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        with contextlib.redirect_stdout(io.StringIO()), os.fdopen(writer, "w") as pipe:
            pipe.write(work())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return told, os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def list_tests() -> list[Test]:
    """Run the tests once, all of which must pass, and note what they call."""

    def work() -> str:
        import pytest

        watch = _Watch()
        watching = pytest.hookimpl(hookwrapper=True)
        _Watch.pytest_runtest_protocol = watching(  # type: ignore[method-assign]
            _Watch.pytest_runtest_protocol
        )
        folders = [str(TESTS / folder) for folder in TEST_FOLDERS]
        pytest.main([*OPTIONS, *folders], plugins=[watch])
        return json.dumps([watch.failed, watch.tests])

    told, killed = _forked(work, 3600)
    if not told or killed:
        raise SystemExit(f"the tests end with signal {killed} on the sources as they are")
    failed, tests = json.loads(told)
    if failed or not tests:
        raise SystemExit(f"{failed or 'the collection'} fails on the sources as they are")
    return [
        Test(name, frozenset((module, line) for module, line in calls), seconds)
        for name, (calls, seconds) in tests.items()
    ]


@functools.cache
def prepare() -> list[Test]:
    """Load what does not change; the tests."""
    for name in LIBRARIES:
        importlib.import_module(name)
    return list_tests()


def try_mutant(mutant: Mutant, tests: Sequence[Test]) -> str:
    """Which test noticed; "does not end"; empty where none did."""
    if not tests:
        return ""

    def work() -> str:
        import pytest

        sys.meta_path.insert(0, _Finder(mutant))
        first = _First()
        names = [str(ROOT / test.name) for test in tests]
        code = pytest.main(["-x", *OPTIONS, *names], plugins=[first])
        return "" if code == 0 else first.failed or "collection"

    limit = max(MIN_LIMIT_SECONDS, SLOWDOWN * sum(test.seconds for test in tests))
    told, killed = _forked(work, limit)
    if killed:
        return "does not end" if killed in (signal.SIGXCPU, signal.SIGALRM) else "crashes"
    return told
