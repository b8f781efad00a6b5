"""Make the numbers, tables and pictures of the results again: ``studies/run NAME...`` or ``--all``.

Each command fills its page and stores the numbers with the commit in ``results/numbers``. A study
that is stopped goes on where it was, in ``out``. With ``--at-once 2`` two commands run at a time,
in the order of their names, or with ``--all`` those first that take long; commands that time this
computer run by themselves at the end. A command that fails does not stop the others. At last the
README's numbers are filled from the pages, and the page of all results gets the processor time of
each command.

The folders of measured frames are named in the environment: TANKS (docs/guide/tank.md) and
PRESSES (results/teaching.md); without them the studies on them are left out, which is printed.
"""

import argparse
import math
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from eitskin.config import nearest
from eitskin.errors import UsageError
from eitskin_emulator.core_on_qemu import checkout_root
from eitskin_studies.experiments.registry import EXPERIMENTS
from eitskin_studies.harness.numbers import tables_of
from eitskin_studies.harness.sections import fill_marks, fill_readme

RESULTS = "studies/results"
# studies on measured frames, and who names them
DATA = {"tank": "TANKS", "teaching": "PRESSES", "taught-sessions": "PRESSES",
        "constants": "PRESSES"}  # fmt: skip
SHARES = {"other-worlds": "0.5", "patterns": "0.3"}  # of the usual scenes, as the pages have them
SEEDS = {"hands": "59"}  # in place of 1 and 47, with whose scenes the tracker was tuned
OTHERS = {
    "tradeoff": "tradeoff run -o out/tradeoff --page {page}"
    " --recorded studies/eitskin_studies/tradeoff/front.json"
    " --front python/eitskin/tuning/front.json",
    "limit": "bench limit --scenes 60 --seed 1 --page {page}",
    "diagnostics": "bench diagnostics --scenes 320 --crowds 24 --imperfect 40 --seed 4001"
    " --page {page}",
    "gestures": "bench gestures --sessions 20 --seed 7001 --role judging --snr-db 60 40"
    " --page {page}",
    "peers": "bench peers --scenes 20 --seed 1 --page {page}",
    "scene-cost": "bench effects --frames 40 --page {page}",
    "latency": "bench latency --presses 200 --emulated 24 --seed 1 --order 'by 7' --page {page}",
    "board-cost": "bench board --scenes 180 --seed 1 --frames 12 --page {page}",
    "time": "bench time --frames 4 --page {results}/board-cost.md",
    "columns": "bench columns --scenes 100 --seed 1 --cache out/other-worlds/frames"
    " --page {results}/board-cost.md",
    "energy": "bench energy --page {results}/board-cost.md",
    "outputs": "bench outputs --taps 24 --seconds 20 --load 600 --seed 1 --page {page}",
    "view": "bench view --seconds 30 --page {results}/outputs.md",
    "view-load": "bench view --seconds 300 --load --page {results}/outputs.md",
    "kernels": "bench kernels --rank 64 --columns 812 --rounds 41 --page {results}/benchmarks.md",
    "batches": "bench batches --frames 1000 --rounds 9 --threads 1 2"
    " --page {results}/benchmarks.md",
    "growth": "bench growth --rounds 21 --page {results}/benchmarks.md",
    "solve": "bench solve --scenes 20 --seed 3 --rounds 11 --page {results}/benchmarks.md",
    "optimum": "bench solve --optimum --scenes 60 --seed 1 --page {results}/benchmarks.md",
}
# commands that time this computer, that need what others have filled, or that install the package
# again if a file changed: one by one, at the end
ALONE = (
    "solve", "kernels", "batches", "growth", "scene-cost", "columns", "energy", "hard-cases",
    "view", "outputs", "view-load",
)  # fmt: skip
# a command that uses the results of another, or that fills a page that it fills
AFTER = {"belief": "other-worlds", "time": "board-cost"}
FRAMES = Path("out/other-worlds/frames"), Path("out/belief/frames")  # simulated once for both
TIMES = "processor-time"  # mark on the page of all results
TIMES_HEAD = ("command", "processor time, min")


@dataclass(frozen=True)
class _Done:
    """A command that ended: its status, processor time and wall time in s, and whether it began
    anew, so that its time says what it takes."""

    name: str
    status: int
    processor_s: float
    wall_s: float
    anew: bool


def commands() -> dict[str, list[str]]:
    """The command of each study by name; of studies on measured frames only where there are
    some."""
    found = {}
    for name in EXPERIMENTS:
        words, page = f"study {name} -o out/{name}".split(), f"{RESULTS}/{name}.md"
        if (checkout_root() / page).is_file():
            words += ["--page", page]
        if name in SHARES:
            words += ["--share", SHARES[name]]
        if name in SEEDS:
            words += ["--seed", SEEDS[name]]
        if name in DATA:
            if not (folder := os.environ.get(DATA[name])):
                continue
            words += ["--data", folder]
        found[name] = ["eitskin", *words]
    for name, text in OTHERS.items():
        whole = text.format(page=f"{RESULTS}/{name}.md", results=RESULTS)
        found[name] = ["eitskin", *shlex.split(whole)]
    found["hard-cases"] = ["scripts/hard-cases"]
    return found


def main(words: Sequence[str]) -> int:
    """Run the commands that ``words`` name.

    Raises:
        UsageError: a word names none, or there is no word.
    """
    options = _options(words)
    known = commands()
    for name, variable in DATA.items():
        if name not in known:
            print(f"studies/run: {name} is left out; name the folder of its frames in {variable}")
    if options.list:
        print("\n".join(f"{name:13} {shlex.join(command)}" for name, command in known.items()))
        return 0
    chosen = _longest_first(known) if options.all else options.names
    if not chosen:
        raise UsageError("studies/run: name studies, or use --list or --all")
    for name in chosen:
        if name not in known:
            raise UsageError(f"studies/run: no study is named {name!r}; {nearest(name, known)}")
    root = checkout_root()
    done = _run_all(chosen, known, root, options.at_once)
    fill_readme(root / "README.md", root / RESULTS)
    keep_times(root / RESULTS / "README.md", [one for one in done if one.anew and not one.status])
    failed = [one.name for one in done if one.status]
    if failed:
        print(f"studies/run: failed: {' '.join(failed)}; out/NAME.log says why")
    return 1 if failed else 0


def _options(words: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="studies/run", description=__doc__.split("\n\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to make again")
    parser.add_argument("--all", action="store_true", help="all of them")
    parser.add_argument("--list", action="store_true", help="print the commands, and end")
    parser.add_argument("--at-once", type=int, default=1, metavar="N", help="commands at a time")
    return parser.parse_args(words)


def _longest_first(known: Iterable[str]) -> list[str]:
    """By the time that they took; those without one first."""
    took = _known_times(checkout_root() / RESULTS / "README.md")
    return sorted(known, key=lambda name: -float(took.get(name, math.inf)))


def _run_all(
    chosen: Sequence[str], known: dict[str, list[str]], root: Path, at_once: int
) -> list[_Done]:
    """Run chains of commands in their order, ``at_once`` of them at a time; then those that must be
    alone."""
    chains = [[name] for name in chosen if name not in ALONE and AFTER.get(name) not in chosen]
    for name, first in AFTER.items():
        chains = [
            [*chain, name] if name in chosen and first in chain else chain for chain in chains
        ]

    def run_chain(chain: Sequence[str]) -> list[_Done]:
        return [_run(name, known[name], root) for name in chain]

    with ThreadPoolExecutor(at_once) as lanes:
        done = [one for some in lanes.map(run_chain, chains) for one in some]
    return done + run_chain([name for name in ALONE if name in chosen])


def _run(name: str, command: Sequence[str], root: Path) -> _Done:
    """Run one command; what it prints is in ``out/NAME.log``."""
    out = root / "out"
    out.mkdir(exist_ok=True)
    anew = not (out / name).exists()
    if name == "belief" and (root / FRAMES[0]).is_dir() and anew:
        (root / FRAMES[1]).parent.mkdir()
        (root / FRAMES[1]).symlink_to(root / FRAMES[0])
    print(f"== {shlex.join(command)}", flush=True)
    began = time.monotonic()
    with (out / f"{name}.log").open("wb") as log:
        child = subprocess.Popen(command, cwd=root, stdout=log, stderr=subprocess.STDOUT)
        _, ended, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(ended)
    one = _Done(
        name, child.returncode, used.ru_utime + used.ru_stime, time.monotonic() - began, anew
    )
    result = f"failed with {one.status}" if one.status else "done"
    print(
        f"== {name}: {result}, {one.processor_s / 60:.1f} min of processor time, "
        f"{one.wall_s / 60:.1f} min",
        flush=True,
    )
    return one


def keep_times(page: Path, done: Sequence[_Done]) -> None:
    """Put the processor time of each command into the table of ``page``; commands that did not run
    keep theirs.

    Raises:
        FileError, ConfigError: the page or its numbers cannot be read or written.
    """
    times = _known_times(page)
    times |= {one.name: f"{one.processor_s / 60:.1f}" for one in done}
    if done:
        fill_marks(page, "results", ({}, {TIMES: (TIMES_HEAD, sorted(times.items()))}))


def _known_times(page: Path) -> dict[str, str]:
    _, rows = tables_of(page.parent).get(f"{page.stem}.{TIMES}", ((), ()))
    return dict(rows)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except UsageError as error:
        sys.exit(str(error))
