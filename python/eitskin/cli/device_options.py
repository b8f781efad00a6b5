"""The options that commands for boards share, and their conversion to settings."""

import argparse
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import above, option
from eitskin.cli.preset_option import add_preset, read_preset
from eitskin.cli.printing import say
from eitskin.config import nearest
from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS, DIAGNOSTICS
from eitskin.core.gestures import Zone
from eitskin.core.options_table import SOLVERS
from eitskin.device.client import TARE_FRAMES, Device, check_tare_frames
from eitskin.device.open import open_with_files
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.timing import check_name
from eitskin.device.wire.link_table import Stream
from eitskin.errors import FileError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.robot.description import is_robot
from eitskin.robot.recorded import check_folder
from eitskin.session.robot_session import AnySession
from eitskin.session.settings import SessionSettings, kinds_of
from eitskin.session.zones import load_zones
from eitskin.sinks.outputs import Outputs, attached_outputs

DEVICE_HELP = (
    "auto (the only board that is plugged in), serial:/dev/ttyACM0, text:PORT?layout=FILE (lines of"
    " another instrument), sim:SCENE (simulated), emu:SCENE (the firmware on an emulated board),"
    " file:RUN.eits (a recording), robot:FILE (all skins of a robot, docs/guide/robot.md). SCENE is"
    " a file or a scene of  eitskin scene list. The last four can end in ?speed=1&loop=1"
)
MAX_U32 = 2**32 - 1


def add_device(parser: argparse.ArgumentParser, *, model: bool = True, json: bool = True) -> None:
    """Add ``--device``; with ``json`` also ``--json``; with ``model`` also ``--model`` and
    ``--firmware``."""
    option(parser, "--device URL", DEVICE_HELP, default="auto")
    if model:
        option(
            parser,
            "--model MODEL.eitm",
            "the board's model if it is not the prebuilt one; a simulated or emulated board gets"
            " this model",
            Path,
        )
        option(parser, "--firmware BIN", "firmware of an emulated board (default: prebuilt)", Path)
    if json:
        option(parser, "--json", "print for programs")


def add_scan(parser: argparse.ArgumentParser) -> None:
    """Add the options of the scan, the solver and the reference."""
    scan = parser.add_argument_group("scan; settings that are not given stay as they are")
    option(scan, "--excitation-hz HZ", "excitation frequency", float, within=(1, 250_000))
    option(scan, "--sample-rate-hz HZ", "sample rate of the converter", within=(1000, 5_000_000))
    samples = "samples per measurement, a whole number of periods"
    option(scan, "--samples N", samples, within=(4, 1024))
    settle = "time from switching the multiplexers to the first sample"
    option(scan, "--settle-us US", settle, within=(0, 0xFFFF))
    period = "time from frame to frame; 0: as fast as possible"
    option(scan, "--frame-period-us US", period, within=(0, MAX_U32))
    rows = scan.add_mutually_exclusive_group()
    option(rows, "--full", "measure every row of the protocol")
    option(
        rows,
        "--reciprocal N",
        "measure one row of each reciprocal pair, and all rows in every N-th frame as a check"
        " (0: never)",
        within=(0, 0xFFFF),
    )
    solver = parser.add_argument_group("solver")
    add_solver(solver)
    add_preset(solver)
    option(
        solver,
        "--sign",
        "which conductivity changes to look for (default: increase)",
        choices=("increase", "decrease", "both"),
    )
    option(
        solver,
        "--ignore NAME[,NAME]",
        "turn off diagnostics: saturated, electrode-open, electrodes-bridged, outlier,"
        " electrode-noisy, model-mismatch, stale-reference, crowded, unlike-the-model, or all"
        " (default: none)",
    )
    start = solver.add_mutually_exclusive_group()
    option(start, "--warm", "start each frame from the last one's result")
    option(start, "--cold", "start each frame from zero (default)")
    tare = parser.add_argument_group("reference")
    option(
        tare,
        "--tare N",
        "first take the reference from N frames of the untouched skin (1, or 4 to 1024); default:"
        f" from {TARE_FRAMES} if the board has no reference, and always on a simulated or emulated"
        " board",
        int,
    )


def add_solver(parser: Any) -> None:
    """Add the options that choose the solver and limit its work."""
    option(
        parser, "--solver", "default: the model's; all minimise the same objective", choices=SOLVERS
    )
    most = (
        "greatest number of iterations of FISTA, or rounds of the active set (default: the model's)"
    )
    option(parser, "--iterations N", most, within=(1, 1_000_000))
    gap = "stop once the duality gap is below this fraction of half the data's squared norm"
    option(parser, "--gap REL", gap, float, within=(above(0), 1))
    option(
        parser,
        "--mac-limit N",
        "return the best result so far before exceeding N multiply-accumulates",
        within=(1, MAX_U32),
    )


def named_solver(options: argparse.Namespace) -> dict[str, Any]:
    """Return the values of the options of ``add_solver``, by the names of
    ``core.results.Options``."""
    values = {
        "solver": options.solver,
        "iterations": options.iterations,
        "gap_rel": options.gap,
        "mac_limit": options.mac_limit,
    }
    return {name: value for name, value in values.items() if value is not None}


def add_stream(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the options that choose what is streamed, and how much of it."""
    option(parser, "--mode KIND[,KIND]", "raw, image, touches, events, or several", default=default)
    add_report(parser)
    add_every(parser)
    option(
        parser,
        "--frames N",
        "stop after N frames (default: at Ctrl-C, or at the end of the scene)",
        within=(1, MAX_U32),
    )


def add_every(parser: argparse.ArgumentParser) -> None:
    """Add ``--every``."""
    text = "send every N-th frame (default: as many as the link carries)"
    option(parser, "--every N", text, within=(1, 0xFFFF))


def add_report(parser: argparse.ArgumentParser) -> None:
    """Add ``--report`` and ``--confirmed``, which choose when touches are reported."""
    option(
        parser,
        "--report WHEN",
        "report touches after each frame, or also after each drive of a scan, with their velocity",
        choices=("frame", "drive"),
        default="frame",
    )
    parser.add_argument(
        "--confirmed",
        action="store_true",
        help="show only touches that a whole frame has confirmed, one to three frames after"
        " contact",
    )


def add_verbose(parser: argparse.ArgumentParser) -> None:
    """Add ``--verbose``."""
    option(parser, "-v --verbose", "print everything about a frame, including the solver's numbers")


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add ``--to``."""
    option(
        parser,
        "--to URL",
        "also send touches to URL; can be repeated: udp://HOST:PORT, ws://HOST:PORT (clients"
        " connect to it), osc://HOST:PORT, tuio://HOST, mqtt://HOST, lsl:, csv:FILE, mcap:FILE,"
        " ros2:, foxglove:, or a sink of another package (docs/guide/touches-out.md)",
        action="append",
    )


def add_name(parser: argparse.ArgumentParser) -> None:
    """Add ``--name``."""
    option(
        parser,
        "--name NAME",
        "name of this board, skin or source in messages, topics, frames and the TUIO source"
        " (default: name=NAME in the device's URL, else the name in the board's settings, else its"
        " serial number)",
    )


def named_outputs(
    options: argparse.Namespace, session: AnySession
) -> AbstractContextManager[Outputs]:
    """Return a context with the open sinks of ``--to``, attached to ``session``."""
    overwrite = getattr(options, "overwrite", False)
    return attached_outputs(session, options.to or (), overwrite=overwrite, say=say)


def add_zones(parser: argparse.ArgumentParser) -> None:
    """Add ``--zones``."""
    option(
        parser,
        "--zones FILE.toml",
        "report presses of the keys, pads and rings named in FILE",
        Path,
    )


def read_zones(path: Path | None) -> tuple[Zone, ...]:
    """Return the zones of ``--zones``."""
    return () if path is None else load_zones(path)


def read_mode(text: str) -> Stream:
    """Return the kinds in a text such as "raw,touches"."""
    return kinds_of(text, "--mode")


def read_scan(options: argparse.Namespace) -> ScanSettings:
    """Return the given settings of the scan."""
    if options.reciprocal == 1:
        raise UsageError(
            "--reciprocal 1 would check every frame, which is a full scan; use --full, or at least"
            " 2 (0: no checks)"
        )
    return ScanSettings(
        excitation_hz=options.excitation_hz,
        sample_rate_hz=options.sample_rate_hz,
        samples=options.samples,
        settle_us=options.settle_us,
        check_every=1 if options.full else options.reciprocal,
        frame_period_us=options.frame_period_us,
    )


def read_solver(options: argparse.Namespace) -> SolverSettings:
    """Return the given settings of the solver."""
    return SolverSettings(
        warm_start=True if options.warm else False if options.cold else None,
        sign=options.sign,
        diagnostics=read_ignored(options.ignore),
        **named_solver(options),
    )


def read_ignored(text: str | None) -> int | None:
    """Return the diagnostics that remain, bit k of ``core.diagnostics.DIAGNOSTICS``, without those
    in a text such as "outlier,electrode-noisy" or "all"; None for None."""
    if text is None:
        return None
    names = [name.replace(" ", "-") for name in DIAGNOSTICS]
    left: int = ALL_DIAGNOSTICS
    for name in text.split(","):
        if name != "all" and name not in names:
            raise UsageError(f"--ignore {text}: {nearest(name, (*names, 'all'))}")
        left = 0 if name == "all" else left & ~(1 << names.index(name))
    return left


def check_recording(path: Path | None, overwrite: bool) -> None:
    """Raise an error if the recording could not be written, before a device is opened."""
    refuse_unwritable(path)
    if path is not None and path.is_file() and not overwrite:
        raise FileError(
            f"{path}: exists already; name another file, or overwrite it with  --overwrite"
        )


def open_named(options: argparse.Namespace) -> Device:
    """Open the device of ``--device``, with ``--model`` and ``--firmware`` if the command has
    them."""
    files = (getattr(options, name, None) for name in ("model", "firmware"))
    return open_with_files(options.device, *files)


def session_settings(
    options: argparse.Namespace,
    mode: Stream | None,
    *,
    record: Path | None = None,
    model_for: str = "",
) -> SessionSettings:
    """Return the settings in the options of ``add_device``, ``add_stream`` and ``add_scan``,
    checked before a device is opened.

    Raises:
        UsageError: a number is out of range.
        FileError: the recording could not be written.
    """
    every = options.every or 0
    if options.report == "drive" and every > 1:
        raise UsageError(f"--report drive needs every frame; leave out --every {every}")
    robot = is_robot(options.device)
    if robot and record is not None:
        check_folder(record, options.overwrite)
    else:
        check_recording(record, options.overwrite)
    return SessionSettings(
        mode=mode,
        report=options.report,
        confirmed=options.confirmed,
        every=every,
        frames=options.frames or 0,
        model=options.model,
        firmware=options.firmware,
        model_for=model_for,
        scan=read_scan(options),
        solver=read_solver(options),
        preset=read_preset(options, "f767"),
        tare=None if options.tare is None else check_tare_frames(options.tare),
        zones=read_zones(getattr(options, "zones", None)),
        record=record,
        name=read_name(options),
    )


def read_name(options: argparse.Namespace) -> str | None:
    """Return ``--name``, checked; None if it is not given."""
    name: str | None = getattr(options, "name", None)
    return None if name is None else check_name(name, "--name")
