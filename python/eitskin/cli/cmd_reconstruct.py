"""``eitskin reconstruct FRAMES``: images and touches of recorded frames."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from eitskin.cli.budget_options import add_wish, named_wish
from eitskin.cli.device_options import add_solver, named_solver
from eitskin.cli.progress import bar
from eitskin.errors import FrameError, UsageError


def add_parser(subparsers: Any) -> None:
    """Add ``reconstruct``."""
    parser = subparsers.add_parser(
        "reconstruct",
        help="touches and images of the frames in a file",
        description=(
            "Turn frames into touches in millimetres and images. Where the frames carry the truth,"
            " the touches are compared with it."
        ),
    )
    parser.add_argument(
        "frames", type=Path, metavar="FRAMES.npz", help="a frames file (eitskin import makes one)"
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="MODEL.eitm",
        help="default: the prebuilt model of the paper's skin",
    )
    parser.add_argument(
        "--engine",
        choices=("c", "c64", "numpy"),
        default="c",
        help="default: c, float32 as on a board",
    )
    parser.add_argument(
        "--sign",
        choices=("increase", "decrease", "both"),
        default="increase",
        help="which changes to look for",
    )
    parser.add_argument("--only", metavar="NAME,...", help="frames with these names only")
    add_solver(parser)
    add_wish(parser)
    parser.add_argument(
        "--warm", action="store_true", help="start each frame from the last one's result"
    )
    parser.add_argument(
        "--refine",
        action="store_true",
        help="solve again with what touches do to each other taken out of the data",
    )
    parser.add_argument(
        "--track",
        action="store_true",
        help=(
            "the frames are a stream, 48 or 96 a second: confirm births, keep ids, smooth places,"
            " as a board does"
        ),
    )
    parser.add_argument(
        "--threads",
        type=int,
        default=1,
        metavar="N",
        help="frames side by side, the same results (default: 1; not with --warm or --track)",
    )
    parser.add_argument(
        "--saturation-v", type=float, metavar="V", help="leave channels at or beyond +-V out"
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT.npz", help="write images, touches and solver info"
    )
    parser.add_argument(
        "--picture", type=Path, metavar="PNG", help="draw all frames, with the truth where known"
    )
    parser.add_argument("--json", action="store_true")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct all frames; those that cannot be used are named, and the others are still done
    and written."""
    from eitskin.reconstruct import Settings, reconstruct_frames, to_json, to_text

    changes: dict[str, Any] = {"sign": options.sign, "warm_start": options.warm}
    if options.refine:
        changes["refine"] = True
    if options.saturation_v is not None:
        if not options.saturation_v > 0:
            raise UsageError(f"--saturation-v {options.saturation_v:g} must be above 0")
        changes["saturation_v"] = options.saturation_v
    settings = Settings(
        model=options.model,
        engine=options.engine,
        changes=changes | named_solver(options),
        wish=named_wish(options, "host"),
        track=options.track,
        threads=options.threads,
        only=None if options.only is None else tuple(options.only.split(",")),
    )
    outcome = reconstruct_frames(
        options.frames,
        settings,
        output=options.output,
        picture=options.picture,
        progress=bar("frames"),
    )
    for note in outcome.notes:
        print(f"eitskin: {note}", file=sys.stderr)
    print(json.dumps(to_json(outcome), indent=2) if options.json else to_text(outcome))
    for number, reason in outcome.refused.items():
        print(
            f"eitskin: {options.frames}: frame {number} ({outcome.frames.frame_name[number]})"
            f" refused: {reason}",
            file=sys.stderr,
        )
    return FrameError.exit_code if outcome.refused else 0
