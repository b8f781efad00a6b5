"""``eitskin bench WHAT``: speed, side by side in one run: frames, solvers, building, scenes,
boards, their time, energy, kernels, growth, batches; the value of diagnostics, gestures, and
touches beside their bound."""

from typing import Any

from eitskin_studies.cli import bench_boards, bench_counts, bench_frames, bench_making


def add_parser(subparsers: Any) -> None:
    """Add ``bench`` and its own subcommands."""
    parser = subparsers.add_parser("bench", help="measure speed, side by side in one run")
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    bench_frames.add_frame(what)
    bench_frames.add_solve(what)
    bench_making.add_jacobian(what)
    bench_boards.add_board(what)
    bench_boards.add_time(what)
    bench_boards.add_energy(what)
    bench_frames.add_kernels(what)
    bench_frames.add_growth(what)
    bench_boards.add_view(what)
    bench_frames.add_batches(what)
    bench_counts.add_diagnostics(what)
    bench_making.add_effects(what)
    bench_making.add_scenes(what)
    bench_boards.add_outputs(what)
    bench_boards.add_latency(what)
    bench_counts.add_gestures(what)
    bench_counts.add_worlds(what)
    bench_counts.add_columns(what)
    bench_counts.add_limit(what)
    bench_counts.add_peers(what)
