"""``eitskin board``: show or change the settings that belong to the board's owner: name, lock,
current, limit, button, and the source and gain that are fitted."""

import argparse

from eitskin.bringup.findings import STAGES
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
    (
        "BUTTON_LOW",
        ("--button-low", "the blue button pulls its pin low; `board bring-up` finds out"),
        ("--button-high", "the blue button lifts its pin (as delivered)"),
    ),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show or change the settings of a board's owner. The board keeps them without power. A"
        " locked board accepts changes only while its blue button is held."
    )
    parser.add_argument(
        "what",
        nargs="?",
        choices=("bring-up",),
        help="lead through the first measurements on an instrument, stage by stage, and name what"
        " is wrong",
    )
    for which, default in (("first", STAGES[0]), ("last", STAGES[-1])):
        text = f"{which} stage of bring-up"
        parser.add_argument(f"--{which}-stage", choices=STAGES, default=default, help=text)
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
    option(
        parser,
        "--source-ua UA",
        "amplitude that the fitted current source gives; 0: as designed, 500",
        within=(0, 7_000),
    )
    option(
        parser,
        "--gain GAIN",
        "of the fitted amplifier, from electrodes to converter; 0: as designed, 3",
        float,
        within=(0.0, 400.0),
    )
    option(parser, "--clear-faults", "clear all faults, including a current above its limit")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    if options.what == "bring-up":
        from eitskin.cli.bring_up import run_bring_up

        return run_bring_up(options)
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
        fitted = (options.limit_ua, options.source_ua, options.gain)
        if changed or wanted != info.settings or any(one is not None for one in fitted):
            info = device.settings(
                wanted, options.limit_ua, options.name, options.source_ua, options.gain
            )
        url = device.transport.url
    facts = {
        "name": info.name,
        "settings": info.setting_names,
        "current_limit_ua_rms": info.current_limit_ua_rms,
        "source_ua": info.source_ua,
        "gain": info.gain,
    }
    limit = f"{info.current_limit_ua_rms} uA rms" if info.current_limit_ua_rms else "none"
    kept = ", ".join(info.setting_names) or "none"
    shown = {"device": url, "name": info.name or "none", "settings": kept, "limit": limit}
    if info.gain_ppm:
        shown["front end"] = f"{info.source_ua} uA, gain {info.gain:g}"
    return answer(options, {"device": url, **facts}, table(shown))
