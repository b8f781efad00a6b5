"""``eitskin flash``: put firmware and a model onto a board through its ST-LINK."""

import argparse
import json
import sys
import tempfile
from hashlib import sha256
from pathlib import Path

from eitskin.cli.arguments import option
from eitskin.device.flash import (
    TOOLS,
    FlashPlan,
    check_image,
    export_flash,
    plan_flash,
    run_flash,
)
from eitskin.errors import UsageError
from eitskin.fileio import read_bytes, write_bytes
from eitskin.firmware.prebuilt import BOARD, load_image
from eitskin.model.eitm import load_model
from eitskin.model.prebuilt import load_prebuilt


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Put firmware on a NUCLEO-F767ZI through its ST-LINK, and a model into its first bank, with"
        " openocd, st-flash or pyocd, whichever is installed. The exact commands are printed first."
        " By default the firmware and the model that ship with eitskin are used."
    )
    option(parser, "--image BIN", "firmware (default: the prebuilt one)", Path)
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(parser, "--no-model", "do not change the models on the board")
    option(parser, "--tool", "default: the first one installed", choices=TOOLS)
    option(parser, "--serial NUMBER", "serial number of the ST-LINK, if several are plugged in")
    option(
        parser,
        "--export FILE",
        "write firmware and model into FILE (.bin or .hex) for the drive that the ST-LINK shows;"
        " needs no tool and no board",
        Path,
    )
    option(
        parser,
        "--dry-run",
        "print the commands; the files that they name exist only while flash runs, and --export"
        " writes one to flash by hand",
    )
    option(parser, "--json", "print for programs; only with --dry-run")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    if options.no_model and options.model is not None:
        raise UsageError("flash: --model and --no-model contradict each other; give one of them")
    if options.json and not options.dry_run:
        raise UsageError("flash: --json needs --dry-run; without it the tool prints its own output")
    model = None
    if not options.no_model:
        model = (load_prebuilt() if options.model is None else load_model(options.model))[1]
    if options.export is not None:
        return _export(options, model)
    with tempfile.TemporaryDirectory(prefix="eitskin-flash-") as folder:
        plan = _plan(options, model, Path(folder))
        if not options.dry_run:
            run_flash(plan, lambda line: print(line, file=sys.stderr, flush=True))
            print("done; ask the board with  eitskin info")
            return 0
    facts = {"tool": plan.tool, "commands": [list(command) for command in plan.commands]}
    print(json.dumps(facts, indent=2) if options.json else "\n".join(plan.lines()))
    return 0


def _plan(options: argparse.Namespace, model: bytes | None, folder: Path) -> FlashPlan:
    """Return the commands, whose files are in ``folder``, and print what they would put on the
    board."""
    image = options.image if options.image is not None else _prebuilt_image(folder)
    tool, serial, installed = options.tool, options.serial, not options.dry_run
    plan = plan_flash(image, model, folder, tool=tool, serial=serial, installed=installed)
    for name, content in (("image", Path(image).read_bytes()), ("model", model)):
        if content is not None:
            print(f"{name} SHA-256 {sha256(content).hexdigest()}", file=sys.stderr)
    return plan


def _export(options: argparse.Namespace, model: bytes | None) -> int:
    """Write the file to drag onto the board's drive."""
    if options.dry_run or options.tool is not None or options.serial is not None:
        raise UsageError(
            "flash: --export writes a file alone; leave out --dry-run, --tool, --serial"
        )
    if options.image is None:
        image = load_image()[0]
    else:
        image = read_bytes(options.image, "firmware image")
        check_image(options.image, image)
    content = export_flash(image, model, options.export.suffix.lower())
    write_bytes(options.export, content)
    print(f"{options.export}: {len(content)} bytes; copy it onto the drive NOD_F767ZI")
    return 0


def _prebuilt_image(folder: Path) -> Path:
    """Write the image that ships with the package to ``folder``, where a tool can read it, and
    return its path."""
    path = folder / f"{BOARD}.bin"
    write_bytes(path, load_image()[0])
    return path
