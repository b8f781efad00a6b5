"""``eitskin tare``: take the reference from the untouched skin."""

import argparse

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device, open_named
from eitskin.cli.printing import answer, say
from eitskin.device.client import TARE_FRAMES, check_tare_frames


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Take a board's reference frame from its untouched skin; four frames or more also give the"
        " noise. The board keeps the reference until it is reset, the scan is changed, or another"
        " model is uploaded."
    )
    add_device(parser)
    option(parser, "--frames N", "number of frames: 1, or 4 to 1024", int, default=TARE_FRAMES)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    check_tare_frames(options.frames)
    with open_named(options) as device:
        if not device.transport.capabilities.own_clock:
            say(f"leave the skin untouched: taking the reference from {options.frames} frames")
        device.tare(options.frames)
        url = device.transport.url
    facts = {"device": url, "frames": options.frames, "tared": True}
    return answer(options, facts, f"{url}: reference taken from {options.frames} frames")
