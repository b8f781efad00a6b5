"""``eitskin bench solve``: the time to a given suboptimality, side by side with other solvers, one
thread, interleaved rounds.

For each solver, problem and level the least effort on its ladder that gets there is found first,
judged in float64; only that is timed, in processor time of the one thread. So no solver pays for a
stopping rule that is too careful.
"""

import gc
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from eitskin.progress import Progress
from eitskin_studies.benchmarks.solve_peers import (
    Candidate,
    candidates,
    numpy_fista,
    ours,
    versions,
)
from eitskin_studies.benchmarks.solve_problems import Problems, make_problems, models, sessions
from eitskin_studies.harness.machine import machine
from eitskin_studies.harness.sections import Filling

LEVELS = (1e-2, 1e-4, 1e-6)
EQUAL_ITERATIONS = (30, 60, 200)
BASE = "eitskin active-set, float32"
AIMS = {"SPAMS": 5, "DAQP": 30, "celer": 100, "scikit-learn": 400}
"""By these factors ``BASE`` was to be faster at the last level."""
MAX_S = 3.0
"""A solver that needs longer for one problem has not reached the level."""


@dataclass
class Timed:
    """One solver at one level: seconds a problem in each round; None if a problem did not get
    there."""

    name: str
    level: float
    calls: list[Callable[[], Any]] | None
    worst: float = 0.0
    per_problem: int = 1
    rounds_s: list[float] = field(default_factory=list)

    @property
    def median_us(self) -> float:
        """Microseconds a problem."""
        return 1e6 * float(np.median(self.rounds_s))


def one_thread() -> AbstractContextManager[Any]:
    """BLAS and OpenMP held to one thread where threadpoolctl is there (scikit-learn brings it)."""
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return nullcontext()
    limits: AbstractContextManager[Any] = threadpool_limits(1)
    return limits


def _least_effort(
    problems: Problems, candidate: Candidate, k: int, levels: Sequence[float]
) -> dict[float, tuple[Any, float]]:
    """For each level the first setting that gets problem ``k`` there, and the suboptimality
    then."""
    found: dict[float, tuple[Any, float]] = {}
    for setting in candidate.ladder:
        run = candidate.prepare(k, setting)
        start = perf_counter()
        x = candidate.read(run())
        took = perf_counter() - start
        if candidate.batch:
            reached = max(problems.suboptimality(i, x[i]) for i in range(len(problems)))
        else:
            reached = problems.suboptimality(k, x, signed=candidate.signed)
        for level in levels:
            if reached <= level and level not in found:
                found[level] = (setting, reached)
        if len(found) == len(levels) or took > MAX_S:
            break
    return found


def _plan(problems: Problems, candidate: Candidate) -> list[Timed]:
    candidate.prepare(
        0, candidate.ladder[len(candidate.ladder) // 2]
    )()  # what compiles does so now
    numbers = [0] if candidate.batch else range(len(problems))
    efforts = [_least_effort(problems, candidate, k, LEVELS) for k in numbers]
    plans = []
    for level in LEVELS:
        if not all(level in effort for effort in efforts):
            plans.append(Timed(candidate.name, level, None))
            continue
        worst = max(effort[level][1] for effort in efforts)
        calls = [(k, effort[level][0]) for k, effort in zip(numbers, efforts, strict=True)]
        plans.append(
            Timed(
                candidate.name,
                level,
                [_Call(candidate, k, how) for k, how in calls],
                worst,
                max(1, candidate.batch),
            )
        )
    return plans


@dataclass(frozen=True)
class _Call:
    """Prepares, untimed, and runs; returns the thread's processor seconds: what others do on the
    machine does not count."""

    candidate: Candidate
    k: int
    setting: Any

    def __call__(self) -> float:
        run = self.candidate.prepare(self.k, self.setting)
        start = thread_time()
        run()
        return thread_time() - start


def _round(plan: Timed) -> None:
    assert plan.calls is not None
    plan.rounds_s.append(sum(call() for call in plan.calls) / len(plan.calls) / plan.per_problem)


def _time(plans: list[Timed], rounds: int, progress: Progress) -> None:
    """Interleaved rounds; the slow ones in fewer of them, three at least."""
    for number in progress(range(rounds)):
        for plan in plans:
            if plan.calls is None or (
                number >= 3 and sum(plan.rounds_s) * len(plan.calls) * plan.per_problem > 2.0
            ):
                continue
            gc.disable()
            _round(plan)
            gc.enable()


def _table(problems: Problems, rounds: int, progress: Progress) -> dict[str, Any]:
    chosen = candidates(problems)
    plans = [plan for candidate in progress(chosen) for plan in _plan(problems, candidate)]
    _time(plans, rounds, progress)
    base = {p.level: p for p in plans if p.name == BASE}
    rows = []
    for plan in plans:
        row: dict[str, Any] = {
            "solver": plan.name,
            "level": plan.level,
            "reached": plan.calls is not None,
        }
        if plan.calls is not None:
            row |= {
                "us": plan.median_us,
                "us_low": 1e6 * float(np.percentile(plan.rounds_s, 25)),
                "us_high": 1e6 * float(np.percentile(plan.rounds_s, 75)),
                "ratio": plan.median_us / base[plan.level].median_us,
                "worst_suboptimality": plan.worst,
                "rounds": len(plan.rounds_s),
            }
        rows.append(row)
    return {
        "problems": problems.name,
        "count": len(problems),
        "shape": list(problems.s.shape),
        "nonzeros": problems.nonzeros,
        "rows": rows,
        "equal_iterations": _equal(problems, rounds),
    }


def _equal(problems: Problems, rounds: int) -> list[dict[str, Any]]:
    """FISTA at equal iterations: ours, on every column, beside numpy's."""
    found = []
    mine = [c for c in ours(problems) if "fista" in c.name or "working-set" in c.name]
    for count in EQUAL_ITERATIONS:
        plans = [
            Timed(c.name, 0.0, [_Call(c, k, count) for k in range(len(problems))])
            for c in [*mine, numpy_fista(problems, np.float32), numpy_fista(problems, np.float64)]
        ]
        for _ in range(max(3, rounds // 2)):
            for plan in plans:
                _round(plan)
        base = next(p for p in plans if p.name == "eitskin fista, float32")
        for plan in plans:
            found.append(
                {
                    "solver": plan.name,
                    "iterations": count,
                    "us": plan.median_us,
                    "ratio": plan.median_us / base.median_us,
                }
            )
    return found


def run(scenes: int, seed: int, rounds: int, progress: Progress) -> dict[str, Any]:
    """All tables, for JSON."""
    with one_thread():
        session = sessions(scenes, seed)
        tables = [_table(make_problems(*model, session), rounds, progress) for model in models()]
    return {
        "machine": machine(),
        "versions": versions(),
        "seed": seed,
        "snr_db": 60.0,
        "rounds": rounds,
        "tables": tables,
    }


def text(result: dict[str, Any]) -> str:
    """Tables of microseconds a problem and ratios to the active set in float32."""
    known = {name: number for name, number in result["versions"].items() if number}
    lines = [
        (
            "time to (F - F*) / F*, microseconds of processor time a problem: medians of"
            f" {result['rounds']} interleaved rounds (fewer where slow, 3 at least), one thread,"
            f" seed {result['seed']}, 60 dB; {result['machine']}"
        ),
        ", ".join(f"{name} {number}" for name, number in known.items()),
        *(
            f"not installed: {name}; run  pip install {name}"
            for name, number in result["versions"].items()
            if number is None
        ),
    ]
    for table in result["tables"]:
        rows = table["rows"]
        names = list(dict.fromkeys(row["solver"] for row in rows))
        rank, n = table["shape"]
        facts = f"{table['count']} problems, {table['nonzeros']:.1f} non-zeros at the optimum"
        lines += ["", f"{table['problems']}, {rank} x {n}, {facts}"]
        lines.append(f"{'':44}" + "".join(f"{level:>8.0e} us {'ratio':>9}" for level in LEVELS))
        for name in names:
            cells = []
            for level in LEVELS:
                row = next(r for r in rows if r["solver"] == name and r["level"] == level)
                cells.append(
                    f"{row['us']:11.1f} {row['ratio']:9.2f}"
                    if row["reached"]
                    else f"{'-':>11} {'':9}"
                )
            lines.append(f"{name:44}" + "".join(cells))
        lines.append(
            "FISTA at equal iterations, us and ratio to the C core's on every column in float32"
        )
        for count in EQUAL_ITERATIONS:
            same = [r for r in table["equal_iterations"] if r["iterations"] == count]
            cells = [
                f"{r['solver'].removeprefix('eitskin ')} {r['us']:.0f} ({r['ratio']:.2f})"
                for r in same
            ]
            lines.append(f"  {count:4}: " + "; ".join(cells))
    return "\n".join(lines)


def _factor(factor: float, aim: float) -> str:
    number = f"{factor:.1f}" if factor < 10 else f"{factor:.0f}"
    return number if factor >= aim else f"**{number}** (missed)"


def for_page(result: dict[str, Any], command: str) -> Filling:
    """The marks of studies/results/benchmarks.md that are about times: microseconds of each solver,
    and the factor between the fastest variant of a program and ``BASE``."""
    tables, aim = result["tables"], LEVELS[-1]
    times = [
        {(row["solver"], row["level"]): row["us"] for row in table["rows"] if row["reached"]}
        for table in tables
    ]
    names = list(dict.fromkeys(row["solver"] for table in tables for row in table["rows"]))
    head = [f"{table['problems']}: {level:.0e}" for table in tables for level in LEVELS]
    rows = []
    for name in names:
        found = [us.get((name, level)) for us in times for level in LEVELS]
        rows.append([name, *("-" if one is None else f"{one:.0f}" for one in found)])
    factors = []
    for program, least in AIMS.items():
        cells = []
        for us in times:
            ends = [one for (name, level), one in us.items() if level == aim and program in name]
            cells.append(_factor(min(ends) / us[BASE, aim], least) if ends else "-")
        if any(program in name for name in names):
            factors.append([program, f"{least}", *cells])
    versions = [f"{name} {one}" for name, one in result["versions"].items() if one]
    counts = ", ".join(f"{table['nonzeros']:.1f} ({table['problems']})" for table in tables)
    run = (
        f"By `{command}`: {tables[0]['count']} random scenes (1 to 3 touches, 60 dB, seed"
        f" {result['seed']}), {tables[0]['shape'][1]} columns; the mean number of non-zeros at the"
        f" optimum is {counts}. Medians of {result['rounds']} interleaved rounds, and of fewer for"
        f" slow solvers; {result['machine']}; {', '.join(versions)}."
    )
    return {"solve-run": run}, {
        "solve": (["solver", *head], rows),
        "factors": (["than", "aim", *(table["problems"] for table in tables)], factors),
    }
