"""Lines, branches and error branches of the core that a test run reached: a table by file; fails
where that is too little.

    python tests/tools/coverage_report.py BUILD

``BUILD`` is a build with ``--coverage`` whose C tests have run.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from error_branches import Missed, Site, find_missed, sites_below
from gcov_counts import FileCounts, read_counts

ROOT = Path(__file__).resolve().parents[2]
MIN_LINES_PERCENT = 95.0
SOURCES = "csrc/src"
LIBRARIES = "/eitskin_f"  # the objects of both libraries, not the tests'
NOT_COMPILED = {
    "csrc/src/kernels/m7.c": (
        "is compiled for the Cortex-M7 only and is not in these numbers. Emulated, its bits are"
        " held against the portable kernels' for every storage type and product:"
        " tests/python/emulated."
    )
}


@dataclass(frozen=True)
class Row:
    """Counts for one file, or for all: how many were reached, and how many there are."""

    name: str
    lines: tuple[int, int]
    branches: tuple[int, int]
    sites: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.name:28s}" + "".join(
            f"{_share(part):>24s}" for part in (self.lines, self.branches, self.sites)
        )


def _share(part: tuple[int, int]) -> str:
    reached, whole = part
    return "-" if whole == 0 else f"{reached} of {whole}  {100 * reached / whole:5.1f} %"


def _row(name: str, counts: FileCounts, sites: Sequence[Site], missed: Sequence[Missed]) -> Row:
    taken = [count for branches in counts.branches.values() for count in branches]
    return Row(
        name,
        (sum(count > 0 for count in counts.lines.values()), len(counts.lines)),
        (sum(count > 0 for count in taken), len(taken)),
        (len(sites) - len({miss.site for miss in missed}), len(sites)),
    )


def _total(rows: Sequence[Row]) -> Row:
    def added(parts: Sequence[tuple[int, int]]) -> tuple[int, int]:
        return sum(part[0] for part in parts), sum(part[1] for part in parts)

    return Row(
        "all",
        added([r.lines for r in rows]),
        added([r.branches for r in rows]),
        added([r.sites for r in rows]),
    )


def _ranges(numbers: Sequence[int]) -> str:
    """Ascending numbers, neighbours drawn together: 3-5, 9."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and parts[-1][-1] == number - 1:
            parts[-1][1:] = [number]
        else:
            parts.append([number])
    return ", ".join("-".join(map(str, part)) for part in parts)


def report(counts: dict[str, FileCounts], sites: Sequence[Site]) -> list[str]:
    """Print the tables; returns what is wrong, a line each."""
    rows, wrong = [], []
    unrun: list[str] = []
    by_file = {
        name: [site for site in sites if site.file == name]
        for name in sorted({*counts, *(site.file for site in sites)})
    }
    for name, own in by_file.items():
        if name in NOT_COMPILED:
            continue
        of_file = counts.get(name, FileCounts())
        missed = [miss for site in own for miss in find_missed(site, of_file)]
        rows.append(_row(name.removeprefix(f"{SOURCES}/"), of_file, own, missed))
        wrong += [str(miss) for miss in missed]
        never = sorted(line for line, count in of_file.lines.items() if count == 0)
        unrun += [f"{name}: {_ranges(never)}"] if never else []
    print(f"{SOURCES:28s}{'lines':>24s}{'branches':>24s}{'error branches':>24s}")
    print("\n".join(map(str, [*rows, _total(rows)])))
    for name, why in NOT_COMPILED.items():
        print(f"{name} {why}")
    if unrun:
        print("lines never run:", *unrun, sep="\n  ")
    reached, whole = _total(rows).lines
    if 100 * reached < MIN_LINES_PERCENT * whole:
        wrong.append(
            f"{100 * reached / whole:.1f} % of lines were run; at least {MIN_LINES_PERCENT:g} %"
            " must be"
        )
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("build", type=Path)
    build: Path = parser.parse_args().build
    counts = read_counts(build, ROOT, SOURCES, LIBRARIES)
    if not counts:
        print(f"{build} has no counts of {SOURCES}; build it with --coverage and run the C tests")
        return 1
    wrong = report(counts, sites_below(ROOT, SOURCES))
    if wrong:
        print("not covered:", *wrong, sep="\n  ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
