"""``eitskin demo``: three simulated touches, found by the C core, beside the truth."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.errors import UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``demo``."""
    parser = subparsers.add_parser(
        "demo",
        help="three simulated touches, reconstructed in C, beside the truth",
        description="Simulate three touches on the paper's skin (nonlinear forward model on another, finer mesh, noise), "
        "reconstruct them with the C core and the prebuilt model, and draw them.",
    )
    parser.add_argument("--snr-db", type=float, default=60.0, metavar="DB", help="20 log10(rms(V0)/sigma) (default: %(default)g)")
    parser.add_argument("--seed", type=int, default=1, help="of noise and contacts (default: %(default)s)")
    parser.add_argument("--picture", type=Path, default=Path("demo.png"), metavar="PNG", help="default: %(default)s")
    parser.add_argument("--frames", type=Path, metavar="NPZ", help="also write the simulated frames, with their truth")
    parser.add_argument("--json", action="store_true")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Simulate, reconstruct, print, draw."""
    from eitskin.fileio import refuse_unwritable
    from eitskin.frames.frames import save_frames
    from eitskin.study.demo import run_demo, to_json, to_text
    from eitskin.view.demo_picture import draw_demo
    from eitskin.view.pictures import load_matplotlib

    refuse_unwritable(options.picture, options.frames)
    if not -20 <= options.snr_db <= 200 or options.seed < 0:
        raise UsageError("demo: --snr-db must be -20 to 200 and --seed at least 0")
    load_matplotlib()
    demo = run_demo(options.seed, options.snr_db)
    if options.frames is not None:
        save_frames(options.frames, demo.frames)
    draw_demo(options.picture, demo)
    if options.json:
        print(json.dumps({**to_json(demo), "picture": str(options.picture)}, indent=2))
    else:
        print(f"{to_text(demo)}\npicture: {options.picture}")
    return 0
