"""``eitskin bench``: building models and simulating scenes on this computer."""

import argparse
import json
from typing import Any

from eitskin.cli.arguments import option
from eitskin_studies.cli.bench_shared import add_page_option, check_within, progress_bar


def add_jacobian(what: Any) -> None:
    """``bench jacobian``."""
    parser = what.add_parser(
        "jacobian", help="time the building of a Jacobian, beside pyEIT's, and of a whole model"
    )
    option(parser, "--json")
    parser.set_defaults(run=run_jacobian)


def run_jacobian(options: argparse.Namespace) -> int:
    """Time the Jacobian beside pyEIT's."""
    from eitskin_studies.benchmarks import jacobian as bench_jacobian

    times = bench_jacobian.run()
    print(json.dumps(times, indent=2) if options.json else bench_jacobian.text(times))
    return 0


def add_effects(what: Any) -> None:
    """``bench effects``."""
    parser = what.add_parser(
        "effects",
        help="time, memory, work and modules of scenes without effects, with each, with all",
    )
    option(parser, "--frames", default=100)
    option(parser, "--rounds", "interleaved rounds; the median counts", default=5)
    add_page_option(parser, "scene-cost")
    parser.set_defaults(run=run_effects)


def run_effects(options: argparse.Namespace) -> int:
    """Time each effect on one scene."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import scenes as bench_scenes
    from eitskin_studies.harness.drawings import Drawing, draw_again, keep_drawings
    from eitskin_studies.harness.sections import fill_marks
    from eitskin_studies.pictures.scene_cost_picture import draw_scene_cost

    check_within("--frames", options.frames, 2, 100_000)
    check_within("--rounds", options.rounds, 1, 1000)
    refuse_unwritable(options.page)
    result = bench_scenes.effects_table(options.frames, options.rounds, progress_bar)
    if options.page is not None:
        command = f"eitskin bench effects --frames {options.frames} --rounds {options.rounds}"
        command += " --page studies/results/scene-cost.md"
        fill_marks(options.page, "scene-cost", bench_scenes.effects_filling(result, command))
        drawing = Drawing(draw_scene_cost, result["cases"])
        keep_drawings(options.page, {"pictures/scene-cost.svg": drawing})
        draw_again(options.page)
    print(json.dumps(result, indent=2) if options.json else bench_scenes.effects_text(result))
    return 0


def add_scenes(what: Any) -> None:
    """``bench scenes``."""
    parser = what.add_parser(
        "scenes", help="time scenes: frames/s of a moving touch, scenes/s of a dataset"
    )
    option(parser, "--frames", "frames of the moving touch", default=400)
    option(parser, "--scenes", "scenes of the dataset", default=500)
    option(parser, "--elements", "elements of the mesh", default=3000)
    option(parser, "--json")
    parser.set_defaults(run=run_scenes)


def run_scenes(options: argparse.Namespace) -> int:
    """Time a moving touch and a dataset."""
    from eitskin_studies.benchmarks import scenes as bench_scenes

    check_within("--frames", options.frames, 2, 100_000)
    check_within("--scenes", options.scenes, 1, 1_000_000)
    check_within("--elements", options.elements, 200, 200_000)
    result = bench_scenes.scenes_table(
        options.frames, options.scenes, options.elements, progress=progress_bar
    )
    print(json.dumps(result, indent=2) if options.json else bench_scenes.scenes_text(result))
    return 0
