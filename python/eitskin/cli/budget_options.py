"""``--budget`` and ``--accuracy``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from eitskin.cli.arguments import option
from eitskin.errors import UsageError

if TYPE_CHECKING:
    from eitskin.tuning.front import Conditions, Target

EXCLUDED = ("solver", "iterations", "gap", "mac_limit", "macs")


def add_wish(parser: Any) -> None:
    """Add both."""
    option(parser, "--budget COST", "of solve and touches: 10ms, 800us, 600kMACs, 2.5Minstructions")
    option(parser, "--accuracy MIOU", "at least: of images of 1 to 3 random touches, 60 dB", float)


def named_target(options: argparse.Namespace, board: str) -> Target | None:
    """What they ask for where one is given; else None.

    Raises:
        UsageError: what cannot be, or a setting that they choose is given too.
    """
    if options.budget is None and options.accuracy is None:
        return None
    for name in EXCLUDED:
        if getattr(options, name, None) is not None:
            raise UsageError(
                f"--{name.replace('_', '-')} is chosen by --budget and --accuracy; leave one or the"
                " other out"
            )
    return read_target(options, board)


def read_target(
    options: argparse.Namespace,
    board: str,
    where: Conditions | None = None,
    period: str | None = None,
) -> Target:
    """What ``--budget`` and ``--accuracy`` ask for.

    Raises:
        UsageError: nothing, or what cannot be.
    """
    from eitskin.tuning.front import Conditions as Place
    from eitskin.tuning.front import Target, check_wish, read_budget

    budget = None if options.budget is None else read_budget(options.budget)
    frame = None if period is None else read_budget(period)
    if frame is not None and frame.unit != "us":
        raise UsageError(f"--period {period}: give a time, such as 12ms")
    period_us, worst = None if frame is None else frame.value, getattr(options, "worst", False)
    target = Target(budget, options.accuracy, board, where or Place(), period_us, worst)
    return check_wish(target)
