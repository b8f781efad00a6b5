"""How near to its bound each hard case came: recorded by tests, gathered over processes, shown at
the end of a run, and written with the commit to the file that ``EITSKIN_MARGINS_FILE`` names.
``conftest.py`` takes the hooks from here."""

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from math import isfinite
from pathlib import Path

import pytest

TARGETS = ("host f32", "host f64", "M7")
FOLDER = "EITSKIN_MARGINS"  # of a run: workers of pytest-xdist inherit the environment
FILE = "EITSKIN_MARGINS_FILE"
MEASURED = ("csrc", "python", "tests/python/hard_cases", ":(exclude)*/front.json",
            ":(exclude)*/margins.json")  # fmt: skip
"""The paths on which margins depend, relative to the checkout's root, as git takes them. Files that
only store measured numbers are excluded."""


def share(measured: float, bound: float) -> float:
    """Return the share of the bound that is used: 1 at the bound, 0 if nothing was measured."""
    if measured <= 0:
        return 0.0
    return measured / bound if bound > 0 else float("inf")


class Margins:
    """By (case, target), the share, what was measured and bound of the worst in this process."""

    def __init__(self) -> None:
        self.worst: dict[tuple[str, str], tuple[float, str]] = {}
        self._everywhere: tuple[str, ...] = ("host f32", "M7")

    def record(
        self, case: str, what: str, target: str, measured: float, bound: float, unit: str = ""
    ) -> None:
        """Keep the worst, and assert that ``measured`` is finite and at most ``bound``."""
        assert target in TARGETS, target
        text = f"{what}: {measured:.2g} of {bound:.2g}{' ' + unit if unit else ''}"
        assert isfinite(measured) and isfinite(bound), (case, target, text)
        self.keep(case, target, share(measured, bound), text)
        assert measured <= bound, (case, target, text)

    def everywhere(
        self, case: str, what: str, measured: float, bound: float, unit: str = ""
    ) -> None:
        """Record for host f32 and for M7, after ``same_everywhere`` has shown that both give the
        same bits. Within ``on``, record only for its target."""
        for target in self._everywhere:
            self.record(case, what, target, measured, bound, unit)

    @contextmanager
    def on(self, target: str) -> Iterator[None]:
        """Within it, ``everywhere`` is this target alone."""
        before, self._everywhere = self._everywhere, (target,)
        try:
            yield
        finally:
            self._everywhere = before

    @property
    def host(self) -> str:
        """The host's target, for what ``same_everywhere`` does not run."""
        return self._everywhere[0]

    def of(self, case: str) -> Callable[..., None]:
        """``everywhere`` of one case."""
        return partial(self.everywhere, case)

    def keep(self, case: str, target: str, used: float, text: str) -> None:
        self.worst[case, target] = max(self.worst.get((case, target), (-1.0, "")), (used, text))


def _commit() -> str:
    """Return the last commit that changed ``MEASURED``, with "-dirty" if something is not
    committed."""

    def git(*words: str) -> str:
        command = ["git", *words, "--", *MEASURED]
        root = Path(__file__).parents[2]
        return subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout

    return git("log", "-1", "--format=%h").strip() + "-dirty" * bool(git("status", "--porcelain"))


_HERE = Margins()


@pytest.fixture
def margins() -> Margins:
    return _HERE


def pytest_configure(config):
    if not hasattr(config, "workerinput"):
        os.environ[FOLDER] = tempfile.mkdtemp(prefix="eitskin-margins-")


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput"):
        shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


def pytest_sessionfinish():
    rows = [[*key, *worst] for key, worst in _HERE.worst.items()]
    Path(os.environ[FOLDER], f"{os.getpid()}.json").write_text(json.dumps(rows), encoding="utf-8")


def pytest_terminal_summary(terminalreporter):
    """A line a case: the worst on host and M7."""
    found = Margins()
    for path in Path(os.environ[FOLDER]).glob("*.json"):
        for row in json.loads(path.read_text(encoding="utf-8")):
            found.keep(*row)
    if FILE in os.environ:
        rows = [[*key, used, text] for key, (used, text) in sorted(found.worst.items())]
        lines = ",\n".join(json.dumps(row) for row in rows)
        text = f'{{"commit": "{_commit()}", "margins": [\n{lines}\n]}}\n'
        Path(os.environ[FILE]).write_text(text, encoding="utf-8")
    said: dict[str, dict[str, list[str]]] = {}
    for (case, target), (used, text) in found.worst.items():
        said.setdefault(case, {}).setdefault(f"{100 * used:.3g} % ({text})", []).append(target)
    if said:
        terminalreporter.section("hard cases: how much of each bound is used, at worst")
        for case, texts in sorted(said.items()):
            each = (f"{' and '.join(sorted(targets))} {text}" for text, targets in texts.items())
            terminalreporter.write_line(f"{case}: {'; '.join(each)}")
