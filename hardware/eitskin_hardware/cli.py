"""``eitskin hardware make``: the files of the instrument, from its circuit as code."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option

MADE = Path("hardware/made")


def add_parser(subparsers: Any) -> None:
    """Add ``hardware`` and its own subcommands."""
    parser = subparsers.add_parser(
        "hardware", help="the instrument's circuit, its simulation, and the skin's container"
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser(
        "make",
        help="write netlist, rules check, parts list, wiring, schematic, deck and results",
        description="Write all files that are made from the circuit; needs ngspice.",
    )
    option(make, "-o --output FOLDER", f"default: {MADE}", Path, default=MADE)
    make.set_defaults(run=run_make)


def run_make(options: argparse.Namespace) -> int:
    """Write everything."""
    from eitskin_hardware.make import make_all

    for name in make_all(options.output):
        print(options.output / name)
    return 0
