"""``eitskin calibrate RECORDING --weights LIST``: calibrate the force of touches with known weights
on a skin."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from eitskin.calibration.fit import FORMS, Calibration, calibrate
from eitskin.calibration.presses import find_presses, joined
from eitskin.calibration.weights import load_weights
from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import answer
from eitskin.core.results import force_text
from eitskin.errors import EitskinError, FrameError, UsageError
from eitskin.fileio import refuse_unwritable
from eitskin.frames.frames import Frames, load_frames
from eitskin.model.eitm import save_model
from eitskin.model.model import Model
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.session.checks.raw_frames import finite_only, frames_of
from eitskin.solve.reconstructor import Reconstructor


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Fit the law that converts a touch's strength and place to force, from recordings of"
        " known weights; state its errors, and store it in a copy of the model."
        " docs/guide/calibration.md shows how to record the weights."
    )
    option(
        parser, "recordings RECORDING", "frames (.npz) or a run (.eits) of weights", Path, nargs="+"
    )
    parser.add_argument(
        "--weights", action="append", type=Path, required=True, metavar="LIST",
        help="the weights of a recording, .csv or .toml; once for each recording, in their order",
    )  # fmt: skip
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(
        parser,
        "--sign",
        "whether weights increase or decrease the conductivity",
        choices=("increase", "decrease"),
        default="increase",
    )
    option(parser, "--seed S", "seed of the resamples for the intervals", default=1)
    option(parser, "-o --output OUT.eitm", "the model with its calibration", Output)
    option(parser, "--json")
    parser.set_defaults(run=run, extras=("model",))


def run(options: argparse.Namespace) -> int:
    if len(options.recordings) != len(options.weights):
        raise UsageError(
            f"calibrate: {len(options.recordings)} recordings and {len(options.weights)} lists of"
            " weights; give --weights once for each"
        )
    if options.seed < 0:
        raise UsageError(f"--seed {options.seed} must be 0 or above")
    refuse_unwritable(options.output)
    model, blob, name = load_or_prebuilt(options.model)
    reconstructor = Reconstructor(model, blob=blob)
    reconstructor.set_options(sign=options.sign)
    parts, unseen = [], []
    for recording, list_of_weights in zip(options.recordings, options.weights, strict=True):
        weights = load_weights(list_of_weights)
        frames, numbers = _frames(recording, options.model)
        try:
            reconstructor.check_protocol(frames.protocol)
        except EitskinError as error:
            raise type(error)(f"{recording} and {name}: {error}") from None
        presses, lines = find_presses(reconstructor, frames, numbers, weights, str(recording))
        parts.append(presses)
        unseen += lines
    for line in unseen:
        print(f"eitskin: {line}", file=sys.stderr)
    radius_mm = float(np.hypot(*model.grid.centres_mm().T).max())
    found = calibrate(joined(parts), radius_mm, options.seed)
    if options.output is not None:
        save_model(options.output, calibrated(model, found))
    stored = "not stored; name a model with -o"
    if options.output:
        stored = f"{options.output}: {name} with this calibration"
    facts = {"model": name, "output": str(options.output or ""), "left_out": unseen}
    return answer(options, facts | found.as_dict(), *_lines(found), stored)


def calibrated(model: Model, found: Calibration) -> Model:
    """Return ``model`` with the calibration, which is also added to its description."""
    return replace(model, force_law=found.law, meta={**model.meta, "calibration": found.as_dict()})


def _frames(path: Path, model: Path | None) -> tuple[Frames, list[int]]:
    """Return the frames of a file or a run, and their numbers as in a list of weights: the board's
    own, or from 0."""
    if path.suffix == ".eits":
        frames, _ = finite_only(frames_of(path, model), str(path))
        numbers = [int(one) for one in frames.frame_name]
    else:
        frames = load_frames(path)
        numbers = list(range(frames.n_frames))
    if not numbers:
        raise FrameError(f"{path}: holds a reference but no frame; record the weights too")
    return frames, numbers


def _lines(found: Calibration) -> list[str]:
    facts, law = found.as_dict(), found.law
    names = {
        "s_max_s_per_m_mm2": "s_max, S/m mm2",
        "f0_n": "F0, N",
        "c_s_per_m_mm2_at_1_n": "c, S/m mm2 at 1 N",
        "exponent": "p",
    }
    lines = [
        (
            f"{facts['presses']} presses at {facts['places']} place{'s' * (found.groups > 1)}, "
            f"up to {force_text(found.law.force_n[-1])}"
        ),
        f"law                 strength = {FORMS[found.fitted.form].text}",
    ]
    for key, value, ends in zip(
        FORMS[found.fitted.form].names, found.fitted.numbers, found.interval, strict=True
    ):
        lines.append(f"  {names[key]:18}{value:.4g}   95 %: {ends[0]:.4g} to {ends[1]:.4g}")
    out_mm, (before, after) = law.reach * law.radius_mm, found.scatter
    lines.append(
        f"gain over the skin  polynomial of order {law.order}, {len(law.gain)} terms, out to"
        f" {out_mm:.0f} mm"
    )
    lines.append(
        f"same force anywhere standard deviation {100 * after:.1f} % of it ({100 * before:.1f} %"
        " with one gain)"
    )
    lines.append(
        f"forces left out     error {100 * facts['error_rms']:.1f} % (rms), 95 % within"
        f" {100 * facts['error_95']:.1f} %, worst {100 * facts['error_worst']:.1f} %; left out by"
        f" {facts['left_out_by']}"
    )
    return lines + [f"note: {note}" for note in found.notes]
