"""``eitskin hardware make``: the files of the instrument, from its circuit as code."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError

MADE = Path("hardware/made")


def add_parser(subparsers: Any) -> None:
    """Add ``hardware`` and its own subcommands."""
    parser = subparsers.add_parser(
        "hardware", help="make the instrument's circuit, its simulation, and the skin's container"
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser(
        "make",
        help="write netlist, rules check, parts list, wiring, schematic, deck and results",
        description="Write all files that are made from the circuit; needs ngspice.",
    )
    option(make, "-o --output FOLDER", f"default: {MADE}", Path, default=MADE)
    make.set_defaults(run=run_make)
    container = actions.add_parser(
        "container",
        help="make a dish for a skin of gel: OpenSCAD source, drawings, with --stl parts to print",
        description=(
            "Write the OpenSCAD source of a dish whose inside is the skin's outline, with a hole"
            " for a post at each electrode, and of a drilling jig for a bought dish; the drawing"
            " with measures and the drawing from each hole to its wire."
        ),
    )
    option(container, "skin SKIN.toml", "skin description", Path, nargs="?")
    option(container, "--paper", "use the paper's 194 mm disk instead of a file")
    option(container, "--stl", "also make dish.stl, jig.stl and post.stl, by openscad")
    option(container, "-o --output FOLDER", None, Path, required=True)
    container.set_defaults(run=run_container)


def run_make(options: argparse.Namespace) -> int:
    """Write everything."""
    from eitskin_hardware.make import make_all

    for name in make_all(options.output):
        print(options.output / name)
    return 0


def run_container(options: argparse.Namespace) -> int:
    """Write the container of one skin."""
    from eitskin.skin.skin import load_skin, paper_skin
    from eitskin_hardware.container.container import PARTS, container_of, make_stl, write_scad
    from eitskin_hardware.container.drawing import draw_measures, draw_wires

    if (options.skin is None) == (not options.paper):
        raise UsageError("hardware container: give either a SKIN.toml or --paper")
    folder = options.output
    if not folder.is_dir():
        raise UsageError(f"-o {folder}: no such folder; make it first")
    made = container_of(paper_skin() if options.paper else load_skin(options.skin)[0])
    write_scad(made, folder)
    draw_measures(made, folder / "measures.svg")
    draw_wires(made, folder / "wires.svg")
    names = ["container.scad", "parameters.scad", "measures.svg", "wires.svg"]
    names += [make_stl(folder, part).name for part in PARTS] if options.stl else []
    for name in names:
        print(folder / name)
    return 0
