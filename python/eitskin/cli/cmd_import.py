"""``eitskin import``: convert measured frames of another instrument to a frames file."""

import argparse
from pathlib import Path
from shlex import quote
from typing import Any

from eitskin.cli.arguments import Output, option
from eitskin.cli.import_options import add_import_options, read_options, read_protocol, write_layout
from eitskin.cli.printing import answer, say
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import save_frames
from eitskin.frames.importer import import_frames
from eitskin.skin.protocol import pattern_name


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Convert text, NPY, NPZ, MAT, .eit or .get files of measured voltages to a frames file, in"
        " the protocol's order, with signs, in volts. Run  eitskin doctor SOURCE  first to find out"
        " which options the source needs."
    )
    option(
        parser,
        "source",
        "CSV or other text, NPY, NPZ, MAT, .eit, .get, or a frames file to repair; several files, a"
        " folder or a pattern are read one after another, in natural order",
        Path,
        nargs="+",
    )
    option(parser, "-o --output OUT.npz", "frames file to write", Output, required=True)
    option(parser, "--json", "describe the result as JSON")
    add_import_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.output, options.save_layout)
    protocol, skin, n_electrodes = read_protocol(options)
    named = read_options(options)
    frames = import_frames(options.source, named, protocol, skin, n_electrodes)
    if options.save_layout is not None:
        write_layout(options.save_layout, options.source, named, protocol)
    save_frames(options.output, frames)
    facts: dict[str, Any] = {
        "written": str(options.output),
        "frames": frames.n_frames,
        "quiet_frames": len(frames.reference_voltage_v),
        "channels": frames.protocol.n_rows,
        "electrodes": frames.protocol.n_electrodes,
        "pattern": pattern_name(frames.protocol),
        "protocol_hash": f"{frames.protocol.hash:016x}",
        "touches": 0 if frames.touch_frame is None else len(frames.touch_frame),
        "masks": frames.truth_mask is not None,
        "unit": frames.meta["unit"],
        "notes": list(frames.meta.get("notes", ())),
    }
    for note in facts["notes"]:
        say(f"{options.source[0]}: {note}")
    with_skin = "" if options.skin is None else f" --skin {quote(str(options.skin))}"
    return answer(
        options,
        facts,
        f"{options.output}: {facts['frames']} frame(s) of {facts['channels']} rows,"
        f" {facts['quiet_frames']} untouched, {facts['electrodes']} electrodes, {facts['pattern']},"
        f" {facts['touches']}"
        f" known touches; unit {facts['unit']}",
        f"next: eitskin doctor {quote(str(options.output))}{with_skin}",
    )
