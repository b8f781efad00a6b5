"""``eitskin bench``: counts of correct diagnostics, gestures and touches in other worlds, and
touches compared with their bound."""

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin_studies.cli.bench_shared import add_page_option, check_within, progress_bar, show


def add_diagnostics(what: Any) -> None:
    """``bench diagnostics``."""
    parser = what.add_parser(
        "diagnostics",
        help="count how often faults are named rightly, and what they cost the image",
        description=(
            "Spoil frames of random scenes in every way that docs/reference/diagnostics.md names,"
            " count how often the fault is named in that very frame, and compare the image with"
            " that of the same frame without the fault. It takes some five minutes."
        ),
    )
    option(parser, "--scenes", "scenes, each with every fault", default=640)
    option(parser, "--crowds", "scenes for each number of touches", default=24)
    option(parser, "--imperfect", "scenes for each front end", default=40)
    option(parser, "--seed", "seed of scenes and noise", default=4001)
    add_page_option(parser, "diagnostics")
    parser.set_defaults(run=run_diagnostics)


def run_diagnostics(options: argparse.Namespace) -> int:
    """Count how often faults are named, and measure their cost."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import diagnostics as bench_diagnostics
    from eitskin_studies.benchmarks import diagnostics_page as bench_diagnostics_page

    check_within("--scenes", options.scenes, 2, 100_000)
    check_within("--crowds", options.crowds, 2, 10_000)
    check_within("--imperfect", options.imperfect, 1, 10_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    refuse_unwritable(options.page)
    result = bench_diagnostics.run(
        options.seed, options.scenes, options.crowds, options.imperfect, progress=progress_bar
    )
    sizes = f"--scenes {options.scenes} --crowds {options.crowds} --imperfect {options.imperfect}"
    command = f"eitskin bench diagnostics {sizes} --seed {options.seed}"
    filling = bench_diagnostics_page.for_page(result, command)
    text = bench_diagnostics_page.as_text(result)
    return show(options, result, text, filling, "diagnostics")


def add_gestures(what: Any) -> None:
    """``bench gestures``."""
    parser = what.add_parser(
        "gestures",
        help="count the gestures of simulated fingers that are reported rightly, and how late",
        description=(
            "Draw sessions of taps, holds, swipes, pinches, spreads, turns, drags and presses,"
            " simulate a board that scans meanwhile, and score what the C core reports."
        ),
    )
    option(parser, "--sessions", "sessions of 27 gestures each", default=60)
    option(parser, "--seed", "seed of all that is random", default=7001)
    option(
        parser,
        "--role",
        "which sessions: to choose by, or to judge by",
        choices=("tuning", "judging"),
        default="judging",
    )
    option(parser, "--snr-db DB", None, float, nargs="+", default=[60.0, 40.0])
    option(parser, "--cache DIR", "folder that keeps the simulated frames", Path)
    add_page_option(parser, "gestures")
    parser.set_defaults(run=run_gestures)


def run_gestures(options: argparse.Namespace) -> int:
    """Judge gestures."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.gestures import bench as bench_gestures

    check_within("--sessions", options.sessions, 1, 10_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    for snr_db in options.snr_db:
        if not 0 <= snr_db <= 200:
            raise UsageError(f"bench: --snr-db {snr_db:g} is out of range; use 0 to 200")
    refuse_unwritable(options.page)
    how = bench_gestures.Settings(
        options.sessions, options.seed, options.role, tuple(options.snr_db), options.cache
    )
    result = bench_gestures.run(how, progress_bar)
    command = (
        f"eitskin bench gestures --sessions {options.sessions} --seed {options.seed} --role"
        f" {options.role} --snr-db {' '.join(f'{snr:g}' for snr in options.snr_db)}"
    )
    filling = bench_gestures.for_page(result, command)
    return show(options, result, bench_gestures.as_text(result), filling, "gestures")


def add_worlds(what: Any) -> None:
    """``bench worlds``."""
    parser = what.add_parser(
        "worlds",
        help="count touches on skins that differ from the model",
        description=(
            "Simulate sets of scenes on another mesh, with touches, skins, electrodes and drifts"
            " that the model does not describe, and count the touches that the C core finds."
        ),
    )
    option(parser, "--scenes", "scenes of each set", default=100)
    option(parser, "--seed", "seed of all that is random", default=1)
    option(
        parser,
        "--family",
        "which scenes: to choose by, or to judge by",
        choices=("tuning", "judging"),
        default="tuning",
    )
    option(
        parser, "--sets NAME,...", "these alone; no_touch* names all that begin so (default: all)"
    )
    option(parser, "--snr-db DB", "SNR, in place of each set's own", float)
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(parser, "--option NAME=VALUE", "an option of the core; may be repeated", action="append")
    option(parser, "--cache DIR", "folder that keeps the simulated frames", Path)
    option(parser, "--list", "list the sets, and end")
    option(parser, "--json")
    parser.set_defaults(run=run_worlds)


def run_worlds(options: argparse.Namespace) -> int:
    """Count touches in other worlds."""
    from eitskin.cli.progress import named_bar
    from eitskin_studies.benchmarks import worlds as bench_worlds
    from eitskin_studies.worlds.score import as_text

    if options.list:
        print(bench_worlds.listed())
        return 0
    check_within("--scenes", options.scenes, 1, 100_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    scores = bench_worlds.run(
        bench_worlds.Settings(
            options.scenes,
            options.seed,
            options.family,
            bench_worlds.chosen_sets(options.sets),
            options.snr_db,
            options.model,
            tuple(options.option or ()),
            options.cache,
        ),
        named_bar,
    )
    text = as_text(scores)
    print(json.dumps([one.as_dict() for one in scores], indent=2) if options.json else text)
    return 0


def add_columns(what: Any) -> None:
    """``bench columns``."""
    parser = what.add_parser(
        "columns",
        help="count touches and their cost with other limits of the touch test's columns",
        description=(
            "Find the touches of scenes that differ from the model with three values of the option"
            " test_columns, and count those that are right, and the multiply-accumulates."
        ),
    )
    option(parser, "--scenes", "scenes of each set", default=100)
    option(parser, "--seed", "seed of all that is random", default=1)
    option(parser, "--cache DIR", "folder that keeps the simulated frames", Path)
    add_page_option(parser, "board-cost")
    parser.set_defaults(run=run_columns)


def run_columns(options: argparse.Namespace) -> int:
    """Count touches with other limits of columns."""
    from eitskin.cli.progress import named_bar
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import worlds as bench_worlds

    check_within("--scenes", options.scenes, 1, 100_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    refuse_unwritable(options.page)
    settings = bench_worlds.Settings(
        options.scenes, options.seed, "judging", bench_worlds.LIMITED_SETS, cache=options.cache
    )
    result = bench_worlds.run_limits(settings, named_bar)
    command = f"eitskin bench columns --scenes {options.scenes} --seed {options.seed}"
    filling = bench_worlds.limits_for_page(result, command)
    return show(options, result, bench_worlds.limits_text(result), filling, "board-cost")


def add_limit(what: Any) -> None:
    """``bench limit``."""
    parser = what.add_parser(
        "limit",
        help="compare the errors of touches with the Cramer-Rao bound",
        description=(
            "Print the Cramer-Rao bound of a touch's place, the error of the C core and their"
            " ratio, by place, contrast, SNR, kind of touch and drive pattern. Frames are exact."
            " Building a model for another pattern takes some minutes."
        ),
    )
    option(parser, "--scenes", "scenes of each set", default=100)
    option(parser, "--seed", "seed of all that is random", default=1)
    option(parser, "--sets NAME,...", "these sets alone (default: all)")
    option(parser, "--patterns NAME,...", "these drive patterns alone (default: all)")
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(
        parser, "--cache DIR", "folder that keeps exact frames, and models of other patterns", Path
    )
    add_page_option(parser, "limit")
    parser.set_defaults(run=run_limit)


def run_limit(options: argparse.Namespace) -> int:
    """Measure touches beside their bound."""
    from eitskin.cli.progress import named_bar
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import limit as bench_limit
    from eitskin_studies.benchmarks import limit_page
    from eitskin_studies.harness.drawings import draw_again, keep_drawings
    from eitskin_studies.pictures.limit_picture import limit_drawing

    check_within("--scenes", options.scenes, 1, 100_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    refuse_unwritable(options.page)
    chosen: dict[str, Any] = {
        name: tuple(names.split(","))
        for name in ("sets", "patterns")
        if (names := getattr(options, name)) is not None
    }
    settings = bench_limit.Settings(
        options.scenes, options.seed, model=options.model, cache=options.cache, **chosen
    )
    result = bench_limit.run(settings, named_bar)
    if options.page is not None:
        keep_drawings(options.page, {"pictures/limit.svg": limit_drawing(result)})
        draw_again(options.page)
    command = f"eitskin bench limit --scenes {options.scenes} --seed {options.seed}"
    for name in ("sets", "patterns", "model"):
        if getattr(options, name) is not None:
            command += f" --{name} {getattr(options, name)}"
    filling = limit_page.for_page(result, command)
    return show(options, result, limit_page.as_text(result), filling, "limit")


def add_peers(what: Any) -> None:
    """``bench peers``."""
    parser = what.add_parser(
        "peers",
        help="see what numpy, scikit-learn, pyEIT and the core do with spoilt frames",
        description=(
            "Spoil the frames of random scenes in eleven ways, and say what each program answers:"
            " the right image, a worse one, a name for the fault, NaN or an error."
        ),
    )
    option(parser, "--scenes", "scenes, each with every fault", default=20)
    option(parser, "--seed", "seed of scenes and noise", default=1)
    add_page_option(parser, "peers")
    parser.set_defaults(run=run_peers)


def run_peers(options: argparse.Namespace) -> int:
    """Let other programs and the core meet spoilt frames."""
    from eitskin.fileio import refuse_unwritable
    from eitskin_studies.benchmarks import peers

    check_within("--scenes", options.scenes, 1, 10_000)
    check_within("--seed", options.seed, 0, 2**31 - 1)
    refuse_unwritable(options.page)
    result = peers.run(options.scenes, options.seed, progress_bar)
    command = f"eitskin bench peers --scenes {options.scenes} --seed {options.seed}"
    filling = peers.for_page(result, f"{command} --page studies/results/peers.md")
    return show(options, result, peers.as_text(result), filling, "peers")
