"""docs/results/hard-cases.md: the catalogue. ``scripts/hard-cases`` runs it and makes the page; how
near to its bound each case came, pytest says at the end.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import pictures
from catalogue import CASES, GROUPS, OF_THE_CATALOGUE, ROOT, TESTS, Case

from margins import Margins, read_margins, worst_of_cases

PAGE = ROOT / "docs" / "results" / "hard-cases.md"
PICTURES = ROOT / "docs" / "results" / "pictures"
UP = "../../"

HEAD = """# Hard cases

What makes an EIT skin's numbers go wrong, and what eitskin promises then. Each case is a test, to
which its name links, that fails where the promise does not hold;
[cases.toml](../../tests/python/hard_cases/cases.toml) says what goes wrong in each. Unless the case
is about bytes or counters, it runs in float32 on the host (vector and plain C kernels) and on an
emulated Cortex-M7; all three give the same bits. `scripts/hard-cases` runs them, says how much of
each bound is used, and writes this page. *Sound*: finite; objective, residual and gap no worse than
at zero, and reported as float64 finds them.
"""


def _row(case: Case) -> str:
    return f"- [`{case.id}`]({UP}{case.files[0]}): {case.promise}"


def page_text() -> str:
    """The whole page."""
    lines = [HEAD.rstrip()]
    for group in GROUPS:
        of_group = [case for case in CASES if case.group == group]
        lines += ["", f"## {group.capitalize()}", "", *map(_row, of_group)]
        for case in of_group:
            if case.picture is not None:
                lines += ["", f"![{case.id}](pictures/{case.picture})"]
    return "\n".join(lines) + "\n"


def missing(found: Margins) -> list[str]:
    """Cases that no test of theirs stands for in what ran."""
    worst = worst_of_cases(found)
    return [
        f"{case.id}: {test} did not pass"
        for case in CASES
        for test in case.tests
        if _runs_here(test) and test not in found.passed
    ] + [
        f"{case.id}: no margin was recorded"
        for case in CASES
        if case.id not in worst and measures(case)
    ]


def measures(case: Case) -> bool:
    """Whether tests of this folder stand for it: they record margins."""
    return any(_runs_here(test) for test in case.tests)


def main() -> int:
    """Run the hard cases, or read what a run left, then write page and pictures."""
    parser = argparse.ArgumentParser(
        description="run the hard cases, write their page and pictures"
    )
    parser.add_argument(
        "--margins", type=Path, help="what  pytest --margins FOLDER  left there, in place of a run"
    )
    parser.add_argument("--only-page", action="store_true", help="leave the pictures as they are")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.margins or Path(name)
        if given.margins is None:
            files = {
                test.split("::")[0] for case in CASES for test in case.tests if _runs_here(test)
            }
            chosen = sorted(f"{TESTS / file}" for file in files)
            command = [sys.executable, "-m", "pytest", "-q", "--margins", name, *chosen]
            if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
                return 1
        found = read_margins(folder)
    absent = missing(found)
    if absent:
        print("\n".join(absent), file=sys.stderr)
        return 1
    PAGE.write_text(page_text(), encoding="utf-8")
    if not given.only_page:
        for case in CASES:
            if case.picture is not None:
                pictures.draw(case.picture, PICTURES / case.picture)
    return 0


def _runs_here(test: str) -> bool:
    return test.startswith("hard_cases/") and not test.startswith(OF_THE_CATALOGUE)


if __name__ == "__main__":
    sys.exit(main())
