"""Measured frames of water tanks: every method, three kinds of data, and what makes images of large
objects better."""

import hashlib
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.model.build import linearise
from eitskin.scoring import metrics
from eitskin.scoring.matching import GATE_MM
from eitskin.skin.skin import size_to_paper
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, ExperimentOutcome, Workspace
from eitskin_studies.experiments.tank import levers as lever_work
from eitskin_studies.experiments.tank import tables
from eitskin_studies.experiments.tank.discs import varied
from eitskin_studies.experiments.tank.evaluation import EvaluationSets, evaluate
from eitskin_studies.experiments.tank.imagers import (
    KINDS,
    Entry,
    SimulatedTank,
    baseline_entries,
    core_entries,
)
from eitskin_studies.experiments.tank.scenes import simulated
from eitskin_studies.experiments.tank.signed_scores import jittered_truth
from eitskin_studies.experiments.tank.tanks import (
    PHANTOMS,
    RADIUS_MM,
    RODS,
    folder_of,
    objects_of,
    phantoms,
    reciprocal_share,
    rods,
    tank,
    touch_like,
    truth_of,
)

TITLE = "Measured frames of water tanks: every method, three kinds of data"

TUNING_SCENES, TEST_SCENES = 40, 60
TRUTH_ERRORS = (
    0.0,
    0.03,
    0.04,
    0.05,
)  # of the tank's radius; the truth is said to be good to 0.03 to 0.05
DRAWS = 200


def run(workspace: Workspace) -> ExperimentOutcome:
    """All of it.

    Raises:
        UsageError: no folder of measured frames is given, or it lacks one of them.
    """
    folder = folder_of(workspace.settings.data)
    ours = _tank()
    evaluation_sets, facts = _grounds(workspace, ours, folder)
    levers = lever_work.tried(workspace, ours, evaluation_sets, facts)
    best = lever_work.chosen(levers)
    entries = [
        entry
        for kind in KINDS
        for entry in (*baseline_entries(ours, kind), *core_entries(ours, kind))
    ]
    entries.append(lever_work.entry_of(ours, tables.CHOSEN, best))
    results = []
    for entry in _watched(workspace, entries):
        asked = {**facts, "entry": entry.name, "kind": entry.kind, "values": entry.values}
        if entry.name == tables.CHOSEN:
            asked["levers"] = repr(best)
        results.append(workspace.kept(asked, partial(evaluate, entry, evaluation_sets)))
    ceiling = workspace.kept(
        {**facts, "what": "ceiling"}, lambda: _ceiling(workspace, evaluation_sets)
    )
    discs = varied(workspace, ours, evaluation_sets, facts)
    return tables.outcome(
        evaluation_sets, results, levers, best, discs, ceiling, workspace.settings
    )


def _watched(workspace: Workspace, entries: list[Entry]) -> Iterable[Entry]:
    return workspace.progress(entries, "methods")


def _tank() -> SimulatedTank:
    skin, protocol = tank()
    return SimulatedTank(skin, protocol, linearise(skin, protocol, elements=MODEL_ELEMENTS))


def _grounds(
    workspace: Workspace, ours: SimulatedTank, folder: Path
) -> tuple[EvaluationSets, dict[str, Any]]:
    """Return the data to judge on, and the facts on which all results depend."""
    measured = phantoms(folder)
    scale = size_to_paper(ours.skin.outline)
    image_scorer = metrics.judge_for(ours.skin.outline, ours.grid, metrics.RASTER_MM * scale)
    share = float(np.median(reciprocal_share(measured)))
    settings = workspace.settings
    tuning, test = settings.count(TUNING_SCENES), settings.count(TEST_SCENES)
    evaluation_sets = EvaluationSets(
        image_scorer,
        ours.grid,
        simulated(workspace, settings.tuning_seed, tuning, False, image_scorer.raster, share),
        simulated(workspace, settings.tuning_seed, tuning, True, image_scorer.raster, share),
        simulated(workspace, settings.seed, test, False, image_scorer.raster, share),
        measured,
        rods(folder),
        GATE_MM * scale,
        share,
    )
    digest = hashlib.sha256(
        b"".join((folder / name).read_bytes() for name in (PHANTOMS, *(one[0] for one in RODS)))
    )
    return evaluation_sets, {
        "frames": digest.hexdigest()[:16],
        "tuning": tuning,
        "test": test,
        "share": round(share, 9),
    }


def _ceiling(workspace: Workspace, evaluation_sets: EvaluationSets) -> list[dict[str, Any]]:
    """MIoU of the true discs, moved by so much, against the truth, for each touch-like frame."""
    frames, points = evaluation_sets.phantoms, evaluation_sets.image_scorer.raster.points_mm
    assert frames.touch_xy_mm is not None and frames.touch_radius_mm is not None
    conductive, _ = truth_of(frames, evaluation_sets.image_scorer.raster)
    found, draws = [], workspace.settings.count(DRAWS)
    for off in TRUTH_ERRORS:
        scores = []
        for k in touch_like(frames):
            there = objects_of(frames, k, 1)
            centres, radii = frames.touch_xy_mm[there], frames.touch_radius_mm[there]
            scores.append(
                jittered_truth(
                    points,
                    conductive[k],
                    centres,
                    radii,
                    off * RADIUS_MM,
                    workspace.settings.seed,
                    draws,
                )
            )
        found.append({"off": off, "miou": scores})
    return found
