"""``eitskin demo``: three simulated touches, found by the C core and by an emulated board, compared
with the truth."""

import argparse
import sys
from collections.abc import Callable
from importlib.util import find_spec
from itertools import count

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import print_json
from eitskin.demo import demo, demo_board
from eitskin.errors import FileError, MissingExtraError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import save_frames
from eitskin.view.panels import check_picture

BOARD = "emu:demo"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Reconstruct three simulated touches on the paper's skin with the C core and the prebuilt"
        " model, compare them with the truth, and draw them. Then let the firmware find them on an"
        " emulated board, and compare its results with this host's, bit by bit. The frames ship"
        " with eitskin: a nonlinear forward model on a different, finer mesh, with noise."
        " --snr-db or --seed simulate them again."
    )
    option(parser, "--snr-db DB", f"20 log10(rms(V0)/sigma) (default: {demo.SNR_DB:g})", float)
    option(parser, "--seed N", f"seed of noise and contacts (default: {demo.SEED})", int)
    option(
        parser,
        "--picture PNG",
        "default: demo.png, if matplotlib is installed",
        Output,
    )
    option(parser, "--frames NPZ", "also write the simulated frames, with their truth", Output)
    option(parser, "--no-board", "do not run the emulated board")
    option(parser, "--json")
    parser.set_defaults(run=run, extras=lambda given: ("model",) if _simulated(given) else ())


def run(options: argparse.Namespace) -> int:
    from eitskin.view.demo_picture import draw_demo

    simulated = _simulated(options)
    seed = demo.SEED if options.seed is None else options.seed
    snr_db = demo.SNR_DB if options.snr_db is None else options.snr_db
    picture = Output("demo.png") if options.picture is None else options.picture
    refuse_unwritable(picture, options.frames)
    if not -20 <= snr_db <= 200 or seed < 0:
        raise UsageError("demo: --snr-db must be -20 to 200 and --seed at least 0")
    check_picture(options.picture)
    numbers, total = count(1), 3 if options.no_board else 4

    def step(text: str) -> None:
        """Announce on stderr which step starts, so that the terminal is not silent for long."""
        print(f"{next(numbers)}/{total} {text}", file=sys.stderr, flush=True)

    if simulated:
        step("simulating three touches: mesh, electrodes, forward model, noise")
        frames = demo.simulated_frames(seed, snr_db)
    else:
        step("reading the simulated frames of three touches")
        frames = demo.shipped_frames()
    done = demo.run_demo(frames, step)
    if options.frames is not None:
        save_frames(options.frames, frames)
    step(f"drawing {picture}")
    drawn = _drawn(picture, done, draw_demo)
    if not options.json:
        print("\n".join([demo.to_text(done), *([f"picture: {picture}"] if drawn else [])]))
        sys.stdout.flush()
    board = None if options.no_board else _board(step)
    if options.json:
        shown = None if board is None else demo_board.to_json(board)
        named = str(picture) if drawn else None
        print_json({**demo.to_json(done), "picture": named, "board": shown})
    elif board is not None:
        print(f"\n{demo_board.to_text(board)}")
    return 0


def _simulated(options: argparse.Namespace) -> bool:
    """Return whether other frames are asked for than those that ship."""
    return options.seed is not None or options.snr_db is not None


def _drawn(picture: Output, done: demo.Demo, draw: Callable[[Output, demo.Demo], None]) -> bool:
    """Draw the picture; without matplotlib, print so on stderr and return False."""
    try:
        check_picture(picture)
        draw(picture, done)
    except MissingExtraError as error:
        print(f"eitskin: without the picture: {error}", file=sys.stderr)
        return False
    return True


def _board(step: Callable[[str], None]) -> demo_board.BoardDemo | None:
    """Find the same touches on the emulated board. If emulator or firmware are not installed, print
    the reason on stderr and return None."""
    if find_spec("eitskin_emulator") is None:
        step("the firmware on an emulated board: left out")
    else:
        step("running the firmware on an emulated board; this takes ten to thirty seconds")
    try:
        return demo_board.run_board_demo(BOARD)
    except (MissingExtraError, FileError) as error:
        print(f"eitskin: without the emulated board: {error}", file=sys.stderr)
        return None
