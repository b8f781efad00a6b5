"""``eitskin doctor``: find out what is wrong with frames or with a board, before any image is
made."""

import argparse
import copy
import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np

from eitskin.cli.arguments import RING_OHM, Output, option
from eitskin.cli.device_options import DEVICE_HELP, open_named
from eitskin.cli.import_options import (
    add_import_options,
    floats,
    import_command,
    read_options,
    read_protocol,
    write_layout,
)
from eitskin.cli.printing import say
from eitskin.device.known_model import find_model
from eitskin.errors import UsageError
from eitskin.frames.doctor.case import Case
from eitskin.frames.doctor.examine import examine_case
from eitskin.frames.doctor.report import DoctorReport
from eitskin.frames.doctor.subject import Subject, subject_from_source
from eitskin.frames.frames import Frames
from eitskin.frames.homogeneous import resistor_ring
from eitskin.session.checks.diagnose_board import board_findings, board_subject, measure
from eitskin.skin.skin import Skin
from eitskin.view.doctor_picture import draw_report
from eitskin.view.panels import check_picture

TOUCH_RADIUS_PER_SIZE = 0.05


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Find out what is wrong with measured frames before an image is made of them: channel"
        " order, sign, numbering, dead, exchanged, joined or saturated electrodes, reciprocity,"
        " gains, noise and drift. The source is a frames file, any source that import reads, or,"
        " with --device, a board whose skin is not touched; then the faults that the board itself"
        " reports are listed too. Exit code 0: nothing must be repaired; 11: something must."
    )
    text = "frames file, or CSV, NPZ, MAT, .eit, .get, folder or pattern as for import"
    option(parser, "source", text, Path, nargs="*")
    device = parser.add_argument_group("a board instead of a source")
    option(device, "--device URL", DEVICE_HELP)
    option(device, "--frames N", "number of frames to measure", default=32, within=(4, 1024))
    option(device, "--model MODEL.eitm", "the board's model if it is not the prebuilt one", Path)
    option(parser, "--json", "print the report as JSON")
    option(parser, "--picture FILE", "draw what was measured (needs matplotlib)", Output)
    parser.add_argument(
        "--touch",
        action="append",
        default=[],
        metavar="X,Y[,R]",
        help=(
            "a touch at a known place in mm, to check the numbering; write --touch=-10,5 if X is"
            " negative"
        ),
    )
    option(
        parser,
        "--resistor-ring OHM",
        "resistance between neighbours, if a ring of equal resistors replaces the skin",
        float,
        within=RING_OHM,
    )
    option(parser, "--touch-in FRAME", "frame with these touches (default: the largest change)")
    add_import_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    if (not options.source) == (options.device is None):
        raise UsageError("doctor: name frames to examine, or a board: --device URL")
    ring_ohm = options.resistor_ring
    if ring_ohm is not None and (options.touch or options.skin is not None):
        raise UsageError(
            "--resistor-ring: the ring replaces the skin; leave out --skin and --touch"
        )
    if options.picture is not None:
        check_picture(options.picture)
    protocol, skin, n_electrodes = read_protocol(options)
    if options.device is not None:
        return _run_device(options, skin)
    subject = subject_from_source(
        options.source, read_options(options), protocol, skin, n_electrodes
    )
    if options.touch:
        subject = _with_touches(subject, options.touch, options.touch_in)
    report, case = examine_case(_with_ring(subject, ring_ohm))
    if report.repair:
        report = replace(report, command=import_command(options, report.repair))
    if options.save_layout is not None:
        repaired = _repaired(options, report.repair)
        named = read_options(repaired)
        write_layout(options.save_layout, options.source, named, read_protocol(repaired)[0])
    return _print(options, report, case)


def _repaired(options: argparse.Namespace, repair: str) -> argparse.Namespace:
    """Return ``options`` with those of the doctor's advice ``repair``, as eitskin import takes
    them."""
    parser = argparse.ArgumentParser()
    add_import_options(parser)
    return parser.parse_args(
        shlex.split(repair), argparse.Namespace(**copy.deepcopy(vars(options)))
    )


def _run_device(options: argparse.Namespace, skin: Skin | None) -> int:
    """Measure, examine and report. With ``--touch`` the second half of the frames is measured on
    the touched skin."""
    with open_named(options) as device:
        known = find_model(device.board, options.model, device.transport.name)
        simulated = device.transport.capabilities.own_clock

        def before_touches() -> None:
            if not simulated:
                say("now touch the skin at the place of --touch, and keep the touch")

        if not simulated:
            say(f"leave the skin untouched: measuring {options.frames} frames")
        found = measure(
            device, options.frames, touched=bool(options.touch), before_touches=before_touches
        )
        subject = board_subject(device, found, known, skin)
    if options.touch:
        subject = _with_touches(subject, options.touch, options.touch_in)
    report, case = examine_case(_with_ring(subject, options.resistor_ring))
    return _print(options, board_findings(report, found), case)


def _print(options: argparse.Namespace, report: DoctorReport, case: Case) -> int:
    if options.picture is not None:
        draw_report(options.picture, report, case)
    if options.json:
        print(json.dumps(report.as_table()))
    else:
        print("\n".join(report.lines()))
    return report.exit_code


def _with_ring(subject: Subject, ring_ohm: float | None) -> Subject:
    if ring_ohm is None:
        return subject

    n_electrodes = subject.readings[0].frames.protocol.n_electrodes
    return replace(subject, skin=None, stand_in=resistor_ring(n_electrodes, ring_ohm))


def _with_touches(subject: Subject, given: list[str], name: str | None) -> Subject:
    if subject.skin is None:
        raise UsageError("--touch needs --skin FILE, which says where the electrodes are")
    low_x, low_y, high_x, high_y = subject.skin.outline.bounding_box_mm
    touches = []
    for text in given:
        values = floats(text, "--touch")
        if len(values) not in (2, 3):
            raise UsageError(f"--touch {text}: must be X,Y or X,Y,RADIUS in mm")
        default = TOUCH_RADIUS_PER_SIZE * max(high_x - low_x, high_y - low_y)
        touches.append((values[0], values[1], values[2] if len(values) == 3 else default))
    if not subject.skin.outline.contains([touch[:2] for touch in touches]).all():
        raise UsageError(
            "--touch: a touch lies outside the skin; give millimetres from the outline's centre"
        )
    readings = tuple(
        replace(reading, frames=_touched(reading.frames, touches, name))
        for reading in subject.readings
    )
    return replace(subject, readings=readings)


def _touched(frames: Frames, touches: list[tuple[float, float, float]], name: str | None) -> Frames:
    if not frames.n_frames:
        raise UsageError("--touch: there is no frame other than untouched ones")
    if name is not None and name not in frames.frame_name:
        raise UsageError(
            f"--touch-in {name}: no such frame; frames are {', '.join(frames.frame_name[:20])}"
        )
    change = np.nan_to_num(np.abs(frames.voltage_v - frames.reference_v)).sum(axis=1)
    frame = int(np.argmax(change)) if name is None else frames.frame_name.index(name)
    given = np.array(touches)
    return replace(
        frames,
        touch_frame=np.full(len(given), frame),
        touch_xy_mm=given[:, :2],
        touch_radius_mm=given[:, 2],
        touch_strength=None,
        touch_sign=np.ones(len(given), dtype=np.int8),
    )
