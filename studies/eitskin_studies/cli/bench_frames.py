"""``eitskin bench``: a frame, the solve, batches, kernels and growth on this computer."""

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin_studies.cli.bench_shared import add_page_option, check_within, progress_bar, show


def add_frame(what: Any) -> None:
    """``bench frame``."""
    parser = what.add_parser(
        "frame", help="time one frame through cffi: p50, p99, share outside C; and numpy"
    )
    option(parser, "--runs", default=2000)
    option(parser, "--json")
    parser.set_defaults(run=run_frame)


def run_frame(options: argparse.Namespace) -> int:
    """Time a frame."""
    from eitskin_studies.benchmarks import frame as bench_frame

    if not 100 <= options.runs <= 10_000_000:
        raise UsageError(f"bench frame: --runs {options.runs} is out of range; use 100 to 10000000")
    times = bench_frame.run(options.runs)
    print(json.dumps(times.as_dict(), indent=2) if options.json else bench_frame.to_text(times))
    return 0


def add_solve(what: Any) -> None:
    """``bench solve``."""
    parser = what.add_parser(
        "solve", help="time the solve alone, to a suboptimality, beside other solvers"
    )
    option(parser, "--scenes", "problems for each model", default=20)
    option(parser, "--seed", "seed of the scenes", default=3)
    option(parser, "--rounds", "interleaved rounds", default=11)
    option(parser, "--optimum", "compare suboptimality with MIoU instead")
    add_page_option(parser)
    parser.set_defaults(run=run_solve)


def run_solve(options: argparse.Namespace) -> int:
    """Time the solvers, or compare their suboptimality with the MIoU of their images."""
    from eitskin.fileio import refuse_unwritable

    check_within("--scenes", options.scenes, 4, 1000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    check_within("--rounds", options.rounds, 3, 10_000)
    refuse_unwritable(options.page)
    if options.optimum:
        return _show_optimum(options)
    from eitskin_studies.benchmarks import solve as bench_solve
    from eitskin_studies.harness.sections import fill_marks

    result = bench_solve.run(options.scenes, options.seed, options.rounds, progress_bar)
    if options.page is not None:
        command = (
            f"eitskin bench solve --scenes {options.scenes} --seed {options.seed} --rounds"
            f" {options.rounds}"
        )
        fill_marks(options.page, "benchmarks", bench_solve.for_page(result, command))
    print(json.dumps(result, indent=2) if options.json else bench_solve.text(result))
    return 0


def _show_optimum(options: argparse.Namespace) -> int:
    from eitskin_studies.benchmarks import suboptimality
    from eitskin_studies.harness.drawings import Drawing, draw_again, keep_drawings
    from eitskin_studies.pictures.suboptimality_picture import draw_suboptimality

    curves = suboptimality.run(options.scenes, options.seed, progress_bar)
    if options.page is not None:
        drawing = Drawing(draw_suboptimality, curves.as_dict())
        keep_drawings(options.page, {"pictures/suboptimality.svg": drawing})
        draw_again(options.page)
    command = f"eitskin bench solve --optimum --scenes {options.scenes} --seed {options.seed}"
    filling = suboptimality.for_page(curves, command)
    return show(options, curves, suboptimality.text(curves), filling)


def add_batches(what: Any) -> None:
    """``bench batches``."""
    parser = what.add_parser(
        "batches", help="time batches of frames, on several threads and on one"
    )
    option(parser, "--frames", default=1000)
    option(parser, "--rounds", default=9)
    option(parser, "--threads N", None, int, nargs="+", default=[1, 2])
    add_page_option(parser)
    parser.set_defaults(run=run_batches)


def run_batches(options: argparse.Namespace) -> int:
    """Time batches over threads."""
    from eitskin.fileio import refuse_unwritable
    from eitskin.solve.batch import check_threads
    from eitskin_studies.benchmarks import batches as bench_batches

    check_within("--frames", options.frames, 8, 1_000_000)
    check_within("--rounds", options.rounds, 1, 1000)
    for count in options.threads:
        check_threads(count)
    refuse_unwritable(options.page)
    result = bench_batches.run(options.frames, options.rounds, options.threads)
    command = (
        f"eitskin bench batches --frames {options.frames} --rounds {options.rounds} --threads"
        f" {' '.join(map(str, options.threads))}"
    )
    filling = bench_batches.for_page(result, command)
    return show(options, result, bench_batches.as_text(result), filling)


def add_kernels(what: Any) -> None:
    """``bench kernels``."""
    parser = what.add_parser(
        "kernels",
        help="time each C kernel beside the machine's measured peaks; needs a checkout",
        description=(
            "Build a C program from the source checkout that times every kernel beside this"
            " machine's peaks of memory and arithmetic, in turns, and say how far from its limit"
            " each is."
        ),
    )
    option(parser, "--rank", "numbers in a column", default=64)
    option(parser, "--columns", default=812)
    option(parser, "--rounds", default=41)
    add_page_option(parser)
    parser.set_defaults(run=run_kernels)


def run_kernels(options: argparse.Namespace) -> int:
    """Time each kernel beside the machine's peaks."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import kernels as bench_kernels

    check_within("--rank", options.rank, 8, 1024)
    check_within("--columns", options.columns, 48, 20_000)
    check_within("--rounds", options.rounds, 1, 200)
    refuse_unwritable(options.page)
    result = bench_kernels.run(options.rank, options.columns, options.rounds)
    command = (
        f"eitskin bench kernels --rank {options.rank} --columns {options.columns} --rounds"
        f" {options.rounds}"
    )
    filling = bench_kernels.for_page(result, command)
    return show(options, result, bench_kernels.as_text(result), filling)


def add_growth(what: Any) -> None:
    """``bench growth``."""
    parser = what.add_parser(
        "growth", help="time and MACs of a frame by pixels, rows, rank, touches and electrodes"
    )
    option(parser, "--rounds", default=15)
    option(parser, "--cache DIR", "folder that keeps the models (default: out/growth)", Path)
    add_page_option(parser)
    parser.set_defaults(run=run_growth)


def run_growth(options: argparse.Namespace) -> int:
    """Time frames of growing models."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import growth as bench_growth
    from eitskin_studies.harness.drawings import Drawing, draw_again, keep_drawings
    from eitskin_studies.pictures.growth_picture import draw_growth

    check_within("--rounds", options.rounds, 1, 1000)
    refuse_unwritable(options.page)
    result = bench_growth.run(options.rounds, options.cache, progress=progress_bar)
    if options.page is not None:
        drawing = Drawing(draw_growth, bench_growth.drawn(result))
        keep_drawings(options.page, {"pictures/growth.svg": drawing})
        draw_again(options.page)
    command = f"eitskin bench growth --rounds {options.rounds}"
    filling = bench_growth.for_page(result, command)
    return show(options, result, bench_growth.as_text(result), filling)
