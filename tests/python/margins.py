"""How near to its bound each hard case came: recorded by tests, gathered over processes, shown at
the end of a run.

``conftest.py`` takes the hooks from here. ``--margins FOLDER`` keeps what was recorded, JSON lines,
for ``scripts/hard-cases``.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import pytest

TARGETS = ("host f32", "host f64", "M7")
FOLDER = "EITSKIN_MARGINS"
HARD_CASES = "hard_cases/"


@dataclass(frozen=True)
class Margin:
    """``what`` was ``measured`` on ``target`` where at most ``bound`` is allowed, both in
    ``unit``."""

    case: str
    what: str
    target: str
    measured: float
    bound: float
    unit: str = ""

    @property
    def share(self) -> float:
        """Of the bound that is used up: 1 is at the bound; 0 where nothing was measured."""
        if self.measured <= 0:
            return 0.0
        return self.measured / self.bound if self.bound > 0 else float("inf")

    @property
    def text(self) -> str:
        """Measured and bound, to two digits."""
        return (
            f"{self.what}: {self.measured:.2g} of"
            f" {self.bound:.2g}{' ' + self.unit if self.unit else ''}"
        )


class Margins:
    """The worst of every (case, what, target) in this process, and the hard cases' tests that
    passed in it."""

    def __init__(self) -> None:
        self.worst: dict[tuple[str, str, str], Margin] = {}
        self.passed: set[str] = set()

    def record(
        self, case: str, what: str, target: str, measured: float, bound: float, unit: str = ""
    ) -> None:
        """Keep the worst, and assert that ``measured`` is finite and at most ``bound``."""
        assert target in TARGETS, target
        given = Margin(case, what, target, float(measured), float(bound), unit)
        assert isfinite(given.measured) and isfinite(given.bound), given
        kept = self.worst.get((case, what, target))
        if kept is None or given.share >= kept.share:
            self.worst[case, what, target] = given
        assert given.measured <= given.bound, given

    def everywhere(
        self, case: str, what: str, measured: float, bound: float, unit: str = ""
    ) -> None:
        """The same for host f32 and M7, where ``same_everywhere`` has shown that both give the same
        bits."""
        for target in ("host f32", "M7"):
            self.record(case, what, target, measured, bound, unit)

    def write(self, folder: Path) -> None:
        """A file of this process's own."""
        lines = [asdict(margin) for margin in self.worst.values()] + [
            {"passed": name} for name in sorted(self.passed)
        ]
        text = "".join(json.dumps(line) + "\n" for line in lines)
        (folder / f"{os.getpid()}.jsonl").write_text(text, encoding="utf-8")


def read_margins(folder: Path) -> Margins:
    """What all processes wrote."""
    found = Margins()
    for path in sorted(folder.glob("*.jsonl")):
        for line in path.read_text(encoding="utf-8").splitlines():
            values = json.loads(line)
            if "passed" in values:
                found.passed.add(values["passed"])
                continue
            margin = Margin(**values)
            key = (margin.case, margin.what, margin.target)
            if key not in found.worst or margin.share > found.worst[key].share:
                found.worst[key] = margin
    return found


def worst_of_cases(found: Margins) -> dict[str, dict[str, Margin]]:
    """By case and target, the margin nearest to its bound."""
    worst: dict[str, dict[str, Margin]] = {}
    for margin in found.worst.values():
        of_case = worst.setdefault(margin.case, {})
        if margin.target not in of_case or margin.share > of_case[margin.target].share:
            of_case[margin.target] = margin
    return worst


_HERE = Margins()


@pytest.fixture
def margins() -> Margins:
    """Records how near to its bound a hard case came."""
    return _HERE


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--margins",
        metavar="FOLDER",
        help="keep the hard cases' margins in this folder, JSON lines",
    )


def _is_worker(config: pytest.Config) -> bool:
    return hasattr(config, "workerinput")


def pytest_configure(config: pytest.Config) -> None:
    if not _is_worker(config):  # workers of pytest-xdist inherit the environment
        os.environ[FOLDER] = config.getoption("--margins") or tempfile.mkdtemp(
            prefix="eitskin-margins-"
        )
        Path(os.environ[FOLDER]).mkdir(parents=True, exist_ok=True)


def pytest_unconfigure(config: pytest.Config) -> None:
    if not _is_worker(config) and not config.getoption("--margins"):
        shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "call" and report.passed and HARD_CASES in report.nodeid:
        _HERE.passed.add(f"{HARD_CASES}{report.nodeid.split(HARD_CASES)[1].split('[')[0]}")


def pytest_sessionfinish(session: pytest.Session) -> None:
    _HERE.write(Path(os.environ[FOLDER]))


def joined(targets: list[str]) -> str:
    """As in a sentence."""
    return " and ".join(targets)


def summary_lines(found: Margins) -> Iterator[str]:
    """A line a case: the worst on host and M7."""
    for case, of_case in sorted(worst_of_cases(found).items()):
        said: dict[str, list[str]] = {}
        for target in TARGETS:
            if target in of_case:
                said.setdefault(
                    f"{100 * of_case[target].share:.3g} % ({of_case[target].text})", []
                ).append(target)
        yield f"{case}: {'; '.join(f'{joined(targets)} {text}' for text, targets in said.items())}"


def pytest_terminal_summary(terminalreporter: Any) -> None:
    found = read_margins(Path(os.environ[FOLDER]))
    if found.worst:
        terminalreporter.section("hard cases: how much of each bound is used, at worst")
        for line in summary_lines(found):
            terminalreporter.write_line(line)
