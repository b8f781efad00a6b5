"""``eitskin flash``: firmware, and a model beside it, onto a board through its ST-LINK."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError

TOOLS = ("openocd", "st-flash", "pyocd")


def add_parser(subparsers: Any) -> None:
    """Add ``flash``."""
    parser = subparsers.add_parser(
        "flash",
        help="put firmware and a model on a NUCLEO-F767ZI",
        description=(
            "Put firmware on a NUCLEO-F767ZI through its ST-LINK, and a model into its first bank,"
            " by whichever of openocd, st-flash and pyocd is installed. The exact commands are"
            " printed first. What is not named is what ships with eitskin."
        ),
    )
    option(parser, "--image BIN", "firmware (default: the prebuilt one)", Path)
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(parser, "--no-model", "leave the board's models as they are")
    option(parser, "--tool", "default: the first that is installed", choices=TOOLS)
    option(parser, "--serial NUMBER", "the ST-LINK's, where several boards are plugged in")
    option(parser, "--dry-run", "print the commands and do nothing")
    option(parser, "--json", "print for programs; with --dry-run")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Plan, print, run."""
    from eitskin.device.flash import plan_flash, run_flash
    from eitskin.model.eitm import load_model
    from eitskin.model.prebuilt import load_prebuilt

    if options.no_model and options.model is not None:
        raise UsageError("flash: --model and --no-model contradict each other")
    if options.json and not options.dry_run:
        raise UsageError("flash: --json goes with --dry-run; without it the tool itself talks")
    image = options.image if options.image is not None else _prebuilt_image()
    model = None
    if not options.no_model:
        model = (load_prebuilt() if options.model is None else load_model(options.model))[1]
    plan = plan_flash(
        image, model, tool=options.tool, serial=options.serial, installed=not options.dry_run
    )
    if options.dry_run:
        facts = {"tool": plan.tool, "commands": [list(command) for command in plan.commands]}
        print(json.dumps(facts, indent=2) if options.json else "\n".join(plan.lines()))
        return 0
    run_flash(plan, lambda line: print(line, file=sys.stderr, flush=True))
    print("done; ask the board with  eitskin info")
    return 0


def _prebuilt_image() -> Path:
    """The image that ships with the package, as a file that a tool can read."""
    from eitskin.fileio import write_bytes
    from eitskin.firmware.prebuilt import BOARD, load_image

    image, manifest = load_image()
    path = Path(tempfile.gettempdir()) / f"eitskin-{BOARD}-{manifest.image_sha256[:12]}.bin"
    write_bytes(path, image)
    return path
