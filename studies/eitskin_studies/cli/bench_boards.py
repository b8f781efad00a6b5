"""``eitskin bench``: the emulated board, the live page and the sinks behind them."""

import argparse
import sys
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin_studies.cli.bench_shared import add_page_option, check_within, progress_bar, show


def add_board(what: Any) -> None:
    """``bench board``."""
    parser = what.add_parser(
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
    option(parser, "--scenes", "random scenes", default=60)
    option(parser, "--seed", "seed of the scenes", default=1)
    option(parser, "--frames", "frames on the emulated NUCLEO, 0 for none", default=8)
    option(parser, "--build DIR", "folder of the build; an earlier build there is used again", Path)
    add_page_option(parser, "board-cost")
    parser.set_defaults(run=run_board)


def run_board(options: argparse.Namespace) -> int:
    """Count the cost of a frame on the emulated board."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import board as bench_board

    check_within("--scenes", options.scenes, 1, 2000)
    check_within("--seed", options.seed, 0, 2**31)
    if options.frames:
        check_within("--frames", options.frames, 2, 1000)
    refuse_unwritable(options.page)
    result = bench_board.run(
        options.scenes,
        options.seed,
        frames=options.frames,
        build=options.build,
        progress=progress_bar,
    )
    command = (
        f"eitskin bench board --scenes {options.scenes} --seed {options.seed} --frames"
        f" {options.frames}"
    )
    filling = bench_board.for_page(result, command)
    return show(options, result, bench_board.as_text(result), filling, "board-cost")


def add_time(what: Any) -> None:
    """``bench time``."""
    parser = what.add_parser(
        "time",
        help="how long a frame takes on the board, between two bounds of the Cortex-M7's time",
        description=(
            "Run the firmware on the emulated NUCLEO-F767ZI while its time passes by an optimistic"
            " and by a pessimistic bound: dual issue, latencies, branches, caches, flash and bus"
            " waits. It takes about a minute for each image."
        ),
    )
    option(parser, "--image BIN", "firmware (default: the prebuilt one)", Path)
    option(parser, "--before BIN", "another firmware to compare with", Path)
    option(parser, "--frames", "frames of each scan and bound", default=4)
    add_page_option(parser, "board-cost")
    parser.set_defaults(run=run_time)


def run_time(options: argparse.Namespace) -> int:
    """Bound the time of a frame on the board."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import time_range

    check_within("--frames", options.frames, 1, 1000)
    refuse_unwritable(options.page)
    images = {"before": options.before} if options.before is not None else {}
    result = time_range.run({**images, "now": options.image}, options.frames)
    command = f"eitskin bench time --frames {options.frames}"
    filling = time_range.for_page(result, command)
    return show(options, result, time_range.as_text(result), filling, "board-cost")


def add_energy(what: Any) -> None:
    """``bench energy``."""
    parser = what.add_parser("energy", help="estimate the energy of a frame from data sheets")
    add_page_option(parser, "board-cost")
    parser.set_defaults(run=run_energy)


def run_energy(options: argparse.Namespace) -> int:
    """Estimate the energy of a frame."""
    from eitskin_studies.benchmarks import energy

    result = energy.run()
    return show(options, result, energy.as_text(result), energy.for_page(result), "board-cost")


def add_view(what: Any) -> None:
    """``bench view``."""
    parser = what.add_parser(
        "view", help="measure the live page: the server's share of a core, frame to pixel"
    )
    option(parser, "--seconds", "seconds for each number of pages", default=30.0)
    option(parser, "--load", "measure eight pages only, and six sinks at the same time")
    add_page_option(parser, "outputs")
    parser.set_defaults(run=run_view)


def run_view(options: argparse.Namespace) -> int:
    """Look at the live page, once, and with several pages at a time."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import live_view

    check_within("--seconds", options.seconds, 1, 3600)
    refuse_unwritable(options.page)
    command = f"eitskin bench view --seconds {options.seconds:g}" + " --load" * options.load
    result = live_view.run(
        options.seconds,
        live_view.PAGES[-1:] if options.load else live_view.PAGES,
        progress=lambda text: print(text, file=sys.stderr),
        sinks=options.load,
    )
    filling = live_view.for_page(result, command, "view-load" if options.load else "view")
    return show(options, result, live_view.as_text(result), filling, "outputs")


def add_outputs(what: Any) -> None:
    """``bench outputs``."""
    parser = what.add_parser(
        "outputs",
        help="time from a contact to the UDP packet and TUIO message; load of six sinks",
        description=(
            "Tap an emulated board's skin, and say how long each contact takes through scan, solve,"
            " link, host and sink; then stream to six sinks at once."
        ),
    )
    option(parser, "--taps", "taps on the emulated board; about 4 s each", default=24)
    option(parser, "--seconds", "seconds of each sink alone", default=20.0)
    option(parser, "--load", "seconds of six sinks at once, 0 for none", default=20.0)
    option(parser, "--seed", "seed of contacts and noise", default=1)
    add_page_option(parser, "outputs")
    parser.set_defaults(run=run_outputs)


def run_outputs(options: argparse.Namespace) -> int:
    """Time contacts, and load sinks."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import outputs as bench_outputs

    check_within("--taps", options.taps, 1, 1000)
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
    return show(options, result, bench_outputs.as_text(result), filling, "outputs")


def add_latency(what: Any) -> None:
    """``bench latency``."""
    parser = what.add_parser(
        "latency",
        help="time from contact to report, of presses that land and lift during scans",
        description=(
            "Press a simulated skin at random times and places, fast and slowly, while each row is"
            " measured at its own instant; say when a press is first reported, how far off, and"
            " what is reported that is not there. Solve and link are an emulated board's."
        ),
    )
    option(parser, "--presses", "presses of each rise, on the simulated board", default=200)
    option(parser, "--emulated", "presses on the emulated board, about 10 s each", default=12)
    option(parser, "--seed", "seed of presses and noise", default=1)
    option(parser, "--order ORDER", 'measure also with drives in this order, such as "by 7"')
    add_page_option(parser, "latency")
    parser.set_defaults(run=run_latency)


def run_latency(options: argparse.Namespace) -> int:
    """Time presses."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import latency
    from eitskin_studies.harness.drawings import draw_again, keep_drawings
    from eitskin_studies.pictures.latency_picture import latency_drawing

    check_within("--presses", options.presses, 1, 10_000)
    check_within("--emulated", options.emulated, 0, 1000)
    check_within("--seed", options.seed, 0, 2**31)
    refuse_unwritable(options.page)
    order = options.order or ""
    result = latency.run(options.presses, options.emulated, options.seed, order)
    if options.page is not None:
        keep_drawings(options.page, {"pictures/latency.svg": latency_drawing(result)})
        draw_again(options.page)
    command = (
        f"eitskin bench latency --presses {options.presses} --emulated {options.emulated} --seed"
        f" {options.seed}" + f' --order "{order}"' * bool(order)
    )
    filling = latency.for_page(result, command)
    return show(options, result, latency.as_text(result), filling, "latency")
