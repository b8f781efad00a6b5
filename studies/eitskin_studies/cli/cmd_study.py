"""``eitskin study NAME``: the paper's experiments, and past them."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import FileError
from eitskin_studies.harness.sections import existing_page


def add_parser(subparsers: Any) -> None:
    """Add ``study``."""
    parser = subparsers.add_parser(
        "study",
        help="run one experiment of the results: data, tables, pictures, and its page",
        description=(
            "Run one experiment from its seed. Every result is kept as it comes: a run that was"
            " stopped, even by kill -9, continues when it is called again. `eitskin study list`"
            " names the experiments."
        ),
    )
    option(parser, "name NAME", "name of the experiment, or: list")
    option(parser, "-o --output DIR", "folder of the results (default: out/NAME)", Path)
    option(parser, "--seed S", "seed of all that is random", default=1)
    option(parser, "--share X", "share of the usual number of scenes", default=1.0)
    option(parser, "--data DIR", "folder of measured frames, for studies of such frames", Path)
    option(parser, "--page FILE.md", "fill the marked places of this page", existing_page)
    option(parser, "--no-pictures", "make tables and data only")
    option(parser, "--json", "print the data instead of tables")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run, write, print."""
    from eitskin_studies.experiments.experiment import ExperimentSettings, workspace_in
    from eitskin_studies.experiments.registry import EXPERIMENTS, load

    if options.name == "list":
        print("\n".join(f"{name:12} {text}" for name, text in EXPERIMENTS.items()))
        return 0

    from eitskin.cli.progress import named_bar
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.experiments.write import to_json, to_text, write_all, write_page

    experiment = load(options.name)
    folder = options.output or Path("out") / options.name
    if folder.exists() and not folder.is_dir():
        raise FileError(f"-o {folder}: this is a file; name a folder")
    refuse_unwritable(options.page)
    if options.data is not None and not options.data.is_dir():
        raise FileError(f"--data {options.data}: no such folder; name that of the measured frames")
    settings = ExperimentSettings(options.seed, options.share, options.data)
    if not options.no_pictures:
        from eitskin.view.pictures import load_matplotlib

        load_matplotlib()
    outcome = experiment.run(workspace_in(folder, settings, named_bar))
    write_all(outcome, folder, not options.no_pictures)
    if options.page is not None:
        write_page(outcome, folder, options.page, options.name, settings)
    print(to_json(outcome) if options.json else to_text(outcome))
    return 0
