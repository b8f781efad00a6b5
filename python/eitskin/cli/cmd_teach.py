"""``eitskin teach ACTION``: learn a model from presses at known places. Each action has a module
``teach_ACTION`` beside this one, with ``add_parser(actions)``."""

import argparse
import importlib

ACTIONS = ("plan", "record", "fit", "update", "check")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Learn a skin's model from presses at known places. Sign, gain, channel order and exact"
        " geometry need not be known. docs/guide/teaching.md shows how."
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name in ACTIONS:
        importlib.import_module(f"eitskin.cli.teach_{name}").add_parser(actions)
