"""``eitskin board``: show or change the settings that belong to the board's owner: name, lock,
current, limit."""

import argparse

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device, open_named
from eitskin.cli.printing import answer, table
from eitskin.device.timing import check_name
from eitskin.device.wire.link_table import Setting

SETTINGS = (  # bits of eits_setting, each with the option that sets it and the one that clears it
    (
        "LOCKED",
        ("--lock", "uploads, settings and lower excitations need the blue button"),
        ("--unlock", "nothing needs the button"),
    ),
    (
        "KEEP_CURRENT",
        ("--keep-current", "the current keeps flowing when no program listens"),
        ("--no-keep-current", "the current then stops within a second (as delivered)"),
    ),
    (
        "SENSE",
        ("--sense", "a sense resistor is fitted: measure the current"),
        ("--no-sense", "no sense resistor is fitted (as delivered)"),
    ),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show or change the settings of a board's owner. The board keeps them without power. A"
        " locked board accepts changes only while its blue button is held."
    )
    add_device(parser)
    named = parser.add_mutually_exclusive_group()
    named.add_argument(
        "--name",
        metavar="NAME",
        type=lambda text: check_name(text, "--name"),
        help="the board's name in messages, topics, frames and the TUIO source",
    )
    named.add_argument(
        "--no-name", dest="name", action="store_const", const="", help="the board has no name"
    )
    for name, (on, text), (off, contrary) in SETTINGS:
        either = parser.add_mutually_exclusive_group()
        for flag, value, meaning in ((on, True, text), (off, False, contrary)):
            either.add_argument(flag, dest=name, action="store_const", const=value, help=meaning)
    option(
        parser,
        "--limit-ua UA",
        "switch the current off above this rms value; 0: the board's own limit",
        within=(0, 10_000),
    )
    option(parser, "--clear-faults", "clear all faults, including a current above its limit")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    with open_named(options) as device:
        if options.clear_faults:
            device.clear_faults()
        info = device.board if device.replays else device.info()
        wanted = Setting(info.settings)
        for name, *_ in SETTINGS:
            named = getattr(options, name)
            if named is not None:
                wanted = wanted | Setting[name] if named else wanted & ~Setting[name]
        changed = options.name not in (None, info.name)
        if changed or wanted != info.settings or options.limit_ua is not None:
            info = device.settings(wanted, options.limit_ua, options.name)
        url = device.transport.url
    facts = {
        "name": info.name,
        "settings": info.setting_names,
        "current_limit_ua_rms": info.current_limit_ua_rms,
    }
    limit = f"{info.current_limit_ua_rms} uA rms" if info.current_limit_ua_rms else "none"
    kept = ", ".join(info.setting_names) or "none"
    shown = {"device": url, "name": info.name or "none", "settings": kept, "limit": limit}
    return answer(options, {"device": url, **facts}, table(shown))
