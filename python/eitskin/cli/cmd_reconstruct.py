"""``eitskin reconstruct FRAMES``: reconstruct images and touches from recorded frames."""

import argparse
import json
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.cli.device_options import add_solver, named_solver
from eitskin.cli.preset_option import add_preset, read_preset
from eitskin.cli.printing import say
from eitskin.cli.progress import bar
from eitskin.errors import FrameError, UsageError
from eitskin.reconstruct.report import to_json, to_text
from eitskin.reconstruct.steps import ReconstructSettings, reconstruct_frames


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Turn frames into touches in millimetres and images. If the frames hold the truth, the"
        " touches are compared with it."
    )
    option(parser, "frames FRAMES.npz", "a frames file (eitskin import makes one)", Path)
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(
        parser,
        "--engine",
        "the C core in float32 as on a board, or in float64, or the oracle in numpy",
        choices=("c", "c64", "numpy"),
        default="c",
    )
    option(
        parser,
        "--sign",
        "which conductivity changes to look for",
        choices=("increase", "decrease", "both"),
        default="increase",
    )
    option(parser, "--only NAME,...", "reconstruct only frames with these names")
    add_solver(parser)
    add_preset(parser)
    option(parser, "--warm", "start each frame from the last one's result")
    option(
        parser,
        "--second-pass",
        "solve again after the interaction of touches is removed from the data",
    )
    option(
        parser,
        "--threads N",
        "solve N frames in parallel, each by itself: touches of frames with times are then not"
        " followed; not with --warm",
        default=1,
    )
    option(parser, "--saturation-v V", "leave out rows at or beyond +-V", float)
    option(parser, "-o --output OUT.npz", "write images, touches and solver info", Output)
    option(parser, "--picture FILE", "draw all frames, with known truth (PNG, SVG, PDF)", Output)
    option(parser, "--film FILE", "show the frames one after another (WebP, GIF)", Output)
    option(parser, "--json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct all frames. Frames that cannot be used are named, and the others are still
    reconstructed and written."""
    changes: dict[str, Any] = {"sign": options.sign, "warm_start": options.warm}
    if options.second_pass:
        changes["second_pass"] = True
    if options.saturation_v is not None:
        if not options.saturation_v > 0:
            raise UsageError(f"--saturation-v {options.saturation_v:g} must be above 0")
        changes["saturation_v"] = options.saturation_v
    settings = ReconstructSettings(
        model=options.model,
        engine=options.engine,
        changes=changes | named_solver(options),
        preset=read_preset(options, "host"),
        threads=options.threads,
        only=None if options.only is None else tuple(options.only.split(",")),
    )
    outcome = reconstruct_frames(
        options.frames,
        settings,
        output=options.output,
        picture=options.picture,
        film=options.film,
        progress=bar("frames"),
    )
    for note in outcome.notes:
        say(note)
    print(json.dumps(to_json(outcome), indent=2) if options.json else to_text(outcome))
    for number, reason in outcome.refused.items():
        name = outcome.frames.frame_name[number]
        say(f"{options.frames}: frame {number} ({name}) refused: {reason}")
    return FrameError.exit_code if outcome.refused else 0
