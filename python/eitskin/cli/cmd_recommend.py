"""``eitskin recommend``: the measured settings to take for a budget or an accuracy, and their
model."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.budget_options import add_wish, read_wish
from eitskin.errors import UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``recommend``."""
    parser = subparsers.add_parser(
        "recommend",
        help="what to choose for a time or an accuracy, and its model",
        description=(
            "Choose from measured results: the most accurate point within --budget, or the cheapest"
            " that reaches --accuracy. The budget holds for solve and touches of the mean frame"
            " (host: the median), with --worst of the costliest that was counted or timed."
        ),
    )
    add_wish(parser)
    parser.add_argument(
        "--board", choices=("f767", "host"), default="f767", help="default: %(default)s"
    )
    parser.add_argument(
        "--front",
        type=Path,
        metavar="FRONT.json",
        help="results of your own (eitskin tradeoff run, of the studies)",
    )
    parser.add_argument(
        "--scenes",
        default="random",
        metavar="SET",
        help="the set that accuracy is of (default: %(default)s)",
    )
    parser.add_argument(
        "--snr-db", type=float, default=60.0, metavar="DB", help="default: %(default)g"
    )
    parser.add_argument(
        "--by",
        choices=("image", "discs"),
        default="image",
        help="whose MIoU (default: %(default)s)",
    )
    parser.add_argument(
        "--period",
        metavar="TIME",
        help="to measure a frame, as 12ms (default: the budget, or 20.8ms)",
    )
    parser.add_argument(
        "--worst",
        action="store_true",
        help="hold the costliest frame to the budget, not the mean one",
    )
    parser.add_argument(
        "--warm",
        action="store_true",
        help="also points that begin each frame from the last's image",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="MODEL.eitm", help="build and write the model to use"
    )
    parser.add_argument(
        "--skin",
        type=Path,
        metavar="SKIN.toml",
        help="of the model (default: the paper's 194 mm disk)",
    )
    parser.add_argument("--json", action="store_true")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Choose, say why, and write the model."""
    from eitskin.fileio import refuse_unwritable
    from eitskin.skin.protocol import adjacent
    from eitskin.skin.skin import load_skin, paper_skin
    from eitskin.tuning.front import Where, choose, load_front
    from eitskin.tuning.recommend import Recommendation, write_model

    wish = read_wish(
        options, options.board, Where(options.scenes, options.snr_db, options.by), options.period
    )
    refuse_unwritable(options.output)
    if options.skin is not None and options.output is None:
        raise UsageError("--skin is for the model; name its file with  -o MODEL.eitm")
    skin, protocol = (
        (paper_skin(), adjacent(16)) if options.skin is None else load_skin(options.skin)
    )
    front = load_front(options.front)
    point = choose(
        [one for one in front.points if options.warm or not one.configuration.warm_start], wish
    )
    chosen = Recommendation(point, wish)
    size = None if options.output is None else write_model(options.output, point, skin, protocol)
    if options.json:
        model = None if options.output is None else str(options.output)
        facts = chosen.as_dict() | {"front": front.where_from, "model": model}
        print(json.dumps(facts, indent=2))
        return 0
    print(chosen.text())
    if size is not None:
        print(
            f"{options.output}: {size} bytes; its defaults are these settings, as far as a model"
            " holds them"
        )
        if options.skin is not None:
            print("the numbers are of the paper's skin; on another one they may differ")
    return 0
