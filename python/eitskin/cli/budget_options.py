"""``--preset``, ``--budget`` and ``--accuracy``."""

import argparse
from typing import Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError
from eitskin.tuning.front import Conditions, Target, check_wish, preset, read_budget

WISHES = ("preset", "budget", "accuracy")
EXCLUDED = ("solver", "iterations", "gap", "mac_limit", "macs")
SCAN = ("samples", "full", "reciprocal")  # a preset chooses them, too


def add_wish(parser: Any) -> None:
    option(
        parser,
        "--preset",
        "settings by name: the soonest report with an MIoU of .84; the most accurate with a report"
        " within 45 ms of contact; the most accurate",
        choices=("fast", "balanced", "accurate"),
    )
    option(parser, "--budget COST", "of solve and touches: 10ms, 800us, 600kMACs, 2.5Minstructions")
    option(parser, "--accuracy MIOU", "at least: of images of 1 to 3 random touches, 60 dB", float)


def named_target(options: argparse.Namespace, board: str) -> Target | None:
    """What they ask for where any is given; else None."""
    given = [name for name in WISHES if getattr(options, name) is not None]
    if not given:
        return None
    excluded = (*EXCLUDED, *SCAN) if options.preset is not None else EXCLUDED
    for name in excluded:
        if getattr(options, name, None) not in (None, False):
            raise UsageError(
                f"--{name.replace('_', '-')} is chosen by --{given[0]}; leave one or the other out"
            )
    return read_target(options, board)


def read_target(
    options: argparse.Namespace,
    board: str,
    where: Conditions | None = None,
    period: str | None = None,
) -> Target:
    """What ``--preset``, or ``--budget`` and ``--accuracy``, ask for."""
    if options.preset is not None:
        if options.budget is not None or options.accuracy is not None or period is not None:
            raise UsageError(
                "--preset is a budget or an accuracy by name; leave --budget, --accuracy and"
                " --period out"
            )
        return preset(options.preset, board, where)
    budget = None if options.budget is None else read_budget(options.budget)
    frame = None if period is None else read_budget(period)
    if frame is not None and frame.unit != "us":
        raise UsageError(f"--period {period}: give a time, such as 12ms")
    period_us, worst = None if frame is None else frame.value, getattr(options, "worst", False)
    place = where or Conditions()
    return check_wish(Target(budget, options.accuracy, board, place, period_us, worst))
