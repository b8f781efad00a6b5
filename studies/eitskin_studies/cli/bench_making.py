"""``eitskin bench``: building models and simulating scenes on this computer."""

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin_studies.cli.bench_shared import add_page_option, check_within, progress_bar


def add_jacobian(what: Any) -> None:
    """``bench jacobian``."""
    parser = what.add_parser(
        "jacobian", help="building: Jacobian beside pyEIT's, and the whole model"
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
        help="scenes: time, memory, work and modules with no effect, with each alone, with all",
    )
    option(parser, "--frames", default=100)
    option(parser, "--picture PNG", "draw it", Path)
    add_page_option(parser, "scene-cost")
    parser.set_defaults(run=run_effects)


def run_effects(options: argparse.Namespace) -> int:
    """Time each effect on one scene."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import scenes as bench_scenes
    from eitskin_studies.harness.sections import fill_marks

    check_within("--frames", options.frames, 2, 100_000)
    refuse_unwritable(options.page, options.picture)
    result = bench_scenes.effects_table(options.frames, progress=progress_bar)
    if options.picture is not None:
        from eitskin_studies.pictures.scene_cost_picture import draw_scene_cost

        draw_scene_cost(options.picture, result)
    if options.page is not None:
        command = f"eitskin bench effects --frames {options.frames}"
        command += " --page studies/results/scene-cost.md --picture PNG"
        fill_marks(options.page, "scene-cost", bench_scenes.effects_filling(result, command))
    print(json.dumps(result, indent=2) if options.json else bench_scenes.effects_text(result))
    return 0


def add_scenes(what: Any) -> None:
    """``bench scenes``."""
    parser = what.add_parser(
        "scenes", help="scenes: frames/s of a moving touch, static scenes/s of a dataset"
    )
    option(parser, "--frames", "of the moving touch", default=400)
    option(parser, "--scenes", "of the dataset", default=500)
    option(parser, "--elements", "of the mesh", default=3000)
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
