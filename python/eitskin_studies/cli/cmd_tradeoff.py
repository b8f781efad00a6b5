"""``eitskin tradeoff run``: what accuracy costs in time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from eitskin.errors import UsageError


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
        "--recorded", type=Path, metavar="FRONT.json", help="also write what the page shows"
    )
    run.add_argument(
        "--page", type=Path, metavar="PAGE.md", help="also put tables and pictures into this page"
    )
    run.add_argument("--no-pictures", action="store_true", help="tables only")
    run.add_argument("--json", action="store_true", help="print the results as JSON")
    run.set_defaults(run=run_run)


def run_run(options: argparse.Namespace) -> int:
    """Measure, and write tables and pictures."""
    from eitskin.fileio import refuse_unwritable, write_bytes
    from eitskin.tuning.front import Where
    from eitskin_studies.cli.cmd_compare import progress
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
    front = run(configurations, settings, options.output, progress)
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
        from eitskin_studies.pictures.tradeoff_pictures import PICTURES
        from eitskin_studies.tradeoff.page import fill_page

        fill_page(options.page, recorded, options.output, PICTURES)
    print(to_json(as_dict(front)) if options.json else to_text(front, Where()))
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
