"""The command line: ``eitskin COMMAND``. Each command has its own module beside this one, and only
that of the given command is imported."""

import argparse
import importlib
import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import entry_points
from importlib.util import find_spec
from typing import NoReturn

from eitskin import __version__
from eitskin.cli.arguments import option, refuse_named_twice
from eitskin.cli.needed_extras import refuse_missing_extras
from eitskin.config import nearest
from eitskin.errors import EitskinError, FileError, UsageError, missing_checkout
from eitskin.process import take_over

COMMANDS = {  # the description of each command
    "demo": "reconstruct three simulated touches in C, and compare them with the truth",
    "model": "build, describe, verify or upload an .eitm model",
    "surface": "make example surfaces, and check a skin on a surface",
    "reconstruct": "reconstruct touches and images from the frames in a file",
    "import": "convert a text, NPY, NPZ or MAT file of measured voltages to a frames file",
    "export": "write a model, frames and their images to a .mat file for EIDORS",
    "doctor": "find out what is wrong with frames or a board: order, sign, wiring, noise, gains",
    "scene": "simulate what happens on a skin, with the imperfections that a scene names",
    "calibrate": "calibrate the force of touches with known weights on the skin",
    "teach": "learn a model from presses at known places",
    "recommend": "choose settings for a time or an accuracy, and build a model with them",
    "devices": "list serial ports, boards that answer, and names of other devices",
    "info": "show what a board is, its model, its scan, its faults and its counters",
    "board": "show or change the owner's settings of a board: lock, current, limit",
    "tare": "take a board's reference from its untouched skin",
    "view": "show the skin live in a browser: image, touches, electrodes, voltages",
    "stream": "show touches, images or raw frames of a board as they arrive",
    "record": "write every packet of a board to a file",
    "replay": "show a recording, export its frames, or check its images",
    "flash": "put firmware and a model on a NUCLEO-F767ZI",
    "completion": "print a script with which your shell completes commands and options",
}
FIRST = "eitskin stream --device sim:swipe"
INVALID_CHOICE = re.compile(  # argparse's text, with quotes before Python 3.12
    r"argument (?P<what>.*?): invalid choice: '(?P<given>.*)' \(choose from (?P<known>.*)\)"
)
UNKNOWN = re.compile(r"unrecognized arguments: (?:.* )?(?P<option>--[\w-]+)")
SUPERFLUOUS = re.compile(r"unrecognized arguments: (?P<word>[^-]\S*).*", re.DOTALL)
REPLACED = re.compile(r"unrecognized arguments: .*--(budget|accuracy)\b")
ENTRY_POINT_GROUP = "eitskin.commands"  # commands of other packages
STUDIES = ("bench", "compare", "dataset", "draw", "study", "tradeoff")  # in eitskin-studies


class Parser(argparse.ArgumentParser):
    """A parser that reports errors in one line, like all other errors. ``of_command`` is the
    command whose help they name; None: the parser's own."""

    of_command: str | None = None

    def error(self, message: str) -> NoReturn:
        """Raise a UsageError instead of printing the usage and exiting. For an invalid choice,
        suggest the nearest one."""
        found = INVALID_CHOICE.fullmatch(message)
        if found:
            known = re.findall(r"'([^']+)'", found["known"]) or found["known"].split(", ")
            message = f"{found['what']}: {found['given']!r} is unknown; "
            message += nearest(found["given"], known)
        unknown = UNKNOWN.match(message)
        if unknown and not REPLACED.match(message):
            given = unknown["option"]
            known = [word for word in _options_of(self) if word.startswith("--") and word != given]
            close = nearest(given, known)
            message += f"; {close}" if close.startswith("did you mean") else ""
        if REPLACED.match(message):
            message += "; use --preset, or a model of  eitskin recommend -o MODEL.eitm"
        superfluous = SUPERFLUOUS.fullmatch(message)
        if superfluous:
            message += _remedy_for(superfluous["word"], _options_of(self))
        see = " See" if message.endswith("?") else "; see"
        raise UsageError(f"{message}{see}  {self.of_command or self.prog} --help")


def _remedy_for(word: str, options: Sequence[str]) -> str:
    """Return what may be meant by a ``word`` too many, which is no option."""
    if "--device" in options and (word == "auto" or ":" in word):
        return f"; did you mean '--device {word}'?"
    return "; a name with spaces needs quotes"


def _options_of(parser: argparse.ArgumentParser) -> list[str]:
    """Return the options of ``parser`` and of the commands whose options are loaded."""
    words: list[str] = []
    for action in parser._actions:
        words += action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            words += [word for one in set(action.choices.values()) for word in _options_of(one)]
    return words


def build_parser(only: str | None = None) -> argparse.ArgumentParser:
    """Return the whole parser, or one in which only the command ``only`` has options. Each module
    ``cmd_NAME`` has ``add_options(parser)``, which sets ``run``."""
    parser = Parser(
        prog="eitskin", description="Electrical impedance tomography skins, from model to touches."
    )
    parser.add_argument("--version", action="version", version=f"eitskin {__version__}")
    option(parser, "--traceback", "on an error, show where in the code it arose")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    if only in COMMANDS:
        parser.of_command = f"eitskin {only}"
    for name, text in COMMANDS.items():
        command = subparsers.add_parser(name, help=text)
        if only in (None, name):
            importlib.import_module(f"eitskin.cli.cmd_{name}").add_options(command)
    if only not in COMMANDS:
        for entry in sorted(entry_points(group=ENTRY_POINT_GROUP), key=lambda one: one.name):
            # moved or deleted sources leave their entry point
            if find_spec(entry.module.partition(".")[0]) is not None:
                entry.load().add_parser(subparsers)
    if only in STUDIES and only not in subparsers.choices:
        raise missing_checkout(f"eitskin {only}", "firmware/emulator", "hardware", "studies")
    return parser


def named_command(arguments: Sequence[str]) -> str:
    """Return the word that names the command, or ""."""
    return next((one for one in arguments if not one.startswith("-")), "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code (docs/reference/error-codes.md). Errors are printed
    as one line on stderr."""
    traceback = False
    if arguments is None:
        take_over()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # names that the terminal cannot show
    try:
        given = sys.argv[1:] if arguments is None else arguments
        parser = build_parser(named_command(given))
        options = parser.parse_args(given)
        traceback = options.traceback
        if options.command is None:
            print(f"{parser.format_help()}\nTo begin:  {FIRST}")
            return 0
        refuse_named_twice(options)
        refuse_missing_extras(options)
        code = int(options.run(options) or 0)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except EitskinError as error:
        if traceback:
            raise
        print(f"eitskin: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except OSError as error:  # usually a full disk behind standard output
        if traceback:
            raise
        _print_last(f"{error.filename or 'output'}: {error.strerror or error}")
        return FileError.exit_code
    except KeyboardInterrupt:
        print("eitskin: stopped", file=sys.stderr)
        return 130


def _print_last(text: str) -> None:
    """Print the reason for the end, and discard what standard output still buffers, which would
    fail again."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"eitskin: {text}", file=sys.stderr, flush=True)
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())
