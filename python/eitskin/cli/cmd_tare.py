"""``eitskin tare``: take the reference from the untouched skin."""

import argparse

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device, open_named
from eitskin.cli.printing import answer, say
from eitskin.device.client import TARE_FRAMES, check_tare_frames
from eitskin.errors import DeviceError
from eitskin.session.set_up import wait_untouched


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Take a board's reference frame from its untouched skin; four frames or more also give the"
        " noise. The board keeps the reference until it is reset, the scan is changed, or another"
        " model is uploaded. While something touches the skin, the reference waits."
    )
    add_device(parser)
    option(parser, "--frames N", "number of frames: 1, or 4 to 1024", int, default=TARE_FRAMES)
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--anyway",
        action="store_true",
        help="take it although something seems to touch the skin; for a reference that no longer"
        " fits and shows touches that are not there",
    )
    how.add_argument(
        "--undo",
        action="store_true",
        help="restore the reference that the last tare replaced, if the board has kept it",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    check_tare_frames(options.frames)
    with open_named(options) as device:
        url = device.transport.url
        if options.undo:
            device.undo_tare()
            facts = {"device": url, "undone": True, "tared": True}
            return answer(options, facts, f"{url}: the reference before the last tare is back")
        if not device.transport.capabilities.own_clock:
            say(f"leave the skin untouched: taking the reference from {options.frames} frames")
        wait_untouched(lambda: device.tare(options.frames, anyway=options.anyway), say)
        wrong = device.unserved()
        if wrong is not None:
            raise DeviceError(f"{device.transport.name}: {wrong}")
    facts = {"device": url, "frames": options.frames, "tared": True}
    return answer(options, facts, f"{url}: reference taken from {options.frames} frames")
