"""Skins of other shapes: a rounded rectangle, a forearm, a hand from a drawing; where they see, and
where touches are lost."""

from functools import partial
from typing import Any

from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.shapes.measuring import SNR_DB, TEST, TUNING, Maker
from eitskin_studies.experiments.shapes.tables import all_tables
from eitskin_studies.experiments.shapes.variants import variants
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.pictures.shapes_pictures import ShapePanel, draw_shapes

TITLE = "a rounded rectangle, a forearm and a hand"
SAID = (
    "{test} test scenes a shape (seed {seed}) of 1 to 3 random touches and {tuning} others (seed"
    " {tuning_seed}) on which its t was chosen; {snr:g} dB of the skin's own rms(V0), "
    + AS_EVERYWHERE
    + "."
)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Each shape: its model, random touches on it, and where they are found."""
    makers = {one.name: Maker(workspace, one) for one in variants(workspace.folder / "drawings")}
    measured: dict[str, Any] = {
        name: makers[name].measured() for name in workspace.progress(list(makers), "shapes")
    }
    both = {name: (makers[name].variant, result) for name, result in measured.items()}
    settings = workspace.settings
    said = SAID.format(
        test=settings.count(TEST),
        tuning=settings.count(TUNING),
        seed=settings.seed,
        tuning_seed=settings.tuning_seed,
        snr=SNR_DB,
    )
    return ExperimentOutcome(
        all_tables(both),
        {"seed": settings.seed, "snr_db": SNR_DB, "shapes": measured},
        {"shapes.png": partial(draw_shapes, shapes=[_shape(*one) for one in both.values()])},
        {"conditions": said},
    )


def _shape(variant: Any, result: dict[str, Any]) -> ShapePanel:
    about, scores = result["about"], result["scores"]
    return ShapePanel(
        variant.name,
        variant.skin,
        about["sensitivity_log10"],
        about["scene_image"],
        about["scene_true"],
        about["scene_found"],
        scores["place_mm"],
        [error is not None for error in scores["error_mm"]],
    )
