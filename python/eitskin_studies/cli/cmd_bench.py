"""``eitskin bench WHAT``: speed, side by side in one run: frames, solvers, building, scenes,
boards, kernels, growth, batches; what diagnostics are worth, and gestures."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError

if TYPE_CHECKING:
    from eitskin_studies.harness.sections import Filling


def add_parser(subparsers: Any) -> None:
    """Add ``bench`` and its own subcommands."""
    parser = subparsers.add_parser("bench", help="measure speed, side by side in one run")
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    frame = what.add_parser(
        "frame", help="one frame through cffi: p50, p99, share outside C, beside numpy"
    )
    option(frame, "--runs", default=2000)
    option(frame, "--json")
    frame.set_defaults(run=run_frame)
    solve = what.add_parser(
        "solve", help="the solve alone: time to a suboptimality, beside other solvers"
    )
    option(solve, "--scenes", "problems of each model", default=20)
    option(solve, "--seed", "of the scenes", default=3)
    option(solve, "--rounds", "interleaved rounds", default=11)
    option(solve, "--picture PNG", "draw suboptimality against MIoU instead", Path)
    option(solve, "--json")
    solve.set_defaults(run=run_solve)
    jacobian = what.add_parser(
        "jacobian", help="building: Jacobian beside pyEIT's, and the whole model"
    )
    option(jacobian, "--json")
    jacobian.set_defaults(run=run_jacobian)
    board = what.add_parser(
        "board",
        help=(
            "a frame on the emulated board: exact instructions, memory, frame rate; needs a"
            " checkout"
        ),
        description=(
            "Build the Cortex-M7 program and both firmware images from the source checkout, run"
            " random scenes under QEMU in every storage with the M7's kernels and with plain C, and"
            " the firmware itself on the emulated NUCLEO-F767ZI."
        ),
    )
    option(board, "--scenes", "random scenes", default=60)
    option(board, "--seed", "of the scenes", default=1)
    option(board, "--frames", "on the emulated NUCLEO, 0 for none", default=8)
    option(board, "--build DIR", "keep the build there, or take up an earlier one", Path)
    _add_page(board, "board-cost")
    board.set_defaults(run=run_board)
    kernels = what.add_parser(
        "kernels",
        help="each C kernel beside the machine's measured peaks; needs a checkout",
        description=(
            "Build a C program from the source checkout that times every kernel beside this"
            " machine's peaks of memory and arithmetic, in turns, and say how far from its limit"
            " each is."
        ),
    )
    option(kernels, "--rank", "numbers of a column", default=64)
    option(kernels, "--columns", default=812)
    option(kernels, "--rounds", default=41)
    _add_page(kernels)
    kernels.set_defaults(run=run_kernels)
    growth = what.add_parser(
        "growth", help="a frame's time and MACs against pixels, rows, rank, touches and electrodes"
    )
    option(growth, "--rounds", default=15)
    option(growth, "--cache DIR", "keeps the models (default: beside other temporary files)", Path)
    option(growth, "--picture PNG", "draw it", Path)
    _add_page(growth)
    growth.set_defaults(run=run_growth)
    view = what.add_parser(
        "view", help="the live page: the server's share of a core, frame to pixel in Chromium"
    )
    option(view, "--seconds", "for each number of pages", default=30.0)
    option(view, "--load", "eight pages only, and six sinks beside")
    _add_page(view, "live-view")
    view.set_defaults(run=run_view)
    batches = what.add_parser(
        "batches", help="batches of frames over threads, beside one after another"
    )
    option(batches, "--frames", default=1000)
    option(batches, "--rounds", default=9)
    option(batches, "--threads N", None, int, nargs="+", default=[1, 2])
    _add_page(batches)
    batches.set_defaults(run=run_batches)
    diagnostics = what.add_parser(
        "diagnostics",
        help="how often faults are called by their name, and what they cost the image",
        description=(
            "Spoil frames of random scenes in every way that docs/reference/diagnostics.md names,"
            " count how often that is said in that very frame, and compare the image with that of"
            " the same frame without the fault; some five minutes."
        ),
    )
    option(diagnostics, "--scenes", "that every fault is put on", default=640)
    option(diagnostics, "--crowds", "scenes of each number of touches", default=24)
    option(diagnostics, "--imperfect", "scenes of each front end", default=40)
    option(diagnostics, "--seed", "of scenes and noise", default=4001)
    _add_page(diagnostics, "diagnostics")
    diagnostics.set_defaults(run=run_diagnostics)
    effects = what.add_parser(
        "effects", help="scenes: the time with no effect, with each alone, with all"
    )
    option(effects, "--frames", default=100)
    option(effects, "--json")
    effects.set_defaults(run=run_effects)
    scenes = what.add_parser(
        "scenes", help="scenes: frames/s of a moving touch, static scenes/s of a dataset"
    )
    option(scenes, "--frames", "of the moving touch", default=400)
    option(scenes, "--scenes", "of the dataset", default=500)
    option(scenes, "--elements", "of the mesh", default=3000)
    option(scenes, "--json")
    scenes.set_defaults(run=run_scenes)
    outputs = what.add_parser(
        "outputs",
        help="from a contact to the UDP packet and the TUIO message; load of six sinks",
        description=(
            "Tap an emulated board's skin, and say how long each contact takes through scan, solve,"
            " link, host and sink; then stream to six sinks at once."
        ),
    )
    option(outputs, "--taps", "of the emulated board; about 4 s each", default=24)
    option(outputs, "--seconds", "of each sink alone", default=20.0)
    option(outputs, "--load", "seconds of six sinks at once, 0 for none", default=20.0)
    option(outputs, "--seed", "of contacts and noise", default=1)
    _add_page(outputs)
    outputs.set_defaults(run=run_outputs)
    gestures = what.add_parser(
        "gestures",
        help="gestures of simulated fingers: how many are told rightly, and how late",
        description=(
            "Draw sessions of taps, holds, swipes, pinches, spreads, turns, drags and presses,"
            " simulate a board that scans meanwhile, and judge what the C core tells."
        ),
    )
    option(gestures, "--sessions", "of 27 each", default=60)
    option(gestures, "--seed", "of all that is random", default=7001)
    option(
        gestures,
        "--role",
        "which sessions: to choose by, or to judge by",
        choices=("tuning", "judging"),
        default="judging",
    )
    option(gestures, "--snr-db DB", None, float, nargs="+", default=[60.0, 40.0])
    option(gestures, "--cache DIR", "keeps the simulated frames", Path)
    _add_page(gestures, "gestures")
    gestures.set_defaults(run=run_gestures)
    worlds = what.add_parser(
        "worlds",
        help="touches counted in worlds that the model does not share",
        description=(
            "Simulate sets of scenes on another mesh, with touches, sheets, electrodes and drifts"
            " that the model knows nothing of, and count the touches that the C core finds."
        ),
    )
    option(worlds, "--scenes", "of each set", default=100)
    option(worlds, "--seed", "of all that is random", default=1)
    option(
        worlds,
        "--family",
        "which scenes: to choose by, or to judge by",
        choices=("tuning", "judging"),
        default="tuning",
    )
    option(
        worlds, "--sets NAME,...", "these alone; no_touch* names all that begin so (default: all)"
    )
    option(worlds, "--snr-db DB", "instead of each set's own", float)
    option(worlds, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(worlds, "--option NAME=VALUE", "an option of the core; may be repeated", action="append")
    option(worlds, "--cache DIR", "keeps the simulated frames", Path)
    option(worlds, "--list", "name the sets")
    option(worlds, "--json")
    worlds.set_defaults(run=run_worlds)


def _add_page(parser: argparse.ArgumentParser, page: str = "benchmarks") -> None:
    option(
        parser,
        "--page FILE.md",
        f"fill the marked places of this page, docs/results/{page}.md",
        Path,
    )
    option(parser, "--json")


def _show(
    options: argparse.Namespace,
    result: Any,
    text: str,
    filling: Filling,
    page: str = "benchmarks",
) -> int:
    from eitskin_studies.harness.sections import fill_marks

    if options.page is not None:
        fill_marks(options.page, page, filling)
    print(json.dumps(result.as_dict(), indent=2) if options.json else text)
    return 0


def run_kernels(options: argparse.Namespace) -> int:
    """Time each kernel beside the machine's peaks."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import kernels as bench_kernels

    _within("--rank", options.rank, 8, 1024)
    _within("--columns", options.columns, 48, 20_000)
    _within("--rounds", options.rounds, 1, 200)
    refuse_unwritable(options.page)
    result = bench_kernels.run(options.rank, options.columns, options.rounds)
    command = (
        f"eitskin bench kernels --rank {options.rank} --columns {options.columns} --rounds"
        f" {options.rounds}"
    )
    filling = bench_kernels.for_page(result, command)
    return _show(options, result, bench_kernels.as_text(result), filling)


def run_outputs(options: argparse.Namespace) -> int:
    """Time contacts, and load sinks."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import outputs as bench_outputs

    _within("--taps", options.taps, 1, 1000)
    for name, value in (("--seconds", options.seconds), ("--load", options.load)):
        if not 0 <= value <= 86_400:
            raise UsageError(f"{name} {value:g} is out of range; use 0 to 86400")
    refuse_unwritable(options.page)
    result = bench_outputs.run(options.taps, options.seconds, options.load, options.seed)
    command = (
        f"eitskin bench outputs --taps {options.taps} --seconds {options.seconds:g} --load"
        f" {options.load:g} --seed {options.seed}"
    )
    filling = bench_outputs.for_page(result, command)
    return _show(options, result, bench_outputs.as_text(result), filling)


def run_growth(options: argparse.Namespace) -> int:
    """Time frames of growing models."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import growth as bench_growth

    _within("--rounds", options.rounds, 1, 1000)
    refuse_unwritable(options.page, options.picture)
    if options.picture is not None:
        from eitskin.view.sheets import check_picture

        check_picture(options.picture)
    result = bench_growth.run(options.rounds, options.cache, progress=_progress)
    if options.picture is not None:
        from eitskin_studies.pictures.growth_picture import draw_growth

        draw_growth(options.picture, result)
    command = f"eitskin bench growth --rounds {options.rounds}"
    filling = bench_growth.for_page(result, command)
    return _show(options, result, bench_growth.as_text(result), filling)


def run_view(options: argparse.Namespace) -> int:
    """Look at the live page, once, and with several pages at a time."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import live_view

    _within("--seconds", options.seconds, 1, 3600)
    refuse_unwritable(options.page)
    command = f"eitskin bench view --seconds {options.seconds:g}" + " --load" * options.load
    result = live_view.run(
        options.seconds,
        live_view.PAGES[-1:] if options.load else live_view.PAGES,
        progress=lambda text: print(text, file=sys.stderr),
        sinks=options.load,
    )
    filling = live_view.for_page(result, command, "load" if options.load else "view")
    return _show(options, result, live_view.as_text(result), filling, "live-view")


def run_batches(options: argparse.Namespace) -> int:
    """Time batches over threads."""
    from eitskin.fileio import refuse_unwritable
    from eitskin.solve.batch import check_threads
    from eitskin_studies.benchmarks import batches as bench_batches

    _within("--frames", options.frames, 8, 1_000_000)
    _within("--rounds", options.rounds, 1, 1000)
    for count in options.threads:
        check_threads(count)
    refuse_unwritable(options.page)
    result = bench_batches.run(options.frames, options.rounds, options.threads)
    command = f"eitskin bench batches --frames {options.frames} --rounds {options.rounds}"
    filling = bench_batches.for_page(result, command)
    return _show(options, result, bench_batches.as_text(result), filling)


def run_diagnostics(options: argparse.Namespace) -> int:
    """Count how often faults are named, and what they cost."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import diagnostics as bench_diagnostics
    from eitskin_studies.benchmarks import diagnostics_page as bench_diagnostics_page

    _within("--scenes", options.scenes, 2, 100_000)
    _within("--crowds", options.crowds, 2, 10_000)
    _within("--imperfect", options.imperfect, 1, 10_000)
    _within("--seed", options.seed, 0, 2**31 - 1)
    refuse_unwritable(options.page)
    result = bench_diagnostics.run(
        options.seed, options.scenes, options.crowds, options.imperfect, progress=_progress
    )
    sizes = f"--scenes {options.scenes} --crowds {options.crowds} --imperfect {options.imperfect}"
    command = f"eitskin bench diagnostics {sizes} --seed {options.seed}"
    filling = bench_diagnostics_page.for_page(result, command)
    text = bench_diagnostics_page.as_text(result)
    return _show(options, result, text, filling, "diagnostics")


def run_frame(options: argparse.Namespace) -> int:
    """Time a frame."""
    from eitskin_studies.benchmarks import frame as bench_frame

    if not 100 <= options.runs <= 10_000_000:
        raise UsageError(f"bench frame: --runs {options.runs} is out of range; use 100 to 10000000")
    times = bench_frame.run(options.runs)
    print(json.dumps(times.as_dict(), indent=2) if options.json else bench_frame.to_text(times))
    return 0


def run_solve(options: argparse.Namespace) -> int:
    """Time the solvers, or draw what their suboptimality means for images."""
    from eitskin.fileio import refuse_unwritable

    _within("--scenes", options.scenes, 4, 1000)
    _within("--seed", options.seed, 0, 2**31 - 1)
    _within("--rounds", options.rounds, 3, 10_000)
    refuse_unwritable(options.picture)
    if options.picture is not None:
        from eitskin_studies.benchmarks import suboptimality
        from eitskin_studies.pictures.suboptimality_picture import draw

        curves = suboptimality.run(options.scenes, options.seed, _progress)
        draw(options.picture, curves)
        print(
            json.dumps(curves.as_dict(), indent=2) if options.json else suboptimality.text(curves)
        )
        return 0
    from eitskin_studies.benchmarks import solve as bench_solve

    result = bench_solve.run(options.scenes, options.seed, options.rounds, _progress)
    print(json.dumps(result, indent=2) if options.json else bench_solve.text(result))
    return 0


def run_jacobian(options: argparse.Namespace) -> int:
    """Time the Jacobian beside pyEIT's."""
    from eitskin_studies.benchmarks import jacobian as bench_jacobian

    times = bench_jacobian.run()
    print(json.dumps(times, indent=2) if options.json else bench_jacobian.text(times))
    return 0


def run_board(options: argparse.Namespace) -> int:
    """Count what a frame costs on the emulated board."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import board as bench_board

    _within("--scenes", options.scenes, 1, 2000)
    _within("--seed", options.seed, 0, 2**31)
    if options.frames:
        _within("--frames", options.frames, 2, 1000)
    refuse_unwritable(options.page)
    result = bench_board.run(
        options.scenes, options.seed, frames=options.frames, build=options.build, progress=_progress
    )
    command = (
        f"eitskin bench board --scenes {options.scenes} --seed {options.seed} --frames"
        f" {options.frames}"
    )
    filling = bench_board.for_page(result, command)
    return _show(options, result, bench_board.as_text(result), filling, "board-cost")


def _within(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise UsageError(f"bench: {name} {value} is out of range; use {low} to {high}")


def _progress(items: Sequence[Any]) -> Iterable[Any]:
    """A bar on stderr where that is a terminal; nothing otherwise."""
    from tqdm import tqdm

    shown: Iterable[Any] = tqdm(items, unit="", leave=False, disable=not sys.stderr.isatty())
    return shown


def run_effects(options: argparse.Namespace) -> int:
    """Time each effect on one scene."""
    from eitskin_studies.benchmarks import scenes as bench_scenes

    _within("--frames", options.frames, 2, 100_000)
    result = bench_scenes.effects_table(options.frames, progress=_progress)
    print(json.dumps(result, indent=2) if options.json else bench_scenes.effects_text(result))
    return 0


def run_scenes(options: argparse.Namespace) -> int:
    """Time a moving touch and a dataset."""
    from eitskin_studies.benchmarks import scenes as bench_scenes

    _within("--frames", options.frames, 2, 100_000)
    _within("--scenes", options.scenes, 1, 1_000_000)
    _within("--elements", options.elements, 200, 200_000)
    result = bench_scenes.scenes_table(
        options.frames, options.scenes, options.elements, progress=_progress
    )
    print(json.dumps(result, indent=2) if options.json else bench_scenes.scenes_text(result))
    return 0


def run_gestures(options: argparse.Namespace) -> int:
    """Judge gestures."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.gestures import bench as bench_gestures

    _within("--sessions", options.sessions, 1, 10_000)
    _within("--seed", options.seed, 0, 2**31 - 1)
    for snr_db in options.snr_db:
        if not 0 <= snr_db <= 200:
            raise UsageError(f"bench: --snr-db {snr_db:g} is out of range; use 0 to 200")
    refuse_unwritable(options.page)
    how = bench_gestures.Settings(
        options.sessions, options.seed, options.role, tuple(options.snr_db), options.cache
    )
    result = bench_gestures.run(how, _progress)
    command = (
        f"eitskin bench gestures --sessions {options.sessions} --seed {options.seed} --role"
        f" {options.role} --snr-db {' '.join(f'{snr:g}' for snr in options.snr_db)}"
    )
    filling = bench_gestures.for_page(result, command)
    return _show(options, result, bench_gestures.as_text(result), filling, "gestures")


def run_worlds(options: argparse.Namespace) -> int:
    """Count touches in other worlds."""
    from eitskin_studies.benchmarks import worlds as bench_worlds
    from eitskin_studies.cli.cmd_compare import progress
    from eitskin_studies.worlds.score import as_text

    if options.list:
        print(bench_worlds.listed())
        return 0
    _within("--scenes", options.scenes, 1, 100_000)
    _within("--seed", options.seed, 0, 2**31 - 1)
    scores = bench_worlds.run(
        bench_worlds.Settings(
            options.scenes,
            options.seed,
            options.family,
            bench_worlds.chosen_sets(options.sets),
            options.snr_db,
            options.model,
            tuple(options.option or ()),
            options.cache,
        ),
        progress,
    )
    text = as_text(scores)
    print(json.dumps([one.as_dict() for one in scores], indent=2) if options.json else text)
    return 0
