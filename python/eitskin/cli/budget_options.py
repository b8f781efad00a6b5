"""``--budget`` and ``--accuracy`` where a model is given already: the solver's settings of a
measured point that it can take."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from eitskin.errors import UsageError

if TYPE_CHECKING:
    from eitskin.core.results import Options
    from eitskin.model.model import Model
    from eitskin.tuning.configuration import Configuration
    from eitskin.tuning.front import Point, Where

EXCLUDED = ("solver", "iterations", "gap", "mac_limit", "macs")


def add_wish(parser: Any) -> None:
    """Add both."""
    parser.add_argument(
        "--budget",
        metavar="COST",
        help="of solve and touches: 10ms, 800us, 600kMACs, 2.5Minstructions",
    )
    parser.add_argument(
        "--accuracy",
        type=float,
        metavar="MIOU",
        help="at least: of images of 1 to 3 random touches, 60 dB",
    )


def wished(options: argparse.Namespace) -> bool:
    """Whether either is given.

    Raises:
        UsageError: a setting that they choose is given too.
    """
    if options.budget is None and options.accuracy is None:
        return False
    for name in EXCLUDED:
        if getattr(options, name, None) is not None:
            raise UsageError(
                f"--{name.replace('_', '-')} is chosen by --budget and --accuracy; leave one or the"
                " other out"
            )
    return True


def read_wish(
    options: argparse.Namespace, board: str, where: Where | None = None, period: str | None = None
) -> Any:
    """What ``--budget`` and ``--accuracy`` ask for.

    Raises:
        UsageError: nothing, or what cannot be.
    """
    from eitskin.tuning.front import Where as Place
    from eitskin.tuning.front import Wish, check_wish, read_budget

    budget = None if options.budget is None else read_budget(options.budget)
    frame = None if period is None else read_budget(period)
    if frame is not None and frame.unit != "us":
        raise UsageError(f"--period {period}: give a time, such as 12ms")
    period_us, worst = None if frame is None else frame.value, getattr(options, "worst", False)
    wish = Wish(budget, options.accuracy, board, where or Place(), period_us, worst)
    return check_wish(wish)


def chosen_point(
    options: argparse.Namespace,
    model: Model,
    now: Options,
    board: str,
    settable: set[str] | None = None,
) -> Point:
    """The measured point whose settings ``model`` is to be solved with: of its rank, grid, storage
    and reduction, scanned fully with 80 samples, and with no other settings than ``now`` but those
    in ``settable`` (None: any).

    Raises:
        UsageError: there is none, or none that does what is asked for.
        FileError, ConfigError: there are no results.
    """
    from eitskin.tuning.configuration import Configuration
    from eitskin.tuning.front import choose, load_front

    wish = read_wish(options, board)
    usual = Configuration("")
    points = []
    for point in load_front().points:
        one = point.configuration
        other = {
            name
            for name, value in one.solver_settings.items()
            if not _same(value, getattr(now, name, None))
        }
        if (
            _is_of(one, point, model)
            and (one.samples, one.scan) == (usual.samples, usual.scan)
            and one.warm_start == now.warm_start
            and (settable is None or other <= settable)
        ):
            points.append(point)
    if not points:
        raise UsageError(
            f"--budget and --accuracy: no measured point has this model's rank {model.rank},"
            f" {model.grid.n_pixels} pixels in"
            f" {model.stored.storage}{' and starts warm' if now.warm_start else ''}; make a model"
            " of one by  eitskin recommend -o MODEL.eitm"
        )
    return choose(points, wish, "measured point of this model")


def _same(value: Any, other: Any) -> bool:
    """Equal, a number to what a float32 keeps of it."""
    if isinstance(value, float) and isinstance(other, float):
        return abs(value - other) <= 1e-6 * abs(value)
    return bool(value == other)


def _is_of(one: Configuration, point: Point, model: Model) -> bool:
    """Whether a point was measured with such a model."""
    build = model.meta.get("build", {})
    if build.get("pixels_across", one.pixels) != one.pixels:
        return False
    if "pixels_across" not in build and model.grid.n_pixels != point.costs["pixels_kept"]:
        return False
    reduction = (("floor", one.floor), ("column_power", one.column_power))
    if not all(_same(build.get(name, value), value) for name, value in reduction):
        return False
    return (one.rank, one.storage, "difference") == (
        model.rank,
        model.stored.storage,
        model.data_kind,
    )


def settings_text(point: Point, board: str) -> str:
    """What was chosen, in a line."""
    from eitskin.tuning.front import Where

    one = point.configuration
    score, typical, most = (
        point.accuracy(Where()),
        point.cost("us", board, Where()),
        point.cost("us", board, Where(), True),
    )
    text = (
        f"settings of {point.name!r}: {one.solver}, {one.iterations} iterations at most, lambda_rel"
        f" {one.lambda_rel:g}"
    )
    text += f", gap {one.gap:g}" if one.gap else ""
    text += f", at most {one.mac_limit} MACs" if one.mac_limit else ""
    if score is not None:
        text += f"; measured: image MIoU {score:.3f}"
    if typical is not None and most is not None:
        where = "on the F767 (an estimate)" if board == "f767" else "on the host that measured"
        text += f", {typical / 1000:.3g} ms a frame, at most {most / 1000:.3g}, {where}"
    return text
