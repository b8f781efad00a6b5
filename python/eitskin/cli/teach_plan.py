"""``eitskin teach plan SKIN -n N``: choose places to press, as a list and as a template in true
size."""

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.fileio import refuse_unwritable, write_beside
from eitskin.skin.skin import load_skin
from eitskin.teaching.plan import plan_places, save_plan
from eitskin.teaching.practice import practice_scene
from eitskin.view.template_picture import check_template, draw_template


def add_parser(actions: Any) -> None:
    parser = actions.add_parser(
        "plan",
        help="choose places to press, with a template in true size to lay on the skin",
        description=(
            "Choose places whose presses determine the skin's response best, from physics alone."
            " The first n places of a longer plan are a plan of n, so you can stop at any time."
        ),
    )
    option(parser, "skin SKIN.toml", "skin description", Path)
    option(parser, "-n --presses N", "number of places", default=50)
    option(parser, "-o --output PLAN.csv", "write the places, for  teach record", Output)
    option(parser, "--picture TEMPLATE.pdf", "true size, on A4 pages; .svg: a single page", Output)
    option(
        parser,
        "--practice SCENE.toml",
        "write a scene with these presses, to try  teach record --device sim:SCENE.toml",
        Output,
    )
    option(parser, "--json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.output, options.picture, options.practice)
    if options.picture is not None:
        check_template(options.picture)
    skin, protocol = load_skin(options.skin)
    plan = plan_places(skin, protocol, options.presses)
    if options.picture is not None:
        pages = draw_template(options.picture, skin, plan.place_mm)
    if options.output is not None:
        save_plan(options.output, plan)
    if options.practice is not None:
        with write_beside(options.practice) as temporary:
            temporary.write_text(
                practice_scene(skin, options.skin.resolve(), plan), encoding="utf-8"
            )
    if options.json:
        print(json.dumps({"skin": skin.name, "place_mm": plan.place_mm.round(2).tolist()}))
        return 0
    print(f"skin {skin.name!r}: press here, in this order (mm, coordinates of the description)")
    for number, (x, y) in enumerate(plan.place_mm):
        print(f"{number + 1:4d} {x:8.1f} {y:8.1f}")
    if options.picture is not None:
        print(f"{options.picture}: {pages} page{'s' * (pages > 1)}; print at 100 %")
    return 0
