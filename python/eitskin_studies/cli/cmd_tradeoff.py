"""``eitskin tradeoff run | recommend``: what accuracy costs in time, and which point of it to
take."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eitskin.cli.budget_options import add_wish
from eitskin.errors import UsageError

if TYPE_CHECKING:
    from eitskin.tuning.front import Front


def add_parser(subparsers: Any) -> None:
    """Add ``tradeoff`` and its own subcommands."""
    parser = subparsers.add_parser(
        "tradeoff", help="what accuracy costs in time, and what to choose for a budget"
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    run = actions.add_parser(
        "run",
        help="measure a set of configurations on sets of scenes",
        description=(
            "Run configurations from very cheap to best over seeded sets of scenes: how good"
            " images, touches and forces are and what they cost. The mask's threshold is chosen on"
            " training scenes; all numbers are of others. A run that was stopped goes on where it"
            " ended when called again with the same folder."
        ),
    )
    run.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("tradeoff"),
        metavar="DIR",
        help="default: %(default)s",
    )
    run.add_argument(
        "--set", type=Path, metavar="FILE.toml", help="your own configurations (default: built in)"
    )
    run.add_argument("--only", metavar="NAME,...", help="these configurations only")
    run.add_argument(
        "--scenes",
        type=int,
        default=180,
        metavar="N",
        help="of the set 'random' (default: %(default)s)",
    )
    run.add_argument(
        "--train", type=int, default=60, metavar="N", help="training scenes (default: %(default)s)"
    )
    run.add_argument(
        "--set-scenes",
        type=int,
        default=30,
        metavar="N",
        help="of each other set (default: %(default)s)",
    )
    run.add_argument(
        "--sets", metavar="NAME,...", help="sets beside 'random' (default: all; '' for none)"
    )
    run.add_argument(
        "--snr-db",
        default="40,60,80",
        metavar="DB,...",
        help="60 must be among them (default: %(default)s)",
    )
    run.add_argument(
        "--seed",
        type=int,
        default=1,
        metavar="S",
        help="of all that is random (default: %(default)s)",
    )
    run.add_argument(
        "--elements",
        type=int,
        default=11_000,
        metavar="N",
        help="of the frames' mesh (default: %(default)s)",
    )
    run.add_argument(
        "--counted",
        type=int,
        default=24,
        metavar="N",
        help="scenes emulated to count instructions; 0: none",
    )
    run.add_argument(
        "--rounds",
        type=int,
        default=25,
        metavar="N",
        help="in which times are taken on this host; 0: none",
    )
    run.add_argument(
        "--front",
        type=Path,
        metavar="FRONT.json",
        help="also write what the package ships of the results",
    )
    run.add_argument(
        "--page", type=Path, metavar="PAGE.md", help="also put tables and pictures into this page"
    )
    run.add_argument("--no-pictures", action="store_true", help="tables only")
    run.add_argument("--json", action="store_true", help="print the results as JSON")
    run.set_defaults(run=run_run)
    recommend = actions.add_parser(
        "recommend",
        help="the point to take for a budget or an accuracy, and its model",
        description=(
            "Choose from measured results: the most accurate point within --budget, or the cheapest"
            " that reaches --accuracy. The budget holds for solve and touches of the mean frame"
            " (host: the median), with --worst of the costliest that was counted or timed."
        ),
    )
    add_wish(recommend)
    recommend.add_argument(
        "--board", choices=("f767", "host"), default="f767", help="default: %(default)s"
    )
    recommend.add_argument(
        "--front",
        type=Path,
        metavar="FRONT.json",
        help="results of  tradeoff run  (default: those shipped)",
    )
    recommend.add_argument(
        "--scenes",
        default="random",
        metavar="SET",
        help="the set that accuracy is of (default: %(default)s)",
    )
    recommend.add_argument(
        "--snr-db", type=float, default=60.0, metavar="DB", help="default: %(default)g"
    )
    recommend.add_argument(
        "--by",
        choices=("image", "discs"),
        default="image",
        help="whose MIoU (default: %(default)s)",
    )
    recommend.add_argument(
        "--period",
        metavar="TIME",
        help="to measure a frame, as 12ms (default: the budget, or 20.8ms)",
    )
    recommend.add_argument(
        "--worst",
        action="store_true",
        help="hold the costliest frame to the budget, not the mean one",
    )
    recommend.add_argument(
        "--warm",
        action="store_true",
        help="also points that begin each frame from the last's image",
    )
    recommend.add_argument(
        "-o", "--output", type=Path, metavar="MODEL.eitm", help="build and write the model to use"
    )
    recommend.add_argument(
        "--skin",
        type=Path,
        metavar="SKIN.toml",
        help="of the model (default: the paper's 194 mm disk)",
    )
    recommend.add_argument("--json", action="store_true")
    recommend.set_defaults(run=run_recommend)


def run_run(options: argparse.Namespace) -> int:
    """Measure, and write tables and pictures."""
    from eitskin.fileio import refuse_unwritable, write_bytes
    from eitskin.tuning.configuration import load_set
    from eitskin.tuning.front import Where, for_package
    from eitskin_studies.cli.cmd_compare import progress
    from eitskin_studies.tradeoff.default_set import default_set
    from eitskin_studies.tradeoff.run import RunSettings, run
    from eitskin_studies.tradeoff.table import to_csv, to_json, to_text

    refuse_unwritable(options.front, options.page)
    if options.output.exists() and not options.output.is_dir():
        raise UsageError(f"-o {options.output}: this is a file; name a folder")
    configurations = default_set() if options.set is None else load_set(options.set)
    if options.only is not None:
        configurations = tuple(_named(configurations, name) for name in options.only.split(","))
    settings = _settings(options, RunSettings)
    if not options.no_pictures:
        from eitskin.view.pictures import load_matplotlib

        load_matplotlib()
    front = run(configurations, settings, options.output, progress)
    write_bytes(options.output / "front.json", to_json(front).encode())
    if options.front is not None:
        write_bytes(options.front, to_json(for_package(front)).encode())
    write_bytes(options.output / "table.csv", to_csv(front).encode())
    if not options.no_pictures:
        from eitskin_studies.pictures.tradeoff_pictures import draw_all

        draw_all(options.output, front)
    if options.page is not None:
        from eitskin_studies.pictures.tradeoff_pictures import PICTURES
        from eitskin_studies.tradeoff.page import fill_page

        fill_page(options.page, for_package(front), options.output, PICTURES)
    print(to_json(front) if options.json else to_text(front, Where()))
    return 0


def _settings(options: argparse.Namespace, kind: Any) -> Any:
    if options.seed < 0:
        raise UsageError(f"--seed {options.seed} must be 0 or above")
    for name, value, low, high in (
        ("--elements", options.elements, 200, 200_000),
        ("--counted", options.counted, 0, 10_000),
        ("--rounds", options.rounds, 0, 100_000),
    ):
        if not low <= value <= high:
            raise UsageError(f"{name} {value} is out of range; use {low} to {high}")
    try:
        snrs_db = tuple(sorted({float(one) for one in options.snr_db.split(",")}))
    except ValueError:
        raise UsageError(
            f"--snr-db {options.snr_db}: give numbers with commas between, such as 40,60,80"
        ) from None
    more = (
        {}
        if options.sets is None
        else {"sets": tuple(name.strip() for name in options.sets.split(",") if name.strip())}
    )
    return kind(
        scenes=options.scenes,
        train_scenes=options.train,
        set_scenes=options.set_scenes,
        snrs_db=snrs_db,
        seed=options.seed,
        simulated_elements=options.elements,
        counted=options.counted,
        rounds=options.rounds,
        **more,
    )


def _named(configurations: Any, name: str) -> Any:
    from eitskin.config import nearest

    found = {one.name: one for one in configurations}
    if name.strip() not in found:
        raise UsageError(
            f"--only: no configuration is named {name.strip()!r}; {nearest(name.strip(), found)}"
        )
    return found[name.strip()]


def run_recommend(options: argparse.Namespace) -> int:
    """Choose, say why, and write the model."""
    from eitskin.cli.budget_options import read_wish
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
    front: Front = load_front(options.front)
    point = choose(
        [one for one in front.points if options.warm or not one.configuration.warm_start], wish
    )
    chosen = Recommendation(point, wish)
    facts = chosen.as_dict() | {"front": front.where_from}
    size = None if options.output is None else write_model(options.output, point, skin, protocol)
    if options.json:
        print(
            json.dumps(
                facts | {"model": None if options.output is None else str(options.output)}, indent=2
            )
        )
        return 0
    print(chosen.text())
    if size is not None:
        print(
            f"{options.output}: {size} bytes; its defaults are these settings, as far as a model"
            " holds them"
        )
        if options.skin is not None:
            print(
                "the numbers are of the paper's skin; on another one they may differ:  eitskin"
                " compare --skin  tells"
            )
    return 0
