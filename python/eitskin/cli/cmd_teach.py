"""``eitskin teach ACTION``: a model learned from presses at known places. One file an action beside
this one, ``teach_ACTION``, with ``add_parser(actions)``."""

import argparse
import importlib

ACTIONS = ("plan", "record", "fit", "update", "check")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Learn a skin's model from presses at known places: no sign, gain, order of"
        " channels or exact geometry is needed. docs/guide/teaching.md shows how."
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name in ACTIONS:
        importlib.import_module(f"eitskin.cli.teach_{name}").add_parser(actions)
