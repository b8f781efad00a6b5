"""Ablations: attempts to do better than discs fitted to an image's peaks, each one for itself and
with its cost."""

from collections.abc import Mapping
from typing import Any

from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.levers.configurations import IMAGES, SEARCHES
from eitskin_studies.experiments.levers.measure import AblationRuns
from eitskin_studies.experiments.levers.tables import (
    asked_table,
    conditions,
    image_table,
    search_table,
)
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.levers_pictures import draw_images, draw_search

TITLE = "Levers: what helps for its multiply-accumulates, and what does not"


def run(workspace: Workspace) -> ExperimentOutcome:
    """Every search of touches on every set, every image at every SNR."""
    runs = AblationRuns(workspace)
    searches = {one.name: runs.searched(one) for one in workspace.progress(SEARCHES, "searching")}
    images = {one.name: runs.imaged(one) for one in workspace.progress(IMAGES, "imaging")}
    return ExperimentOutcome(
        tables=(asked_table(images), search_table(searches), image_table(images)),
        data={"searches": searches, "images": images, "seed": workspace.settings.seed},
        pictures={
            "search.svg": Drawing(draw_search, _shares(searches)),
            "images.svg": Drawing(draw_images, _costs(images)),
        },
        words={"conditions": conditions(workspace.settings)},
    )


def _shares(searches: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Exactly counted scenes in %, by search and set of touches apart."""
    return {
        search: {
            name: 100 * sum(one["exact"]) / len(one["exact"])
            for name, one in found.items()
            if "radii" in name
        }
        for search, found in searches.items()
    }


def _costs(images: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """MACs and mean MIoU by image and SNR in dB."""
    return {
        name: {
            snr_db: {"macs": found[snr_db]["macs"], "miou": found[snr_db]["image"]["mean"]}
            for snr_db in ("60", "40")
        }
        for name, found in images.items()
    }
