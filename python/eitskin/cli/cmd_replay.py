"""``eitskin replay``: show a recording as it was streamed, export its frames, or compare its images
with this host's core."""

import argparse
from pathlib import Path

from eitskin.cli.arguments import Output, option
from eitskin.cli.device_options import add_verbose, add_zones, read_mode, read_zones
from eitskin.cli.live_output import check_drawn, show
from eitskin.cli.printing import answer, say
from eitskin.errors import FrameError, UsageError, VerificationError
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import save_frames
from eitskin.robot.recorded import FILE
from eitskin.session.checks.host_check import check_recording
from eitskin.session.checks.raw_frames import finite_only, frames_of
from eitskin.session.robot_session import open_session
from eitskin.session.settings import SessionSettings
from eitskin.truth import observe_scene


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Show a recording as  eitskin stream  showed it; write its raw frames to a frames file; or"
        " solve them with this host's core, and compare every bit of images and touches with what"
        " the board sent."
    )
    option(parser, "recording RUN.eits", "a recording, or the folder of a robot's", Path)
    option(
        parser, "--mode KIND[,KIND]", "raw, image, touches, events, or several (default: touches)"
    )
    option(parser, "--first N", "show only the first N frames", within=(1, 2**32 - 1))
    add_zones(parser)
    option(parser, "--model MODEL.eitm", "the board's model if it is not the prebuilt one", Path)
    option(parser, "--picture FILE", "draw a panel per frame (PNG, SVG, PDF)", Output)
    option(parser, "--film FILE", "show the frames one after another (WebP, GIF)", Output)
    option(parser, "--frames OUT.npz", "write the raw frames for  reconstruct  and  doctor", Output)
    option(parser, "--check", "solve again here and compare; exit code 10 if bits differ")
    add_verbose(parser)
    option(parser, "--json", "print for programs")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.picture, options.frames)
    if options.check or options.frames is not None:
        if options.recording.is_dir():
            raise UsageError(
                f"{options.recording}: holds the recordings of a robot; --check and --frames take"
                " one of its files"
            )
        shown = (options.mode, options.picture, options.film, options.first)
        if any(one is not None for one in shown):
            raise UsageError(
                "replay: --mode, --picture, --film and --first show a recording, while --check and"
                " --frames do not; leave out one kind"
            )
        if options.frames is not None:
            _export(options)
        if options.check:
            _check(options)
        return 0
    _show(options)
    return 0


def _show(options: argparse.Namespace) -> None:
    mode = read_mode(options.mode or "touches")
    recording = _url(options.recording)
    check_drawn(options, mode, recording)
    settings = SessionSettings(
        mode=mode,
        frames=options.first or 0,
        model=options.model,
        model_for="a picture" if options.picture or options.film else "",
        zones=read_zones(options.zones),
    )
    with open_session(recording, settings, say=say, observe=observe_scene) as session:
        show(options, session)


def _url(recording: Path) -> str:
    """The URL of a recording, or of a robot's, which is a folder."""
    return f"robot:{recording / FILE}" if recording.is_dir() else f"file:{recording}"


def _export(options: argparse.Namespace) -> None:
    frames = frames_of(options.recording, options.model)
    kept, left_out = finite_only(frames, str(options.recording))
    save_frames(options.frames, kept)
    untouched = len(kept.reference_voltage_v)
    facts = {"recording": str(options.recording), "frames_file": str(options.frames)}
    counts = {"frames": kept.n_frames, "quiet_frames": untouched, "left_out": left_out}
    more = f"; {left_out} with rows that could not be measured left out" if left_out else ""
    text = f"{options.frames}: {kept.n_frames} frames, {untouched} untouched{more}"
    answer(options, facts | counts, text)


def _check(options: argparse.Namespace) -> None:
    check, noted = check_recording(options.recording, options.model)
    if not check.compared:
        raise FrameError(
            f"{options.recording}: nothing to compare: the recording must hold raw frames, and"
            " images or touches, from the tare on; make it with  eitskin record , or in Python with"
            '  stream(..., mode="raw,touches", record=...)'
        )
    facts = {"recording": str(options.recording), "solver_noted": noted}
    answer(options, facts | check.as_dict(), check.text())
    if check.different:
        why = "; the recording does not hold the solver's options, so the model's own were used"
        raise VerificationError(
            f"{options.recording}: this host's images differ from the board's{'' if noted else why}"
        )
