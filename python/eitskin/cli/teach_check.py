"""``eitskin teach check MODEL [FRAMES]``: check from the untouched skin alone whether a taught
model still fits."""

import argparse
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.cli.arguments import option
from eitskin.cli.device_options import add_device
from eitskin.cli.printing import answer
from eitskin.cli.teach_record import raw_session
from eitskin.device.client import TARE_FRAMES
from eitskin.device.known_model import scanned_protocol
from eitskin.errors import DeviceError
from eitskin.frames.frames import load_frames
from eitskin.model.eitm import load_model
from eitskin.session.frame import Frame
from eitskin.skin.protocol import Protocol
from eitskin.teaching.presses import load_presses
from eitskin.teaching.still import still_fits

REMEDY = {
    "fits": "tare, then use it",
    "update": "make 5 to 20 presses and run  eitskin teach update",
    "teach again": "check the electrodes, then teach again",
}


def add_parser(actions: Any) -> None:
    parser = actions.add_parser(
        "check",
        help="check from the untouched skin alone whether a taught model still fits",
        description=(
            "Compare the untouched skin with its state when it was taught, and state whether the"
            " model fits, needs an update, or must be taught again. A turned or shifted skin is not"
            " detected: after remounting, make 5 presses and update."
        ),
    )
    option(parser, "model MODEL.eitm", "from  eitskin teach fit  or  update", Path)
    option(
        parser,
        "frames FRAMES.npz",
        "untouched frames of a frames file or of presses (default: from a board whose skin is not"
        " touched)",
        Path,
        nargs="?",
    )
    add_device(parser, model=False)
    option(parser, "--firmware BIN", "firmware of an emulated board (default: prebuilt)", Path)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    model, _ = load_model(options.model)
    untouched, protocol = _of_board(options) if options.frames is None else _of_file(options.frames)
    found = still_fits(model, untouched, protocol, where=str(options.model))
    return answer(
        options,
        {"frames": len(untouched), **asdict(found)},
        f"{options.model}: {found.verdict} ({found.rule}); {REMEDY[found.verdict]}",
        f"correlation with the taught frame {found.correlation:.4f}, distance"
        f" {found.distance:.2f} presses, {len(untouched)} frames",
    )


def _of_file(path: Path) -> tuple[np.ndarray, Protocol]:
    if _holds_presses(path):
        presses = load_presses(path)
        return presses.untouched, presses.protocol
    frames = load_frames(path, allow_nonfinite=True)
    return frames.reference_voltage_v, frames.protocol


def _holds_presses(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as packed:
            return "untouched.npy" in packed.namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def _of_board(options: argparse.Namespace) -> tuple[np.ndarray, Protocol]:
    with raw_session(options, options.model, TARE_FRAMES) as session:
        protocol = scanned_protocol(session.device.board, session.known, session.name)
        frames = [
            message.raw.voltage_v
            for message in session.messages()
            if isinstance(message, Frame) and message.raw is not None
        ]
    if not frames:
        raise DeviceError(f"{options.device}: no frame came; check it with  eitskin info")
    return np.array(frames), protocol
