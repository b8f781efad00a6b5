"""``eitskin export [FRAMES] -o OUT.mat``: export model, frames and images for EIDORS."""

import argparse
from pathlib import Path

import numpy as np

from eitskin.cli.arguments import Output, option
from eitskin.cli.printing import answer
from eitskin.fileio import refuse_unwritable
from eitskin.frames.eidors import save_eidors
from eitskin.frames.frames import load_frames
from eitskin.model.prebuilt import load_or_prebuilt
from eitskin.solve.reconstructor import Reconstructor


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Write EIDORS structs that MATLAB and Octave can load: fmdl with electrodes and patterns,"
        " img_bkgnd, the Jacobian J of its elements, and c2f from our pixels to its elements; with"
        " frames also vh, vi and img, the images of our solver."
    )
    option(parser, "frames FRAMES.npz", "frames of the model's protocol", Path, nargs="?")
    option(parser, "--model MODEL.eitm", "default: the prebuilt model of the paper's skin", Path)
    option(parser, "--elements", "approximate number of triangles", default=3000)
    option(parser, "-o --output OUT.mat", "file to write", Output, required=True)
    option(parser, "--json")
    parser.set_defaults(run=run, extras=("model",))


def run(options: argparse.Namespace) -> int:
    refuse_unwritable(options.output)
    model, blob, _ = load_or_prebuilt(options.model)
    frames, images = None, None
    if options.frames is not None:
        frames = load_frames(options.frames)
        solver = Reconstructor(model, blob=blob)
        solver.check_protocol(frames.protocol)
        solver.tare(frames.reference_voltage_v)
        images = np.array(
            [solver.reconstruct(one, touches=False).solver_image for one in frames.voltage_v], float
        ).reshape(-1, model.grid.n_pixels)
    nodes, elements = save_eidors(
        options.output,
        model.skin,
        model.protocol,
        model.grid,
        elements=options.elements,
        frames=frames,
        images_s_per_m=images,
    )
    count = 0 if frames is None else frames.n_frames
    facts = {"written": str(options.output), "nodes": nodes, "elements": elements, "frames": count}
    text = f"{options.output}: fmdl of {nodes} nodes and {elements} elements, img_bkgnd, J, c2f"
    if frames is not None:
        text += f"; vh, vi and img of {count} frames"
    return answer(options, facts, text)
