"""``eitskin dataset``: many scenes drawn from one."""

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import SCENE_HELP, option
from eitskin.cli.progress import lines
from eitskin.errors import FileError, UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``dataset``."""
    dataset = subparsers.add_parser(
        "dataset",
        help="simulate many seeded scenes that are drawn from ranges; an interrupted run resumes",
        description=(
            "Draw scenes from the table [dataset] of a scene and simulate them into a folder of"
            " chunks. The result depends on the description and the seed only. Run the same command"
            " again to resume."
        ),
    )
    option(dataset, "scene SCENE", SCENE_HELP)
    option(dataset, "--count N", "number of scenes", int, required=True)
    option(dataset, "--seed S", default=1)
    option(dataset, "--ranges TOML", "file with [dataset] in place of the scene's own", Path)
    option(dataset, "-o --output FOLDER", None, Path, required=True)
    option(dataset, "--jobs J", "number of processes", default=1)
    option(dataset, "--chunk N", "scenes in each file", default=100)
    option(
        dataset,
        "--scheduler ADDRESS",
        "compute on a Dask cluster: its scheduler, such as tcp://HOST:8786",
    )
    option(dataset, "--json")
    dataset.set_defaults(run=run)


def scene_progress(done: Iterable[int], total: int) -> Iterable[int]:
    """A bar over ``total`` scenes that ``done`` numbers bring nearer."""
    from tqdm import tqdm

    if not sys.stderr.isatty():
        yield from lines(done, "scenes", total, weight=int)
        return
    with tqdm(total=total, desc="scenes", unit="", leave=False) as shown:
        for scenes in done:
            shown.update(scenes)
            yield scenes


def run(options: argparse.Namespace) -> int:
    """Draw and simulate many scenes."""
    from time import perf_counter

    from eitskin.scene.library_scenes import find_scene
    from eitskin_studies.datasets.dataset import job_of, write_dataset

    if not options.output.parent.is_dir():
        raise FileError(f"{options.output}: the folder around it does not exist; make it first")
    if options.scheduler is not None and options.jobs != 1:
        raise UsageError(
            "dataset: --jobs goes with this computer, --scheduler with a cluster; give one of them"
        )
    job = job_of(
        find_scene(options.scene),
        options.count,
        options.seed,
        chunk=options.chunk,
        ranges_file=options.ranges,
    )
    start = perf_counter()
    done = write_dataset(
        job, options.output, jobs=options.jobs, scheduler=options.scheduler, progress=scene_progress
    )
    seconds = perf_counter() - start
    if options.json:
        print(json.dumps({**done, "seconds": seconds, "output": str(options.output)}, indent=2))
        return 0
    kept = f", {done['chunks_kept']} chunks were there already" if done["chunks_kept"] else ""
    print(
        f"{done['scenes_made']} scenes in {done['chunks_made']} chunks{kept} -> {options.output}"
        f" ({seconds:.1f} s)"
    )
    return 0
