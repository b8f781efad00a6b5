"""``eitskin demo``: three simulated touches, found by the C core and by an emulated board, compared
with the truth."""

import argparse
import sys
from collections.abc import Callable
from itertools import count

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import print_json
from eitskin.demo import demo_board
from eitskin.errors import FileError, MissingExtraError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import save_frames
from eitskin.view.panels import check_picture

BOARD = "emu:demo"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Simulate three touches on the paper's skin (nonlinear forward model on a different, finer"
        " mesh, with noise), reconstruct them with the C core and the prebuilt model, and draw"
        " them. Then let the firmware find them on an emulated board, and compare its results"
        " with this host's, bit by bit."
    )
    option(parser, "--snr-db DB", "20 log10(rms(V0)/sigma)", default=60.0)
    option(parser, "--seed", "seed of noise and contacts", default=1)
    option(parser, "--picture PNG", None, Output, default=Output("demo.png"))
    option(parser, "--frames NPZ", "also write the simulated frames, with their truth", Output)
    option(parser, "--no-board", "do not run the emulated board")
    option(parser, "--json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    from eitskin.demo.demo import run_demo, to_json, to_text
    from eitskin.view.demo_picture import draw_demo

    refuse_unwritable(options.picture, options.frames)
    if not -20 <= options.snr_db <= 200 or options.seed < 0:
        raise UsageError("demo: --snr-db must be -20 to 200 and --seed at least 0")
    check_picture(options.picture)
    numbers, total = count(1), 3 if options.no_board else 4

    def step(text: str) -> None:
        """Announce on stderr which step starts, so that the terminal is not silent for long."""
        print(f"{next(numbers)}/{total} {text}", file=sys.stderr, flush=True)

    demo = run_demo(options.seed, options.snr_db, step)
    if options.frames is not None:
        save_frames(options.frames, demo.frames)
    step(f"drawing {options.picture}")
    draw_demo(options.picture, demo)
    if not options.json:
        print(f"{to_text(demo)}\npicture: {options.picture}", flush=True)
    board = None if options.no_board else _board(step)
    if options.json:
        shown = None if board is None else demo_board.to_json(board)
        print_json({**to_json(demo), "picture": str(options.picture), "board": shown})
    elif board is not None:
        print(f"\n{demo_board.to_text(board)}")
    return 0


def _board(step: Callable[[str], None]) -> demo_board.BoardDemo | None:
    """Find the same touches on the emulated board. If emulator or firmware are not installed, print
    the reason on stderr and return None."""
    step("running the firmware on an emulated board; this takes ten to thirty seconds")
    try:
        return demo_board.run_board_demo(BOARD)
    except (MissingExtraError, FileError) as error:
        print(f"eitskin: without the emulated board: {error}", file=sys.stderr)
        return None
