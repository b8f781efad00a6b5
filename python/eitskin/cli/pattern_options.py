"""The options ``--drive`` and ``--measure``, which name the pattern of a scan."""

import argparse
from dataclasses import replace
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin.skin.protocol import PATTERNS_HELP, Protocol, adjacent, in_order, pattern
from eitskin.skin.skin import Skin, load_skin, paper_skin


def add_pattern(parser: Any) -> None:
    """Add both."""
    option(
        parser,
        "--drive PATTERN",
        f"pairs that drive: {PATTERNS_HELP} (default: the skin's [protocol], else adjacent)",
    )
    option(
        parser,
        "--measure PATTERN",
        "pairs that measure (default: as --drive; adjacent if that is opposite)",
    )
    option(
        parser,
        "--order ORDER",
        'order of the drives: "by 7" measures drive 7 j modulo their number at place j',
    )


def skin_and_protocol(options: argparse.Namespace, skin: Any) -> tuple[Skin, Protocol]:
    """Return the description in the file ``skin`` (None: the paper's), scanned as the options say.

    Raises:
        UsageError: --measure is given without --drive.
        EitskinError: the description cannot be read, or the pattern is not possible for it.
    """
    described, own = (paper_skin(), adjacent(16)) if skin is None else load_skin(skin)
    return described, with_pattern(options, own)


def with_pattern(options: argparse.Namespace, own: Protocol) -> Protocol:
    """Return the protocol that the options name in place of ``own``, for the same electrodes and
    the same current."""
    if options.measure is not None and options.drive is None:
        raise UsageError("--measure goes with --drive; name both patterns")
    if options.drive is not None:
        own = pattern(own.n_electrodes, options.drive, options.measure, own.current_a)
    return own if options.order is None else in_order(replace(own, drive_order=()), options.order)
