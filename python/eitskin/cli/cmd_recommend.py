"""``eitskin recommend``: the measured settings to take for a budget or an accuracy, and their
model."""

import argparse
from pathlib import Path

from eitskin.cli.arguments import Output, option
from eitskin.cli.budget_options import add_wish, read_target
from eitskin.cli.printing import answer
from eitskin.cli.progress import bar
from eitskin.errors import UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import load_skin, paper_skin
from eitskin.tuning.front import Conditions, choose, load_front
from eitskin.tuning.recommend import Recommendation, write_model


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Choose from measured results: the most accurate point within --budget, or the cheapest"
        " that reaches --accuracy. The budget holds for solve and touches of the mean frame"
        " (host: the median), with --worst of the costliest that was counted or timed."
    )
    add_wish(parser)
    option(parser, "--board", choices=("f767", "host"), default="f767")
    option(parser, "--front FRONT.json", "results of your own (eitskin tradeoff run)", Path)
    option(parser, "--scenes SET", "the set that accuracy is of", default="random")
    option(parser, "--snr-db DB", default=60.0)
    option(parser, "--by", "whose MIoU", choices=("image", "discs"), default="image")
    option(parser, "--period TIME", "to measure a frame, as 12ms (default: the budget, or 20.8ms)")
    option(parser, "--worst", "hold the costliest frame to the budget, not the mean one")
    option(parser, "--warm", "also points that begin each frame from the last's image")
    option(parser, "-o --output MODEL.eitm", "build and write the model to use", Output)
    option(parser, "--skin SKIN.toml", "of the model (default: the paper's 194 mm disk)", Path)
    option(parser, "--json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    target = read_target(
        options,
        options.board,
        Conditions(options.scenes, options.snr_db, options.by),
        options.period,
    )
    refuse_unwritable(options.output)
    if options.skin is not None and options.output is None:
        raise UsageError("--skin is for the model; name its file with  -o MODEL.eitm")
    front = load_front(options.front)
    usable = [one for one in front.points if options.warm or not one.configuration.warm_start]
    point = choose(usable, target)
    chosen = Recommendation(point, target)
    facts, lines = chosen.as_dict() | {"front": front.where_from, "model": None}, [chosen.text()]
    if options.output is not None:
        named = options.skin
        skin, protocol = (paper_skin(), adjacent(16)) if named is None else load_skin(named)
        size = write_model(options.output, point, skin, protocol, bar("random skins"))
        facts["model"] = str(options.output)
        lines.append(
            f"{options.output}: {size} bytes; its defaults are these settings, as far as a model"
            " holds them"
        )
        if named is not None:
            lines.append("the numbers are of the paper's skin; on another one they may differ")
    return answer(options, facts, *lines)
