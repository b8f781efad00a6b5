"""Counts of gcov: how often each line ran and each branch was taken, summed over the objects that
contain a source."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any


@dataclass
class FileCounts:
    """Counts of one source: for each line with code, how often it ran; for each line with branches,
    how often each was taken."""

    lines: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[int]] = field(default_factory=dict)

    def add(self, other: FileCounts) -> None:
        """Add the counts of the same source in another object. The branches of a line have the same
        order in each."""
        for line, count in other.lines.items():
            self.lines[line] = self.lines.get(line, 0) + count
        for line, taken in other.branches.items():
            self.branches[line] = [
                a + b for a, b in zip_longest(self.branches.get(line, []), taken, fillvalue=0)
            ]


def read_counts(build: Path, root: Path, below: str, pattern: str) -> dict[str, FileCounts]:
    """The counts of all sources below ``root / below``, by their path from ``root``.

    ``pattern`` chooses the objects by the path of their ``.gcda`` file in ``build``.
    """
    counts: dict[str, FileCounts] = {}
    for data in sorted(build.rglob("*.gcda")):
        if pattern not in data.as_posix():
            continue
        for name, found in _counts_of(data, root).items():
            if name.startswith(below):
                counts.setdefault(name, FileCounts()).add(found)
    return counts


def _counts_of(data: Path, root: Path) -> dict[str, FileCounts]:
    done = subprocess.run(
        ["gcov", "--json-format", "--stdout", "--branch-probabilities", str(data)],
        check=True,
        capture_output=True,
        text=True,
    )
    report: dict[str, Any] = json.loads(done.stdout)
    found: dict[str, FileCounts] = {}
    for file in report["files"]:
        path = Path(report["current_working_directory"], file["file"]).resolve()
        if path.is_relative_to(root):
            found.setdefault(path.relative_to(root).as_posix(), FileCounts()).add(
                _file_counts(file["lines"])
            )
    return found


def _file_counts(lines: Iterable[dict[str, Any]]) -> FileCounts:
    """A line may come more than once, for each instance of an inline function or macro."""
    counts = FileCounts()
    for line in lines:
        number = int(line["line_number"])
        counts.add(FileCounts({number: int(line["count"])}))
        if line["branches"]:
            counts.branches.setdefault(number, []).extend(
                int(branch["count"]) for branch in line["branches"]
            )
    return counts
