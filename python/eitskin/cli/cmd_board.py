"""``eitskin board``: what the board's owner may set: lock, current, limit."""

import argparse

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device, open_named
from eitskin.cli.printing import answer, table
from eitskin.device.wire.link_table import Setting

SETTINGS = (  # bits of eits_setting, each with what sets and what clears it
    (
        "LOCKED",
        ("--lock", "uploads, settings and lower excitations need the blue button"),
        ("--unlock", "nothing needs the button"),
    ),
    (
        "KEEP_DRIVE",
        ("--keep-drive", "current flows on where no program listens"),
        ("--no-keep-drive", "it stops within a second (as delivered)"),
    ),
    (
        "SENSE",
        ("--sense", "a sense resistor is fitted: measure the current"),
        ("--no-sense", "none is fitted (as delivered)"),
    ),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show or change what a board's owner has set; the board keeps it over a loss of power."
        " A locked board takes changes only while its blue button is held."
    )
    add_device(parser)
    for name, (on, text), (off, contrary) in SETTINGS:
        either = parser.add_mutually_exclusive_group()
        for flag, value, said in ((on, True, text), (off, False, contrary)):
            either.add_argument(flag, dest=name, action="store_const", const=value, help=said)
    option(
        parser,
        "--limit-ua UA",
        "rms, above which it is switched off; 0: as the board is",
        within=(0, 10_000),
    )
    option(parser, "--clear-faults", "forget faults, a current above its limit among them")
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
        if wanted != info.settings or options.limit_ua is not None:
            info = device.settings(wanted, options.limit_ua)
        url = device.transport.url
    facts = {"settings": info.setting_names, "current_limit_ua_rms": info.current_limit_ua_rms}
    limit = f"{info.current_limit_ua_rms} uA rms" if info.current_limit_ua_rms else "none"
    shown = {"device": url, "settings": ", ".join(info.setting_names) or "none", "limit": limit}
    return answer(options, {"device": url, **facts}, table(shown))
