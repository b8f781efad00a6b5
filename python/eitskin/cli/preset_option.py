"""The option ``--preset``, which chooses the settings of the solver, and on a board of the scan."""

import argparse
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin.tuning.front import Preset, named_preset

CHOSEN = ("solver", "iterations", "gap", "mac_limit", "samples", "full", "reciprocal")


def add_preset(parser: Any) -> None:
    """Add ``--preset``."""
    option(
        parser,
        "--preset",
        "settings by name. fast: the earliest report with an MIoU of at least .84; balanced: the"
        " most accurate with a report within 45 ms of contact; accurate: the most accurate; both of"
        " these are at least as accurate as the defaults",
        choices=("fast", "balanced", "accurate"),
    )


def read_preset(options: argparse.Namespace, board: str) -> Preset | None:
    """Return the preset that ``--preset`` names for ``board``, or None if it is not given.

    Raises:
        UsageError: another option sets something that the preset chooses.
    """
    if options.preset is None:
        return None
    for name in CHOSEN:
        if getattr(options, name, None) not in (None, False):
            raise UsageError(
                f"--{name.replace('_', '-')} is chosen by --preset; leave out one of them"
            )
    return named_preset(options.preset, board)
