"""``eitskin stream``: show a board's touches, images or raw frames as they arrive, and a
summary."""

import argparse

from eitskin.cli.arguments import Output, option
from eitskin.cli.device_options import (
    add_device,
    add_name,
    add_outputs,
    add_scan,
    add_stream,
    add_verbose,
    add_zones,
    named_outputs,
    read_mode,
    session_settings,
)
from eitskin.cli.live_output import check_drawn, show
from eitskin.cli.printing import say, say_progress
from eitskin.device.wire.link_table import Stream
from eitskin.session.robot_session import open_session
from eitskin.truth import observe_scene


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show the touches of a board as a table on standard output, with a line per gesture; show"
        " faults and events of the link on standard error; print a summary at the end. Touches of"
        " a simulated or emulated board are compared with the truth of its scene. With --json each"
        " line is a JSON object, and the last one is the summary (docs/reference/message.md)."
    )
    add_device(parser)
    add_stream(parser, "touches")
    option(parser, "--picture FILE", "draw a panel per frame (PNG, SVG, PDF)", Output)
    option(parser, "--film FILE", "show the frames one after another (WebP, GIF)", Output)
    option(parser, "--record RUN.eits", "also record every packet, like  eitskin record", Output)
    option(parser, "--overwrite", "overwrite existing files of --record and --to")
    add_zones(parser)
    add_outputs(parser)
    add_name(parser)
    add_verbose(parser)
    add_scan(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    mode = read_mode(options.mode)
    drawn = options.picture is not None or options.film is not None
    needs = "an image" if mode & Stream.IMAGE else "a picture" if drawn else ""
    settings = session_settings(options, mode, record=options.record, model_for=needs)
    check_drawn(options, mode, options.device)
    with (
        open_session(
            options.device, settings, say=say, progress=say_progress, observe=observe_scene
        ) as session,
        named_outputs(options, session) as outputs,
    ):
        session.start()
        show(options, session, outputs)
    return 0
