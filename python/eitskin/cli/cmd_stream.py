"""``eitskin stream``: a board's touches, images or raw frames as they come, and what they amounted
to."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.arguments import option
from eitskin.cli.device_options import (
    add_device,
    add_scan,
    add_stream,
    check_recording,
    check_scan,
    chosen_every,
    open_named,
    prepare,
    read_every,
    read_mode,
)

if TYPE_CHECKING:
    from eitskin.device.known_model import KnownModel


def add_parser(subparsers: Any) -> None:
    """Add ``stream``."""
    parser = subparsers.add_parser(
        "stream",
        help="touches, images or raw frames of a board as they come",
        description=(
            "Follow a board: a line a frame on standard output, faults and events of the link on"
            " standard error, a summary at the end. What is seen on a simulated or emulated board"
            " is compared with its scene's truth. With --json each line is a JSON object, the last"
            " one the summary."
        ),
    )
    add_device(parser)
    add_stream(parser, "touches")
    option(parser, "--picture PNG", "draw images and touches, a panel a frame", Path)
    option(parser, "--record RUN.eits", "also record every packet, as  eitskin record  does", Path)
    option(parser, "--overwrite", "record over a file that exists")
    add_scan(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Set up, follow, sum up."""
    from eitskin.cli.live_output import check_picture, show
    from eitskin.device.known_model import find_model, need_model
    from eitskin.device.live import follow, replayed
    from eitskin.device.wire.link_table import Stream
    from eitskin.fileio import refuse_unwritable
    from eitskin.scoring.scene_truth import truth_of, until_over

    what, (every, frames) = read_mode(options.mode), read_every(options)
    check_scan(options)
    refuse_unwritable(options.picture)
    check_recording(options.record, options.overwrite)
    check_picture(options.picture, what)
    with open_named(options) as device:
        name = device.transport.name
        known: KnownModel | None
        if what & Stream.IMAGE or options.picture is not None:
            known = need_model(
                device.board,
                options.model,
                name,
                "an image" if what & Stream.IMAGE else "a picture",
            )
        else:
            known = find_model(device.board, options.model, name)
        needed = bool(what & (Stream.IMAGE | Stream.TOUCHES))
        truth = truth_of(options.device, options.sign or "increase")
        recorder = prepare(
            options, device, known, needs_reference=needed, record=options.record, truth=truth
        )
        every = chosen_every(device, what, every)
        with nullcontext() if recorder is None else recorder:
            items = (replayed if device.transport.replays else follow)(
                device, what, every=every, frames=frames
            )
            show(options, until_over(items, None if frames else truth), device, known, truth)
    return 0
