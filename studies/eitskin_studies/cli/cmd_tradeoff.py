"""``eitskin tradeoff run``: what accuracy costs in time."""

import argparse
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin_studies.harness.sections import existing_page


def add_parser(subparsers: Any) -> None:
    """Add ``tradeoff`` and its own subcommands."""
    parser = subparsers.add_parser(
        "tradeoff", help="measure what accuracy costs in time (recommend chooses from it)"
    )
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    run = actions.add_parser(
        "run",
        help="measure a set of configurations on sets of scenes",
        description=(
            "Run configurations from very cheap to best over seeded sets of scenes: how good"
            " images, touches and forces are and what they cost. The mask's threshold is chosen on"
            " training scenes; all numbers are of others. A run that was stopped continues when"
            " it is called again with the same folder."
        ),
    )
    option(run, "-o --output DIR", None, Path, default=Path("tradeoff"))
    option(run, "--set FILE.toml", "your own configurations (default: built in)", Path)
    option(run, "--only NAME,...", "these configurations only")
    option(run, "--scenes N", "scenes of the set 'random'", default=180)
    option(run, "--train N", "training scenes", default=60)
    option(run, "--set-scenes N", "scenes of each other set", default=30)
    option(run, "--sets NAME,...", "sets beside 'random' (default: those of discs; '' for none)")
    option(run, "--snr-db DB,...", "SNRs to measure; 60 must be among them", default="40,60,80")
    option(run, "--seed S", "seed of all that is random", default=1)
    option(run, "--elements N", "elements of the frames' mesh", default=11_000)
    option(run, "--counted N", "scenes emulated to count instructions; 0: none", default=24)
    option(run, "--rounds N", "rounds that are timed on this host; 0: none", default=25)
    option(run, "--random-skins N", "random skins for the models' errors; 0: none", default=500)
    option(run, "--no-peers", "leave out other methods on the same scenes")
    option(run, "--front FRONT.json", "also write what the package ships of the results", Path)
    option(run, "--recorded FRONT.json", "also write what the page shows", Path)
    option(run, "--page PAGE.md", "also put tables and pictures into this page", existing_page)
    option(run, "--no-pictures", "make tables only")
    option(run, "--json", "print the results as JSON")
    run.set_defaults(run=run_run)


def run_run(options: argparse.Namespace) -> int:
    """Measure, and write tables and pictures."""
    from eitskin.cli.progress import named_bar
    from eitskin.fileio import refuse_unwritable, write_bytes
    from eitskin.tuning.front import Conditions
    from eitskin_studies.tradeoff.configuration_sets import load_set
    from eitskin_studies.tradeoff.default_set import default_set
    from eitskin_studies.tradeoff.fronts import as_dict, in_short, kept_cells, to_json
    from eitskin_studies.tradeoff.run import RunSettings, run
    from eitskin_studies.tradeoff.table import to_csv, to_text

    refuse_unwritable(options.front, options.recorded, options.page)
    if options.output.exists() and not options.output.is_dir():
        raise UsageError(f"-o {options.output}: this is a file; name a folder")
    configurations = default_set() if options.set is None else load_set(options.set)
    if options.only is not None:
        configurations = tuple(_named(configurations, name) for name in options.only.split(","))
    settings = _settings(options, RunSettings)
    if not options.no_pictures:
        from eitskin.view.pictures import load_matplotlib

        load_matplotlib()
    front = run(configurations, settings, options.output, named_bar)
    write_bytes(options.output / "front.json", to_json(as_dict(front)).encode())
    recorded = kept_cells(front)
    if options.recorded is not None:
        write_bytes(options.recorded, to_json(as_dict(recorded)).encode())
    if options.front is not None:
        write_bytes(options.front, to_json(in_short(recorded)).encode())
    write_bytes(options.output / "table.csv", to_csv(front).encode())
    if not options.no_pictures:
        from eitskin_studies.pictures.tradeoff_pictures import draw_all

        draw_all(options.output, front)
    if options.page is not None:
        from eitskin_studies.pictures.tradeoff_pictures import DRAWN
        from eitskin_studies.tradeoff.page import fill_page

        fill_page(options.page, recorded, options.output, tuple(DRAWN))
    print(to_json(as_dict(front)) if options.json else to_text(front, Conditions()))
    return 0


def _settings(options: argparse.Namespace, kind: Any) -> Any:
    if options.seed < 0:
        raise UsageError(f"--seed {options.seed} must be 0 or above")
    for name, value, low, high in (
        ("--elements", options.elements, 200, 200_000),
        ("--counted", options.counted, 0, 10_000),
        ("--rounds", options.rounds, 0, 100_000),
        ("--random-skins", options.random_skins, 0, 100_000),
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
        random_skins=options.random_skins,
        peers=not options.no_peers,
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
