"""The options that commands for boards share, and what they are turned into."""

import argparse
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from eitskin.cli.arguments import above, option
from eitskin.cli.budget_options import add_wish, named_target
from eitskin.cli.printing import say
from eitskin.config import nearest
from eitskin.core.diagnostics_table import ALL_DIAGNOSTICS, DIAGNOSTICS
from eitskin.core.gestures import Zone
from eitskin.core.options_table import SOLVERS
from eitskin.device.client import TARE_FRAMES, Device, check_tare_frames
from eitskin.device.open import open_with_files
from eitskin.device.settings import ScanSettings, SolverSettings
from eitskin.device.wire.link_table import Stream
from eitskin.errors import FileError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.session.session import Session
from eitskin.session.settings import SessionSettings, kinds_of
from eitskin.session.zones import load_zones
from eitskin.sinks.outputs import Outputs, attached_outputs

DEVICE_HELP = (
    "auto (the one board that is plugged in), serial:/dev/ttyACM0, text:PORT?layout=FILE (another"
    " instrument's lines), sim:SCENE (simulated), emu:SCENE (the firmware on an emulated board),"
    " file:RUN.eits (a recording); SCENE is a file or a scene of  eitskin scene list; after the"
    " last three, ?speed=1&loop=1"
)
MAX_U32 = 2**32 - 1


def add_device(parser: argparse.ArgumentParser, *, model: bool = True, json: bool = True) -> None:
    """``--device``; with ``json``, ``--json``; with ``model``, ``--model`` and ``--firmware``."""
    option(parser, "--device URL", DEVICE_HELP, default="auto")
    if model:
        option(
            parser,
            "--model MODEL.eitm",
            "the board's model where it is not the prebuilt one; a simulated or emulated board is"
            " given it",
            Path,
        )
        option(parser, "--firmware BIN", "of an emulated board (default: the prebuilt one)", Path)
    if json:
        option(parser, "--json", "print for programs")


def add_scan(parser: argparse.ArgumentParser) -> None:
    """How frames are scanned and solved, and how the reference is taken."""
    scan = parser.add_argument_group(
        "scan; settings that are not given stay as they are on the board"
    )
    option(scan, "--excitation-hz HZ", "of the generator", float, within=(1, 250_000))
    option(scan, "--sample-rate-hz HZ", "of the converter", within=(1000, 5_000_000))
    option(scan, "--samples N", "of a measurement: a whole number of periods", within=(4, 1024))
    settle = "from switching the multiplexers to the first sample"
    option(scan, "--settle-us US", settle, within=(0, 0xFFFF))
    period = "from frame to frame; 0: as fast as the scan goes"
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
    add_wish(solver)
    option(
        solver,
        "--sign",
        "which changes to look for (default: increase)",
        choices=("increase", "decrease", "both"),
    )
    option(
        solver,
        "--ignore NAME[,NAME]",
        "do not look for saturated, electrode-open, electrodes-bridged, outlier,"
        " electrode-noisy, model-mismatch, stale-reference, crowded, unlike-the-model, or all"
        " (default: look for all)",
    )
    start = solver.add_mutually_exclusive_group()
    option(start, "--warm", "begin each frame from the last one's result")
    option(start, "--cold", "begin each frame from nothing (default)")
    track = solver.add_mutually_exclusive_group()
    option(track, "--track", "confirm births, keep ids, smooth places (default)")
    option(track, "--no-track", "touches of each frame by itself")
    tare = parser.add_argument_group("reference")
    option(
        tare,
        "--tare N",
        "take the reference from N frames of the untouched skin first (1, or 4 to 1024);"
        f" without it, from {TARE_FRAMES} where the board has none, and always on a simulated"
        " or emulated board",
        int,
    )


def add_solver(parser: Any) -> None:
    """Which solver, and what ends it."""
    option(
        parser, "--solver", "default: the model's; all minimise the same objective", choices=SOLVERS
    )
    most = "the most iterations of FISTA, or rounds of the active set (default: the model's)"
    option(parser, "--iterations N", most, within=(1, 1_000_000))
    gap = "stop once the duality gap is below this share of |y|^2 / 2"
    option(parser, "--gap REL", gap, float, within=(above(0), 1))
    option(
        parser,
        "--mac-limit N",
        "return the best so far when the next step would pass N multiply-accumulates",
        within=(1, MAX_U32),
    )


def named_solver(options: argparse.Namespace) -> dict[str, Any]:
    """What ``add_solver``'s options name, by the names of ``core.results.Options``."""
    values = {
        "solver": options.solver,
        "iterations": options.iterations,
        "gap_rel": options.gap,
        "mac_limit": options.mac_limit,
    }
    return {name: value for name, value in values.items() if value is not None}


def add_stream(parser: argparse.ArgumentParser, default: str) -> None:
    """What is streamed, and how much of it."""
    option(parser, "--mode KIND[,KIND]", "raw, image, touches, events, or several", default=default)
    add_report(parser)
    add_every(parser)
    option(
        parser,
        "--frames N",
        "stop after N (default: go on until Ctrl-C, or the scene ends)",
        within=(1, MAX_U32),
    )


def add_every(parser: argparse.ArgumentParser) -> None:
    text = "every N-th frame (default: as many as the line carries)"
    option(parser, "--every N", text, within=(1, 0xFFFF))


def add_report(parser: argparse.ArgumentParser) -> None:
    """When touches are reported."""
    option(
        parser,
        "--report WHEN",
        "touches after each frame, or also after each drive, with their velocity, in the middle of"
        " a scan",
        choices=("frame", "drive"),
        default="frame",
    )


def add_verbose(parser: argparse.ArgumentParser) -> None:
    option(parser, "-v --verbose", "all that is known of a frame, the solver's numbers included")


def add_outputs(parser: argparse.ArgumentParser) -> None:
    option(
        parser,
        "--to URL",
        "also send touches there, any number of times: udp://HOST:PORT, ws://HOST:PORT (clients"
        " connect to it), osc://HOST:PORT, tuio://HOST, mqtt://HOST, lsl:, csv:FILE, mcap:FILE,"
        " foxglove:, or a sink that another package brings (docs/guide/touches-out.md)",
        action="append",
    )


def named_outputs(options: argparse.Namespace, session: Session) -> AbstractContextManager[Outputs]:
    """The sinks of ``--to``."""
    overwrite = getattr(options, "overwrite", False)
    return attached_outputs(session, options.to or (), overwrite=overwrite, say=say)


def add_zones(parser: argparse.ArgumentParser) -> None:
    option(
        parser, "--zones FILE.toml", "named keys, pads and rings whose presses are reported", Path
    )


def read_zones(path: Path | None) -> tuple[Zone, ...]:
    """The zones of ``--zones``."""
    return () if path is None else load_zones(path)


def read_mode(text: str) -> Stream:
    """The kinds in "raw,touches"."""
    return kinds_of(text, "--mode")


def read_scan(options: argparse.Namespace) -> ScanSettings:
    """What is named of the scan."""
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
    """What is named of the solver."""
    return SolverSettings(
        warm_start=True if options.warm else False if options.cold else None,
        sign=options.sign,
        diagnostics=read_ignored(options.ignore),
        track=True if options.track else False if options.no_track else None,
        **named_solver(options),
    )


def read_ignored(text: str | None) -> int | None:
    """The diagnostics that are left, bit k of ``core.diagnostics.DIAGNOSTICS``, without those in
    "outlier,electrode-noisy" or "all"; None for None."""
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
    """Refuse a recording that could not be written, before a device is opened."""
    refuse_unwritable(path)
    if path is not None and path.is_file() and not overwrite:
        raise FileError(
            f"{path}: exists already; name another file, or write over it with  --overwrite"
        )


def open_named(options: argparse.Namespace) -> Device:
    """The device of ``--device``, with the command's ``--model`` and ``--firmware``, if any."""
    files = (getattr(options, name, None) for name in ("model", "firmware"))
    return open_with_files(options.device, *files)


def session_settings(
    options: argparse.Namespace,
    mode: Stream | None,
    *,
    record: Path | None = None,
    model_for: str = "",
) -> SessionSettings:
    """What ``add_device``, ``add_stream`` and ``add_scan`` name, checked before a device is opened.

    Raises:
        UsageError: a number is out of range.
        FileError: the recording could not be written.
    """
    every = options.every or 0
    if options.report == "drive" and every > 1:
        raise UsageError(f"--report drive needs every frame; leave --every {every} out")
    check_recording(record, options.overwrite)
    return SessionSettings(
        mode=mode,
        report=options.report,
        every=every,
        frames=options.frames or 0,
        model=options.model,
        firmware=options.firmware,
        model_for=model_for,
        scan=read_scan(options),
        solver=read_solver(options),
        target=named_target(options, "f767"),
        tare=None if options.tare is None else check_tare_frames(options.tare),
        zones=read_zones(getattr(options, "zones", None)),
        record=record,
    )
