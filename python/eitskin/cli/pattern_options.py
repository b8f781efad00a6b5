"""The options ``--drive``, ``--measure`` and ``--rows-of``, which say what a scan measures."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin.frames.frames import load_frames
from eitskin.skin.protocol import PATTERNS_HELP, Protocol, adjacent, in_order, pattern
from eitskin.skin.skin import Skin, load_skin, paper_skin


def add_pattern(parser: Any) -> None:
    """Add them, and ``--order``."""
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
    option(
        parser,
        "--rows-of FRAMES.npz",
        "measure the rows of these frames, with their current, in place of a pattern",
        Path,
    )


def skin_and_protocol(options: argparse.Namespace, skin: Any) -> tuple[Skin, Protocol]:
    """Return the description in the file ``skin`` (None: the paper's), scanned as the options say.

    Raises:
        UsageError: --measure is given without --drive, or --rows-of with --drive.
        EitskinError: the description cannot be read, or the pattern is not possible for it.
    """
    described, own = (paper_skin(), adjacent(16)) if skin is None else load_skin(skin)
    return described, with_pattern(options, own)


def with_pattern(options: argparse.Namespace, own: Protocol) -> Protocol:
    """Return the protocol that the options name in place of ``own``, for the same electrodes. It
    has the same current, or that of ``--rows-of``."""
    if options.measure is not None and options.drive is None:
        raise UsageError("--measure goes with --drive; name both patterns")
    if options.rows_of is not None:
        if options.drive is not None:
            raise UsageError("--rows-of and --drive both say what is measured; give one of them")
        own = _rows_of(options.rows_of, own)
    if options.drive is not None:
        own = pattern(own.n_electrodes, options.drive, options.measure, own.current_a)
    return own if options.order is None else in_order(replace(own, drive_order=()), options.order)


def _rows_of(path: Path, own: Protocol) -> Protocol:
    theirs = load_frames(path).protocol
    if theirs.n_electrodes != own.n_electrodes:
        raise UsageError(
            f"--rows-of {path}: frames of {theirs.n_electrodes} electrodes, but the skin has"
            f" {own.n_electrodes}"
        )
    return theirs
