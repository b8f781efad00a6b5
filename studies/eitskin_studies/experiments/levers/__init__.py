"""Ablations: attempts to do better than discs fitted to an image's peaks, each one for itself and
with its cost."""

from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.levers.configurations import IMAGES, SEARCHES
from eitskin_studies.experiments.levers.measure import AblationRuns
from eitskin_studies.experiments.levers.tables import (
    asked_table,
    conditions,
    image_table,
    search_table,
)
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
            "search.png": lambda path: draw_search(path, searches),
            "images.png": lambda path: draw_images(path, images),
        },
        words={"conditions": conditions(workspace.settings)},
    )
