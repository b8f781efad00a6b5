"""``eitskin draw WHAT``: the documentation's pictures."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``draw`` and its own subcommands."""
    parser = subparsers.add_parser(
        "draw", help="make pictures of the documentation, and drawings of the examples"
    )
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    effect = what.add_parser(
        "effect", help="draw the law of one effect, and what it adds to a frame"
    )
    option(effect, "name NAME", "name of the effect (eitskin scene effects)")
    option(effect, "-o --output PNG", None, Path, required=True)
    effect.set_defaults(run=run_effect)
    touch = what.add_parser(
        "touch", help="draw a touch's law or shape, and what it does to a frame"
    )
    option(touch, "name NAME", "name of the law or shape (docs/guide/scenes.md)")
    option(touch, "-o --output PNG", None, Path, required=True)
    touch.set_defaults(run=run_touch)
    miou = what.add_parser(
        "miou", help="draw what MIoU measures, and images at about .75, .85, .95"
    )
    option(miou, "-o --output PNG", None, Path, required=True)
    miou.set_defaults(run=run_miou)
    wiring = what.add_parser("wiring", help="draw the wiring of board, multiplexers and skin")
    option(wiring, "-o --output PNG", None, Path, required=True)
    wiring.set_defaults(run=run_wiring)
    live = what.add_parser("live", help="film the live page of a simulated skin")
    option(live, "-o --output WEBP", None, Path, required=True)
    option(live, "--robot", "draw one picture of the arm of examples/robot instead")
    live.set_defaults(run=run_live)
    page = what.add_parser(
        "page", help="draw the pictures of a page of results again, from their stored numbers"
    )
    option(page, "name NAME", "name of the page: studies/results/NAME.md")
    page.set_defaults(run=run_page)
    examples = what.add_parser("examples", help="write hand.svg and forearm.dxf")
    option(examples, "-o --output FOLDER", None, Path, required=True)
    examples.set_defaults(run=run_examples)


def run_effect(options: argparse.Namespace) -> int:
    """Draw one effect."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.pictures.effect_pictures import draw_effect

    refuse_unwritable(options.output)
    draw_effect(options.output, options.name)
    print(f"picture: {options.output}")
    return 0


def run_touch(options: argparse.Namespace) -> int:
    """Draw one law or shape."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.pictures.touch_pictures import draw_touch

    refuse_unwritable(options.output)
    draw_touch(options.output, options.name)
    print(f"picture: {options.output}")
    return 0


def run_miou(options: argparse.Namespace) -> int:
    """Draw what MIoU measures."""
    from eitskin.cli.progress import named_bar
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.pictures.miou_picture import draw_miou

    refuse_unwritable(options.output)
    draw_miou(options.output, named_bar)
    print(f"picture: {options.output}")
    return 0


def run_wiring(options: argparse.Namespace) -> int:
    """Draw the wiring."""
    from eitskin_studies.pictures.wiring_picture import draw_wiring

    draw_wiring(options.output)
    print(f"picture: {options.output}")
    return 0


def run_live(options: argparse.Namespace) -> int:
    """Record the live page."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.pictures.live_view_picture import draw_live_robot, draw_live_view

    refuse_unwritable(options.output)
    (draw_live_robot if options.robot else draw_live_view)(options.output)
    print(f"picture: {options.output}")
    return 0


def run_page(options: argparse.Namespace) -> int:
    """Draw a page's pictures again."""
    from eitskin_emulator.core_on_qemu import checkout_root
    from eitskin_studies.harness.drawings import draw_again
    from eitskin_studies.pictures.tradeoff_pictures import draw_all
    from eitskin_studies.tradeoff.fronts import recorded_front
    from eitskin_studies.tradeoff.page import PICTURES

    page = checkout_root() / "studies" / "results" / f"{options.name}.md"
    if options.name == "tradeoff":  # its points are recorded in a file of their own
        drawn = draw_all(page.parent / PICTURES, recorded_front())
    else:
        drawn = draw_again(page)
    print("\n".join(f"picture: {path}" for path in drawn))
    return 0


def run_examples(options: argparse.Namespace) -> int:
    """Write both drawings."""
    from eitskin_studies.experiments.shapes.example_drawings import write_drawings

    if not options.output.is_dir():
        raise UsageError(f"-o {options.output}: no such folder; make it first")
    write_drawings(options.output)
    return 0
