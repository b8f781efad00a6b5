"""Models of other kinds than the prebuilt one, each on touches of its own skin: weights in fewer
bits, 8 and 32 electrodes, a rectangle, and a model taught from presses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eitskin.errors import FrameError
from eitskin.fem.mesh import mesh_for_elements
from eitskin.frames.frames import Frames
from eitskin.model.build import BuildSettings, build_model
from eitskin.model.model import Model
from eitskin.scene.random_touches import TouchRules, random_touches
from eitskin.scene.simulate import Measurement, simulate
from eitskin.scoring.score import FrameScore, scorer_for
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import Skin, paper_skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin.teaching.presses import Presses
from eitskin.teaching.teach import teach
from eitskin_studies.experiments.experiment import (
    ExperimentOutcome,
    ExperimentSettings,
    Table,
    Workspace,
)
from eitskin_studies.experiments.multitouch.counts import Share, share_of
from eitskin_studies.experiments.shapes.example_drawings import rectangle_corners
from eitskin_studies.experiments.shapes.rounded import as_outline
from eitskin_studies.harness.sections import AS_EVERYWHERE

TITLE = "weights in fewer bits, other skins, and a taught model, with the joint fit"
USUAL = 40  # scenes per model
PRESSES = 100
ELEMENTS = 11_000
SAMPLES = 16  # random skins for the model errors of a model
SNR_DB = 60.0
DIGITS = 5


@dataclass(frozen=True)
class Variant:
    """A model: the skin that it is made for, how its weights are stored, and whether it is taught
    from presses instead of built."""

    name: str
    skin: Skin
    storage: str = "f32"
    taught: bool = False


def variants() -> list[Variant]:
    """Return all models that are measured."""
    paper = paper_skin()

    def with_electrodes(count: int) -> Skin:
        return replace(paper, electrodes=replace(paper.electrodes, count=count))

    rectangle = replace(paper, name="rectangle", outline=as_outline(rectangle_corners()))
    return [
        Variant("disk, 16 electrodes, f32", paper),
        Variant("the same, f16", paper, "f16"),
        Variant("the same, i8", paper, "i8"),
        Variant("disk, 8 electrodes", with_electrodes(8)),
        Variant("disk, 32 electrodes", with_electrodes(32)),
        Variant("rectangle, 16 electrodes", rectangle),
        Variant(f"taught by {PRESSES} presses, disk, 16 electrodes", paper, taught=True),
    ]


def run(workspace: Workspace) -> ExperimentOutcome:
    """Build each model, and find the touches of random scenes on its skin."""
    settings = workspace.settings
    measured = {
        one.name: workspace.kept(
            {"models": one.name, "scenes": settings.count(USUAL), "samples": SAMPLES},
            _maker(workspace, one),
        )
        for one in workspace.progress(variants(), "models")
    }
    return ExperimentOutcome(
        (_table(measured),),
        {"seed": settings.seed, "models": measured},
        words={"conditions": _conditions(settings)},
    )


def _maker(workspace: Workspace, one: Variant) -> Callable[[], dict[str, Any]]:
    return lambda: _measured(workspace, one)


def _measured(workspace: Workspace, one: Variant) -> dict[str, Any]:
    """Return plain values of all frames of a model."""
    settings = workspace.settings
    frames = _frames(one.skin, settings.seed, settings.count(USUAL), "models", (1, 3))
    model = _taught(workspace, one) if one.taught else _built(one)
    solver, scorer = Reconstructor(model), scorer_for(model)
    solver.tare(frames.reference_voltage_v)
    scores: list[FrameScore] = []
    radii: list[float] = []
    shown, macs = 0, []
    for number, frame in enumerate(frames.voltage_v):
        solver.forget()
        try:
            result = solver.reconstruct(frame)
        except FrameError:
            continue
        score = scorer.score(frames, number, result, "increase")
        assert score is not None
        assert frames.touch_radius_mm is not None
        scores.append(score)
        true = [frames.touch_radius_mm[k] for k in frames.touches_in(number)]
        radii += [result.touches[j].radius_mm - true[i] for i, j in score.matching.pairs]
        shown += result.image_is == "touches"
        macs.append(result.info.macs + result.info.touch_macs)
    return {
        "exact": [score.matching.exact for score in scores],
        "error_mm": [round(d, DIGITS) for one in scores for d in one.matching.distances_mm],
        "radius_error_mm": [round(float(value), DIGITS) for value in radii],
        "miou_image": [round(score.miou_image, DIGITS) for score in scores],
        "miou_solver": [round(score.miou_solver, DIGITS) for score in scores],
        "shown_touches": shown / max(1, len(scores)),
        "macs": macs,
    }


def _frames(skin: Skin, seed: int, count: int, role: str, touches: tuple[int, int]) -> Frames:
    drawn = random_touches(skin.outline, seed, count, role, TouchRules(count=touches))
    mesh = mesh_for_elements(skin, ELEMENTS)
    scan = adjacent(skin.electrodes.count)
    return simulate(
        skin, scan, drawn, measurement=Measurement(snr_db=SNR_DB), mesh=mesh
    ).as_frames()


def _built(one: Variant) -> Model:
    settings = BuildSettings(storage=one.storage, samples=SAMPLES)
    return build_model(one.skin, adjacent(one.skin.electrodes.count), settings)


def _taught(workspace: Workspace, one: Variant) -> Model:
    """Return a model that is taught from presses of single random touches."""
    seed = workspace.settings.tuning_seed
    made = _frames(one.skin, seed, PRESSES, "presses", (1, 1))
    assert made.touch_xy_mm is not None
    untouched = np.tile(made.reference_voltage_v.mean(axis=0), (PRESSES, 1))
    presses = Presses(made.protocol, untouched, made.voltage_v, made.touch_xy_mm)
    return teach(presses, one.skin).model


def _table(measured: Mapping[str, Mapping[str, Any]]) -> Table:
    head = (
        "model", "exact (95 %)", "position, median / p95, mm", "radius off, median / size, mm",
        "image MIoU", "solver's image", "shown by touches", "kMAC, mean",
    )  # fmt: skip
    rows = []
    for name, one in measured.items():
        errors, radii = np.array(one["error_mm"]), np.array(one["radius_error_mm"])
        rows.append(
            (
                name,
                _percent(share_of(one["exact"])),
                f"{np.median(errors):.2f} / {np.percentile(errors, 95):.2f}",
                f"{np.median(radii):+.2f} / {np.median(np.abs(radii)):.2f}",
                f"{np.mean(one['miou_image']):.3f}",
                f"{np.mean(one['miou_solver']):.3f}",
                f"{100 * one['shown_touches']:.0f} %",
                f"{np.mean(one['macs']) / 1e3:.0f}",
            )
        )
    return Table("models", head, tuple(rows))


def _conditions(settings: ExperimentSettings) -> str:
    return (
        f"{settings.count(USUAL)} scenes of 1 to 3 random touches (seed {settings.seed}) on each"
        f" model's own skin, {SNR_DB:g} dB of the skin's own rms(V0), {AS_EVERYWHERE}. The core in"
        f" float32 with default options; models have errors from {SAMPLES} random skins (the"
        " prebuilt one has 500). Presses for the taught model are single touches of seed"
        f" {settings.tuning_seed}."
    )


def _percent(one: Share) -> str:
    return f"{100 * one.mean:.0f} % ({100 * one.low:.0f} to {100 * one.high:.0f})"
