"""Change the core one mistake at a time (mutations.py) and see whether the C tests notice.

    python tests/tools/mutate.py [--only WORD] [--workers COUNT]

Each worker has a copy of the sources in a temporary folder, where what a mutation changes is built
anew and the C tests run, the likeliest first, until one fails, crashes or does not end. A test that
fails is run on the unchanged sources too. Ends with 1 where a mutation survives, does not compile,
or no longer fits the sources.
"""

from __future__ import annotations

import argparse
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue

from mutation import Mutation
from mutations import MUTATIONS

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "CMakeLists.txt",
    "cmake",
    "csrc",
    "firmware",
    "tests/c",
    "tests/fuzz",
    "tests/firmware",
    "tests/soak",
)
SOURCES = Path("csrc") / "src"
MOST_CPU_SECONDS = 12
SLOW_LAST = ("solve_state", "solve", "touch", "working_set", "exact", "mac_limit", "model_values")


@dataclass(frozen=True)
class Outcome:
    """What became of a mutation: the test that noticed, and how; or what is wrong with it."""

    mutation: Mutation
    noticed: str = ""
    wrong: str = ""

    def __str__(self) -> str:
        return f"{self.mutation.file:16s} {self.mutation.name:58s} {self.noticed or self.wrong}"


@dataclass
class Tree:
    """A copy of the sources with its build. ``sound``: tests that pass on the unchanged sources."""

    root: Path
    sound: set[str] = field(default_factory=set)

    @property
    def build(self) -> Path:
        return self.root / "build"

    def make(self) -> None:
        """Copy and configure."""
        for name in COPIED:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, self.root / name)
            else:
                shutil.copy(ROOT / name, self.root / name)
        command = [
            "cmake",
            "-S",
            str(self.root),
            "-B",
            str(self.build),
            "-G",
            "Ninja",
            "-DCMAKE_BUILD_TYPE=None",
        ]
        subprocess.run([*command, "-DCMAKE_C_FLAGS=-O1 -w"], check=True, capture_output=True)

    def failure(self, test: str) -> str:
        """How the test fails on the sources as they are; empty where it passes.

        Raises:
            ChildProcessError: it cannot be built.
        """
        built = subprocess.run(
            ["cmake", "--build", str(self.build), "--target", test, "-j", "1"],
            capture_output=True,
            text=True,
            check=False,
        )
        if built.returncode != 0:
            raise ChildProcessError(
                next(
                    (line for line in built.stdout.splitlines() if "error:" in line),
                    built.stdout[-300:],
                )
            )
        program = self.build / "tests" / "c" / test
        limited = ["sh", "-c", f'ulimit -t {MOST_CPU_SECONDS}; exec "$0"', str(program)]
        done = subprocess.run(limited, capture_output=True, check=False)
        if done.returncode == -signal.SIGXCPU:
            return "does not end"
        if done.returncode < 0:
            return "crashes"
        return "fails" if done.returncode else ""


def c_tests() -> tuple[str, ...]:
    """The names in tests/c/CMakeLists.txt, quick ones first."""
    listed = re.search(
        r"set\(EITSKIN_C_TESTS ([^)]*)\)", (ROOT / "tests" / "c" / "CMakeLists.txt").read_text()
    )
    names = listed[1].split() if listed else []
    return tuple(sorted(names, key=lambda name: SLOW_LAST.index(name) if name in SLOW_LAST else -1))


def programs_for(mutation: Mutation, tests: Sequence[str]) -> Iterator[str]:
    """The likeliest first; the narrow width before the wide one."""
    for width in ("f32", "f64"):
        for name in (mutation.first, *(test for test in tests if test != mutation.first)):
            yield f"test_{name}_{width}"


def stale(mutation: Mutation) -> str:
    """What is wrong with the pattern; empty where it stands in its file once and is changed."""
    count = (ROOT / SOURCES / mutation.file).read_text().count(mutation.original)
    if mutation.original == mutation.replacement:
        return "changes nothing"
    return "" if count == 1 else f"stale: {mutation.original!r} is there {count} times, not once"


def try_mutation(tree: Tree, mutation: Mutation, tests: Sequence[str]) -> Outcome:
    """Whether the tests notice it in this tree, which is as it was afterwards."""
    file = tree.root / SOURCES / mutation.file
    source = file.read_text()
    changed = source.replace(mutation.original, mutation.replacement)
    try:
        for program in programs_for(mutation, tests):
            file.write_text(changed)
            how = tree.failure(program)
            if not how:
                continue
            if program not in tree.sound:
                file.write_text(source)
                if tree.failure(program):
                    return Outcome(mutation, wrong=f"{program} fails without it too")
                tree.sound.add(program)
            return Outcome(mutation, noticed=f"{program.removeprefix('test_')} {how}")
    except ChildProcessError as error:
        return Outcome(mutation, wrong=f"does not compile: {error}")
    finally:
        file.write_text(source)
    return Outcome(mutation, wrong="SURVIVED")


def run_all(mutations: Sequence[Mutation], tests: Sequence[str], workers: int) -> list[Outcome]:
    """Each mutation's outcome, in order, printed as it comes."""
    trees: SimpleQueue[Tree] = SimpleQueue()

    def one(mutation: Mutation) -> Outcome:
        tree = trees.get()
        try:
            outcome = try_mutation(tree, mutation, tests)
        finally:
            trees.put(tree)
        print(outcome, flush=True)
        return outcome

    with (
        tempfile.TemporaryDirectory(prefix="eitskin-mutate-") as folder,
        ThreadPoolExecutor(workers) as pool,
    ):
        made = [Tree(Path(folder) / str(number)) for number in range(workers)]
        for tree in made:
            tree.root.mkdir()
            (tree.root / "tests").mkdir()
            tree.make()
            trees.put(tree)
        return list(pool.map(one, mutations))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", metavar="WORD", default="", help="mutations whose name or file has this"
    )
    parser.add_argument("--workers", metavar="COUNT", type=int, default=2)
    options = parser.parse_args()
    chosen = [m for m in MUTATIONS if options.only in m.name or options.only in m.file]
    unfit = [f"{m.file}: {m.name}: {why}" for m in chosen if (why := stale(m))]
    if unfit or not chosen:
        print(*(unfit or [f"no mutation has {options.only!r} in its name or file"]), sep="\n")
        return 1
    outcomes = run_all(chosen, c_tests(), options.workers)
    bad = [outcome for outcome in outcomes if not outcome.noticed]
    print(
        f"{len(outcomes)} mutations, {len(outcomes) - len(bad)} noticed", *map(str, bad), sep="\n  "
    )
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
