"""Put small mistakes into the sources, one at a time, and see whether the tests notice.

    studies/mutate [--sample COUNT] [--only WORD] [--seed WORD] [--workers COUNT]

Mistakes are made from the syntax (mutants.py): of all of them a sample, the same in every run, over
the core and the firmware. The C tests try them. Beside these, a few picked by hand (mistakes.toml).
A mutant that compiles to the same object does not count. One that no test notices must be judged in
survivors.toml. Ends with 1 if less than 95 % of the others are noticed (in a small sample, less
than chance makes of that), where a mistake picked by hand is not, or where a judgement or mistake
fits no source any more."""

import argparse
import hashlib
import math
import sys
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

import mutate_c
from mutants import ROOT, Mutant, mutants_of

TOOLS = Path(__file__).resolve().parent
MIN_KILL_PERCENT = 95.0
WHOLE_SAMPLE = 100  # mutants from which on the rate itself must be met
NO_MUTANT = ("refused", "same")


@dataclass(frozen=True)
class Outcome:
    """The outcome of a mutant; ``noticed`` is empty if it survived."""

    mutant: Mutant
    noticed: str


def all_mutants(files: Iterable[str], only: str, seed: str) -> list[Mutant]:
    """Return the mutants of these sources in the order in which samples take them; each seed gives
    another order."""
    found = [mutant for file in files for mutant in mutants_of(file)]
    return sorted(
        (m for m in found if only in f"{m}"),
        key=lambda m: hashlib.sha256((seed + m.place).encode()).digest() if seed else m.place,
    )


def read_judged() -> set[tuple[str, str, str, str]]:
    """The keys in survivors.toml."""
    rows = tomllib.loads((TOOLS / "survivors.toml").read_text()).get("survivor", [])
    return {(row["file"], row["function"], row["before"], row["after"]) for row in rows}


def read_mistakes() -> list[Mutant]:
    """Return the mistakes that were picked by hand. The text to change must be in its file once."""
    made = []
    for row in tomllib.loads((TOOLS / "mistakes.toml").read_text())["mistake"]:
        source = (ROOT / row["file"]).read_text()
        if source.count(row["before"]) != 1:
            raise SystemExit(
                f"mistakes.toml is stale: {row['file']} has not once {row['before']!r}"
            )
        start = source.index(row["before"])
        end = start + len(row["before"])
        made.append(
            Mutant(row["file"], row["name"], start, end, row["after"], row["before"], row["after"])
        )
    return made


def try_all(
    mutants: Iterable[Mutant], count: int, workers: int, one: Callable[[Mutant, int], str]
) -> list[Outcome]:
    """Try mutants until ``count`` of them are some; print each survivor as it comes."""
    free: SimpleQueue[int] = SimpleQueue()
    for worker in range(workers):
        free.put(worker)

    def each(mutant: Mutant) -> Outcome:
        worker = free.get()
        try:
            outcome = Outcome(mutant, one(mutant, worker))
        finally:
            free.put(worker)
        if not outcome.noticed:
            print(f"   survives: {mutant}", flush=True)
        return outcome

    done: list[Outcome] = []
    queue = iter(mutants)
    with ThreadPoolExecutor(workers) as pool:
        while missing := count - len(done):
            batch = [mutant for mutant, _ in zip(queue, range(missing), strict=False)]
            if not batch:
                break
            tried = pool.map(each, batch)
            done += [outcome for outcome in tried if outcome.noticed not in NO_MUTANT]
    return done


def try_c(
    libraries: dict[str, mutate_c.Library], mutants: Iterable[Mutant], count: int, workers: int
) -> list[Outcome]:
    """By the C tests."""
    with tempfile.TemporaryDirectory(prefix="eitskin-mutate-") as folder:
        shops = [mutate_c.Workshop(libraries, Path(folder) / str(k)) for k in range(workers)]
        return try_all(mutants, count, workers, lambda m, worker: shops[worker].try_mutant(m))


def max_survivors(count: int, least: float) -> int:
    """Return how many of ``count`` mutants may survive if ``least`` per cent must be noticed. Of a
    small sample, as many may survive as chance leaves in 19 of 20 samples that just meet the
    rate."""
    missed = 1 - least / 100
    if count >= WHOLE_SAMPLE or missed == 0:
        return int(missed * count + 1e-9)
    probability, most = 0.0, -1
    while probability < 0.95:
        most += 1
        probability += math.comb(count, most) * missed**most * (1 - missed) ** (count - most)
    return most


def report(kind: str, outcomes: list[Outcome], least: float) -> bool:
    """Print the rate; whether it suffices."""
    count, killed = len(outcomes), sum(bool(outcome.noticed) for outcome in outcomes)
    if count == 0:
        return True
    print(f"   {kind}: {killed} of {count} noticed, {100 * killed / count:.1f} %", flush=True)
    return count - killed <= max_survivors(count, least)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sample", metavar="COUNT", type=int, default=200, help="mutants")
    parser.add_argument("--only", metavar="WORD", default="", help="those whose text has this")
    parser.add_argument("--seed", metavar="WORD", default="", help="another sample")
    parser.add_argument("--workers", metavar="COUNT", type=int, default=2)
    options = parser.parse_args()
    judged = read_judged()
    made = all_mutants(mutate_c.sources(), options.only, options.seed)
    stale = judged - {mutant.key for mutant in made} if not options.only else set()
    for key in sorted(stale):
        print("   survivors.toml is stale:", " | ".join(key))
    picked = [mistake for mistake in read_mistakes() if options.only in f"{mistake}"]
    libraries = mutate_c.read_libraries()
    of_hand = try_c(libraries, picked, len(picked), options.workers)
    unjudged = (mutant for mutant in made if mutant.key not in judged)
    of_c = try_c(libraries, unjudged, options.sample, options.workers)
    right = [
        report("picked by hand", of_hand, 100),
        report("made from the syntax", of_c, MIN_KILL_PERCENT),
    ]
    return 0 if all(right) and not stale else 1


if __name__ == "__main__":
    sys.exit(main())
