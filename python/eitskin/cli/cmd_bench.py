"""``eitskin bench frame | solve | jacobian | effects | scenes``: speed, side by side in one run."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from eitskin.errors import UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``bench`` and its own subcommands."""
    parser = subparsers.add_parser("bench", help="measure speed, side by side in one run")
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    frame = what.add_parser("frame", help="one frame through cffi: p50, p99, share outside C, beside numpy")
    frame.add_argument("--runs", type=int, default=2000, help="default: %(default)s")
    frame.add_argument("--json", action="store_true")
    frame.set_defaults(run=run_frame)
    solve = what.add_parser("solve", help="the solve alone: time to a suboptimality, beside other solvers")
    solve.add_argument("--scenes", type=int, default=20, help="problems of each model (default: %(default)s)")
    solve.add_argument("--seed", type=int, default=3, help="of the scenes (default: %(default)s)")
    solve.add_argument("--rounds", type=int, default=11, help="interleaved rounds (default: %(default)s)")
    solve.add_argument("--picture", type=Path, metavar="PNG", help="draw suboptimality against MIoU instead")
    solve.add_argument("--json", action="store_true")
    solve.set_defaults(run=run_solve)
    jacobian = what.add_parser("jacobian", help="building: Jacobian beside pyEIT's, and the whole model")
    jacobian.add_argument("--json", action="store_true")
    jacobian.set_defaults(run=run_jacobian)
    effects = what.add_parser("effects", help="scenes: the time with no effect, with each alone, with all")
    effects.add_argument("--frames", type=int, default=100, help="default: %(default)s")
    effects.add_argument("--json", action="store_true")
    effects.set_defaults(run=run_effects)
    scenes = what.add_parser("scenes", help="scenes: frames/s of a moving touch, static scenes/s of a dataset")
    scenes.add_argument("--frames", type=int, default=400, help="of the moving touch (default: %(default)s)")
    scenes.add_argument("--scenes", type=int, default=500, help="of the dataset (default: %(default)s)")
    scenes.add_argument("--elements", type=int, default=3000, help="of the mesh (default: %(default)s)")
    scenes.add_argument("--json", action="store_true")
    scenes.set_defaults(run=run_scenes)


def run_frame(options: argparse.Namespace) -> int:
    """Time a frame."""
    from eitskin.study import bench_frame

    if not 100 <= options.runs <= 10_000_000:
        raise UsageError(f"bench frame: --runs {options.runs} is out of range; use 100 to 10000000")
    times = bench_frame.run(options.runs)
    print(json.dumps(times.as_dict(), indent=2) if options.json else bench_frame.to_text(times))
    return 0


def run_solve(options: argparse.Namespace) -> int:
    """Time the solvers, or draw what their suboptimality means for images."""
    from eitskin.fileio import refuse_unwritable

    _within("--scenes", options.scenes, 4, 1000)
    _within("--seed", options.seed, 0, 2**31 - 1)
    _within("--rounds", options.rounds, 3, 10_000)
    refuse_unwritable(options.picture)
    if options.picture is not None:
        from eitskin.study import suboptimality
        from eitskin.view.suboptimality_picture import draw

        curves = suboptimality.run(options.scenes, options.seed, _progress)
        draw(options.picture, curves)
        print(json.dumps(curves.as_dict(), indent=2) if options.json else suboptimality.text(curves))
        return 0
    from eitskin.study import bench_solve

    result = bench_solve.run(options.scenes, options.seed, options.rounds, _progress)
    print(json.dumps(result, indent=2) if options.json else bench_solve.text(result))
    return 0


def run_jacobian(options: argparse.Namespace) -> int:
    """Time the Jacobian beside pyEIT's."""
    from eitskin.study import bench_jacobian

    times = bench_jacobian.run()
    print(json.dumps(times, indent=2) if options.json else bench_jacobian.text(times))
    return 0


def _within(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise UsageError(f"bench: {name} {value} is out of range; use {low} to {high}")


def _progress(items: Sequence[Any]) -> Iterable[Any]:
    """A bar on stderr where that is a terminal; nothing otherwise."""
    from tqdm import tqdm

    shown: Iterable[Any] = tqdm(items, unit="", leave=False, disable=not sys.stderr.isatty())
    return shown


def run_effects(options: argparse.Namespace) -> int:
    """Time each effect on one scene."""
    from eitskin.study import bench_scenes

    _within("--frames", options.frames, 2, 100_000)
    result = bench_scenes.effects_table(options.frames, progress=_progress)
    print(json.dumps(result, indent=2) if options.json else bench_scenes.effects_text(result))
    return 0


def run_scenes(options: argparse.Namespace) -> int:
    """Time a moving touch and a dataset."""
    from eitskin.study import bench_scenes

    _within("--frames", options.frames, 2, 100_000)
    _within("--scenes", options.scenes, 1, 1_000_000)
    _within("--elements", options.elements, 200, 200_000)
    result = bench_scenes.scenes_table(options.frames, options.scenes, options.elements, progress=_progress)
    print(json.dumps(result, indent=2) if options.json else bench_scenes.scenes_text(result))
    return 0
