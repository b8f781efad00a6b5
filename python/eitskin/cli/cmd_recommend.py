"""``eitskin recommend``: choose measured settings by a preset, a time limit or an accuracy, and
build a model with them."""

import argparse
from dataclasses import replace
from pathlib import Path

from eitskin.cli.arguments import Output, option
from eitskin.cli.pattern_options import add_pattern, skin_and_protocol
from eitskin.cli.preset_option import add_preset
from eitskin.cli.printing import answer
from eitskin.cli.progress import bar
from eitskin.errors import UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.skin.protocol import adjacent, pattern_name
from eitskin.tuning.front import (
    Conditions,
    Preset,
    checked_preset,
    choose,
    default_point,
    load_front,
    named_preset,
    read_limit,
)
from eitskin.tuning.recommend import Recommendation, write_model


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Choose from measured settings: the most accurate ones within --budget, or the cheapest"
        " ones that reach --accuracy. The budget covers the solver and the touches of the mean"
        " frame (host: the median); with --worst, of the most expensive frame that was measured."
    )
    add_preset(parser)
    option(
        parser,
        "--budget COST",
        "greatest cost of solver and touches: 10ms, 800us, 600kMACs, 2.5Minstructions",
    )
    option(
        parser,
        "--accuracy MIOU",
        "least accuracy of images (default scenes: 1 to 3 random touches at 60 dB)",
        float,
    )
    option(parser, "--board", choices=("f767", "host"), default="f767")
    option(parser, "--front FRONT.json", "your own results (eitskin tradeoff run)", Path)
    option(parser, "--scenes SET", "set of scenes that the accuracy refers to", default="random")
    option(
        parser,
        "--snr-db DB",
        "SNR of your instrument; without it, the accuracy is that at 60 dB, and the presets"
        " 'balanced' and 'accurate' are at least as accurate as the defaults at 40, 60 and 80 dB",
        float,
    )
    option(parser, "--by", "MIoU that counts", choices=("image", "discs"), default="image")
    option(
        parser,
        "--period TIME",
        "greatest time to measure a frame, such as 12ms (default: the budget, or 20.8ms)",
    )
    option(parser, "--worst", "apply the budget to the most expensive frame, not to the mean one")
    option(parser, "--warm", "also allow settings that start each frame from the last image")
    option(parser, "-o --output MODEL.eitm", "build and write the model to use", Output)
    option(parser, "--skin SKIN.toml", "skin of the model (default: the paper's disk)", Path)
    add_pattern(parser)
    option(parser, "--json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    preset = _read(options)
    refuse_unwritable(options.output)
    for name in ("skin", "drive", "measure", "order"):
        if getattr(options, name) is not None and options.output is None:
            raise UsageError(f"--{name} is for the model; name its file with  -o MODEL.eitm")
    front = load_front(options.front)
    usable = [one for one in front.points if options.warm or not one.configuration.warm_start]
    point = choose(usable, preset, default=default_point(usable))
    chosen = Recommendation(point, preset)
    facts, lines = chosen.as_dict() | {"front": front.where_from, "model": None}, [chosen.text()]
    if options.output is not None:
        named = options.skin
        skin, protocol = skin_and_protocol(options, named)
        size = write_model(options.output, point, skin, protocol, bar("random skins"))
        facts["model"] = str(options.output)
        lines.append(
            f"{options.output}: {size} bytes; these settings are its defaults, as far as a model"
            " can hold them"
        )
        if named is not None:
            lines.append(
                "the numbers were measured on the paper's skin; on another they may differ"
            )
        if protocol.hash != adjacent(protocol.n_electrodes).hash:
            lines.append(
                f"the numbers were measured with the adjacent pattern; with"
                f" {pattern_name(protocol)} they may differ"
            )
    return answer(options, facts, *lines)


def _read(options: argparse.Namespace) -> Preset:
    """Return the preset that ``--preset`` names, or the limits of the other options."""
    snr_db = 60.0 if options.snr_db is None else options.snr_db
    where = Conditions(options.scenes, snr_db, options.by)
    if options.preset is not None:
        if any(one is not None for one in (options.budget, options.accuracy, options.period)):
            raise UsageError(
                "--preset already sets limits; leave out --budget, --accuracy and --period"
            )
        preset = named_preset(options.preset, options.board, where)
        return replace(preset, snr_known=options.snr_db is not None)
    limit = None if options.budget is None else read_limit(options.budget)
    period = None if options.period is None else read_limit(options.period)
    if period is not None and period.unit != "us":
        raise UsageError(f"--period {options.period}: give a time, such as 12ms")
    period_us = None if period is None else period.value
    return checked_preset(
        Preset(limit, options.accuracy, options.board, where, period_us, options.worst)
    )
