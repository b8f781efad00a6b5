"""Touches on a skin that is stretched or bent, found by the model of the flat one."""

from functools import partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.errors import FrameError
from eitskin.fem.cem import ForwardModel
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.deformation import EvenDeformation, deformed, stretched
from eitskin.scene.effects.bend import Parameters, lengthening
from eitskin.scene.random_touches import TouchSet, random_touches
from eitskin.scene.simulate import Measurement, conductivity_with, measure
from eitskin.scene.streams import stream
from eitskin.scoring.matching import match
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.experiment import (
    SIMULATED_ELEMENTS,
    ExperimentOutcome,
    Table,
    Workspace,
)
from eitskin_studies.experiments.multitouch.counts import share
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.harness.sessions import converter_for
from eitskin_studies.harness.snr import noise_deviation_v
from eitskin_studies.pictures.worlds_pictures import draw_shares

TITLE = "Touches on a skin that is stretched or bent, by the model of the flat one"
USUAL, SNR_DB, UNTOUCHED = 100, 60.0, 50


def deformations(thickness_mm: float) -> dict[str, EvenDeformation]:
    """Return the deformations of the page. A bend is represented by the stretch between held sides
    that has the same conductance."""
    found = {"flat": EvenDeformation()}
    for percent in (5, 10, 20):
        along = 1 + percent / 100
        found[f"stretched by {percent} %"] = stretched(along, along**-0.5, 0)
    for radius_mm, neutral, where in ((300, 0, "base"), (100, 0, "base"), (100, 0.5, "free")):
        bent = Parameters(radius_mm=radius_mm, neutral=neutral)
        along = lengthening(bent, thickness_mm, 1)
        found[f"bent to {radius_mm} mm, {where}"] = stretched(along, 1, 0)
    return found


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    settings = workspace.settings
    model, blob = load_prebuilt()
    skin, seed = model.skin, settings.seed
    drawn = random_touches(skin.outline, seed, settings.count(USUAL), "deformation")
    solver = workspace.scenes(skin, model.protocol, SIMULATED_ELEMENTS)
    spread = stream(seed, "contact deformation").uniform(-1, 1, skin.electrodes.count)
    contact = skin.electrodes.contact_impedance_ohm_m2 * (1 + Measurement.contact_spread * spread)
    forward = ForwardModel(solver.mesh, skin, model.protocol, contact)
    volts = {}
    for name, how in workspace.progress(list(deformations(skin.thickness_mm).items()), "solving"):
        facts = {"part": "frames", "how": vars(how), "set": drawn.name}
        make = partial(_solved, forward, contact, how, drawn, skin.conductivity_s_per_m)
        volts[name] = workspace.kept_arrays(facts, make)
    finder = Reconstructor(model, blob=blob)
    scores = []
    for name, solved in workspace.progress(list(volts.items()), "reconstructing"):
        for tare, untouched in (("flat", volts["flat"]["quiet"]), ("fresh", solved["quiet"])):
            facts = {"part": "score", "name": name, "tare": tare, "set": drawn.name}
            look = partial(_scored, finder, drawn, untouched, solved, seed)
            scores.append({"name": name, "tare": tare, **workspace.kept(facts, look)})
    return ExperimentOutcome(
        (_table(scores),),
        {"scores": scores},
        {"shares.svg": Drawing(draw_shares, _shares(scores))},
        {"sets": _words(len(drawn.scenes), seed)},
    )


def _solved(
    forward: ForwardModel, contact: FloatArray, how: EvenDeformation, drawn: TouchSet, sheet: float
) -> dict[str, FloatArray]:
    """``quiet`` (m,) and ``frames`` (k, m) in V of the deformed skin; touches move with it."""
    model, mesh, thick = deformed(forward, how), forward.mesh, how.thickness
    scenes = [conductivity_with(mesh, one.touches, sheet) for one in drawn.scenes]
    untouched = np.full(mesh.n_elements, sheet)
    volts = np.array([model.voltages(one * thick, contact / thick) for one in (untouched, *scenes)])
    return {"quiet": volts[0], "frames": volts[1:]}


def _scored(
    finder: Reconstructor, drawn: TouchSet, untouched: FloatArray, solved: dict[str, Any], seed: int
) -> dict[str, Any]:
    """Exact scenes, distances, and touches in frames of nothing."""
    how = converter_for(SNR_DB)
    span_v = how.adc_headroom * float(np.abs(untouched).max())
    lsb_v = 2 * span_v / 2 ** (how.adc_bits or 12)
    converter = (noise_deviation_v(untouched, SNR_DB), lsb_v, span_v, seed)
    finder.set_options(noise_floor_v=lsb_v / 12**0.5)
    finder.tare(measure(np.tile(untouched, (64, 1)), *converter, "quiet deformation")[0])
    frames = measure(solved["frames"], *converter, "frame deformation")[0]
    nothing = measure(np.tile(solved["quiet"], (UNTOUCHED, 1)), *converter, "untouched")[0]
    matched = [
        match(scene.centres_mm(), _found(finder, frame))
        for scene, frame in zip(drawn.scenes, frames, strict=True)
    ]
    far = [d for one in matched for d in one.distances_mm]
    return {
        "exact": sum(one.exact for one in matched),
        "scenes": len(matched),
        "false": sum(one.false_touches for one in matched) / len(matched),
        "median_mm": float(np.median(far)) if far else None,
        "p95_mm": float(np.quantile(far, 0.95)) if far else None,
        "untouched": float(np.mean([len(_found(finder, frame)) for frame in nothing])),
        "changed": float(np.linalg.norm(solved["quiet"] - untouched) / np.linalg.norm(untouched)),
    }


def _found(finder: Reconstructor, frame: FloatArray) -> list[tuple[float, float]]:
    finder.forget()
    try:
        return [(one.x_mm, one.y_mm) for one in finder.reconstruct(frame).touches]
    except FrameError:
        return []


def _table(scores: list[dict[str, Any]]) -> Table:
    rows = []
    for one in scores:
        exact = share(one["exact"], one["scenes"])
        far = [
            f"{one[key]:.2f}" if one[key] is not None else "-" for key in ("median_mm", "p95_mm")
        ]
        rows.append(
            (
                one["name"], one["tare"], f"{100 * one['changed']:.2g} %",
                f"{100 * exact.mean:.0f} % ({100 * exact.low:.0f} to {100 * exact.high:.0f})",
                f"{one['false']:.2f}", *far, f"{one['untouched']:.2f}",
            )
        )  # fmt: skip
    head = ("skin", "tare", "untouched frame changed by", "exact (95 %)", "false a scene",
            "median, mm", "p95, mm", "touches in an untouched frame")  # fmt: skip
    return Table("scores", head, tuple(rows))


def _words(scenes: int, seed: int) -> str:
    return (
        f"{scenes} random scenes of 1 to 3 discs, seed {seed}, {SNR_DB:g} dB, {AS_EVERYWHERE};"
        f" {UNTOUCHED} untouched frames; the prebuilt model with its default options."
    )


def _shares(scores: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The names, exact shares and false touches per scene that the picture shows."""
    shown = []
    for one in scores:
        exact = share(one["exact"], one["scenes"])
        values = [exact.mean, exact.low, exact.high]
        name = f"{one['name']}, {one['tare']} tare"
        shown.append({"name": name, "exact": values, "false_per_scene": one["false"]})
    return shown
