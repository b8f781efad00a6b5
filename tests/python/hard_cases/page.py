"""docs/results/hard-cases.md: the catalogue, and how near to its bound each case came.
``scripts/hard-cases`` makes it."""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, OF_THE_CATALOGUE, ROOT, TESTS
from hard_case import GROUPS, Case

from margins import TARGETS, Margin, Margins, read_margins, worst_of_cases

PAGE = ROOT / "docs" / "results" / "hard-cases.md"
PICTURES = ROOT / "docs" / "results" / "pictures"

HEAD = """# Hard cases

What makes an EIT skin's numbers go wrong, and what eitskin promises then. Each case is a test that fails where the promise does
not hold, in float32 on the host and on an emulated Cortex-M7 (QEMU's mps2-an500). Both give the same bits in every case: the
test runs the host's own matrix products, plain C and the Cortex-M7, and compares images, touches and all that is reported.

`scripts/hard-cases` runs the tests and makes this page and its pictures; `pytest` ends with a line a case. The tables state how
much of its bound each case uses up at worst: what was measured, and the bound that it is held to. Bounds follow from the
arithmetic and the problem's condition, and each test says how; where nothing may go wrong at all, the bound is a count of 0.
Random problems come from fixed seeds (1, and others that the tests name; hypothesis is derandomised), so that the numbers are
the same everywhere.
"""


def _anchor(text: str) -> str:
    return text.replace("|", "\\|")


def cell(margin: Margin | None) -> str:
    """One entry of a table."""
    if margin is None:
        return ""
    return _anchor(
        f"{margin.measured:.2g} of {margin.bound:.2g}{' ' + margin.unit if margin.unit else ''}"
    )


def _rows(case: Case, found: Margins) -> Iterator[str]:
    """The worst by what was bounded."""
    names = sorted({what for of_case, what, _ in found.worst if of_case == case.id})
    for what in names:
        margins = [found.worst.get((case.id, what, target)) for target in TARGETS]
        yield f"| {_anchor(what)} | " + " | ".join(map(cell, margins)) + " |"


def _text(case: Case) -> list[str]:
    lines = [
        "",
        f"### {case.title}",
        "",
        f"`{case.id}`. {case.happens} {case.hard}",
        "",
        f"**Promise**: {case.promise}",
        "",
    ]
    if case.picture is not None:
        lines += [f"![{case.title}](pictures/{case.picture})", ""]
    return [*lines, "Tests: " + ", ".join(f"`{name}`" for name in case.tests), ""]


def page_text(found: Margins) -> str:
    """The whole page."""
    lines = [HEAD.rstrip()]
    for group in GROUPS:
        of_group = [case for case in CASES if case.group == group]
        lines += ["", f"## {group}"] if of_group else []
        for case in of_group:
            rows = list(_rows(case, found))
            lines += _text(case)
            if rows:
                lines += [
                    "| measured of bound | " + " | ".join(TARGETS) + " |",
                    "|---|---|---|---|",
                    *rows,
                ]
    return "\n".join(lines).rstrip() + "\n"


def without_numbers(text: str) -> str:
    """What of the page follows from the catalogue alone."""
    return "\n".join(line for line in text.splitlines() if not line.startswith("|")).rstrip()


def missing(found: Margins) -> list[str]:
    """Cases that no test of theirs stands for in what ran."""
    worst = worst_of_cases(found)
    return [
        f"{case.id}: {test} did not pass"
        for case in CASES
        for test in case.tests
        if test.startswith("hard_cases/") and test not in found.passed
    ] + [
        f"{case.id}: no margin was recorded"
        for case in CASES
        if case.id not in worst and _measures(case)
    ]


def _measures(case: Case) -> bool:
    return any(test.startswith("hard_cases/") for test in case.tests)


def main() -> int:
    """Run the hard cases, or read what a run left, then write page and pictures."""
    parser = argparse.ArgumentParser(
        description="run the hard cases and write docs/results/hard-cases.md and its pictures"
    )
    parser.add_argument(
        "--margins", type=Path, help="what  pytest --margins FOLDER  left there, in place of a run"
    )
    parser.add_argument("--only-page", action="store_true", help="leave the pictures as they are")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.margins or Path(name)
        if given.margins is None:
            chosen = sorted(
                {
                    f"{TESTS / test.split('::')[0]}"
                    for case in CASES
                    for test in case.tests
                    if _runs_here(test)
                }
            )
            command = [sys.executable, "-m", "pytest", "-q", "--margins", name, *chosen]
            if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
                return 1
        found = read_margins(folder)
    absent = missing(found)
    if absent:
        print("\n".join(absent), file=sys.stderr)
        return 1
    PAGE.write_text(page_text(found), encoding="utf-8")
    if not given.only_page:
        for case in CASES:
            if case.picture is not None:
                pictures.draw(case.picture, PICTURES / case.picture)
    return 0


def _runs_here(test: str) -> bool:
    return test.startswith("hard_cases/") and not test.startswith(OF_THE_CATALOGUE)


if __name__ == "__main__":
    sys.exit(main())
