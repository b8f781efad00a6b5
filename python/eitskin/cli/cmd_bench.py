"""``eitskin bench frame | jacobian``: speed, side by side in one run."""

from __future__ import annotations

import argparse
import json
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
    jacobian = what.add_parser("jacobian", help="building: Jacobian beside pyEIT's, and the whole model")
    jacobian.add_argument("--json", action="store_true")
    jacobian.set_defaults(run=run_jacobian)


def run_frame(options: argparse.Namespace) -> int:
    """Time a frame."""
    from eitskin.study import bench_frame

    if not 100 <= options.runs <= 10_000_000:
        raise UsageError(f"bench frame: --runs {options.runs} is out of range; use 100 to 10000000")
    times = bench_frame.run(options.runs)
    print(json.dumps(times.as_dict(), indent=2) if options.json else bench_frame.to_text(times))
    return 0


def run_jacobian(options: argparse.Namespace) -> int:
    """Time the Jacobian beside pyEIT's."""
    from eitskin.study import bench_jacobian

    times = bench_jacobian.run()
    print(json.dumps(times, indent=2) if options.json else bench_jacobian.text(times))
    return 0
