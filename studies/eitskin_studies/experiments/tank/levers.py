"""Levers that improve images of large objects, each for itself and all together, chosen on
simulated tank scenes only."""

from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.tank.evaluation import EvaluationSets
from eitskin_studies.experiments.tank.imagers import KINDS, CoreImager, Entry, Levers, SimulatedTank
from eitskin_studies.experiments.tank.tanks import touch_like, truth_of
from eitskin_studies.harness.thresholds import THRESHOLDS, best_threshold, miou_curves

REGULARISATIONS = (0.01, 0.03, 0.1, 0.3)
ITERATIONS = (15, 30, 60, 120)
LAMBDAS = (0.01, 0.03, 0.1)
PAINTS = ((0.0, 0.0), (0.0, 1.0), (0.0, 1.5), (1.5, 0.0), (2.0, 0.0))  # (atom, blur)


def one_by_one(kind: str) -> list[Levers]:
    """The defaults on data of ``kind``, and each lever alone."""
    start = Levers(kind=kind)
    changes: list[dict[str, Any]] = [{}]
    changes += [
        {"regularisation": value} for value in REGULARISATIONS if value != start.regularisation
    ]
    changes += [{"iterations": value} for value in ITERATIONS if value != start.iterations]
    changes += [{"lambda_rel": value} for value in LAMBDAS if value != start.lambda_rel]
    changes += [{"atom": atom, "blur": blur} for atom, blur in PAINTS if atom or blur]
    return [replace(start, **change) for change in changes]


def together(kind: str) -> list[Levers]:
    """Floor, iterations and paint together, at the usual lambda."""
    return [
        Levers(
            kind=kind, regularisation=regularisation, iterations=iterations, atom=atom, blur=blur
        )
        for (atom, blur), regularisation, iterations in product(PAINTS, REGULARISATIONS, ITERATIONS)
    ]


def tried(
    workspace: Workspace,
    tank: SimulatedTank,
    evaluation_sets: EvaluationSets,
    facts: dict[str, Any],
) -> dict[Levers, dict[str, Any]]:
    """All settings of levers that were tried, with their results."""
    wanted = list(
        dict.fromkeys([one for kind in KINDS for one in one_by_one(kind)] + together("difference"))
    )
    found = {}
    for levers in _watched(workspace, wanted):
        found[levers] = workspace.kept(
            {**facts, "levers": asdict(levers)}, partial(_measured, tank, evaluation_sets, levers)
        )
    return found


def chosen(found: dict[Levers, dict[str, Any]]) -> Levers:
    """The best on the simulated set; of those that are equal to three digits the cheapest."""
    return max(found, key=lambda levers: (round(found[levers]["tuned"], 3), -found[levers]["macs"]))


def entry_of(tank: SimulatedTank, name: str, levers: Levers) -> Entry:
    """Levers as an entry of the contest."""
    return Entry(name, levers.kind, "", (0.0,), lambda _: CoreImager(tank, levers))


def words_of(levers: Levers) -> str:
    """Return the differences from the defaults."""
    start, words = Levers(kind=levers.kind), []
    words += (
        [f"mu {levers.regularisation:g}"] if levers.regularisation != start.regularisation else []
    )
    words += [f"{levers.iterations} iterations"] if levers.iterations != start.iterations else []
    words += [f"lambda {levers.lambda_rel:g}"] if levers.lambda_rel != start.lambda_rel else []
    words += [f"atoms of {levers.atom:g} pixels"] if levers.atom else []
    words += [f"blur of {levers.blur:g} pixels"] if levers.blur else []
    return ", ".join(words) or "defaults"


def _watched(workspace: Workspace, wanted: list[Levers]) -> Iterable[Levers]:
    return workspace.progress(wanted, "levers")


def _measured(
    tank: SimulatedTank, evaluation_sets: EvaluationSets, levers: Levers
) -> dict[str, Any]:
    imager = CoreImager(tank, levers)
    tuned = imager.show(evaluation_sets.metal.untouched_v, evaluation_sets.metal.frames_v, False)
    curves = miou_curves(
        evaluation_sets.image_scorer, tuned.images, evaluation_sets.metal.conductive
    )
    threshold = best_threshold(curves)
    at = THRESHOLDS.index(threshold)
    places = touch_like(evaluation_sets.phantoms)
    real = imager.show(
        evaluation_sets.phantoms.reference_voltage_v,
        evaluation_sets.phantoms.voltage_v[places],
        False,
    )
    truth = truth_of(evaluation_sets.phantoms, evaluation_sets.image_scorer.raster)[0][places]
    measured = miou_curves(evaluation_sets.image_scorer, real.images, truth)
    return {
        "tuned": float(curves.mean(axis=0).max()),
        "threshold": threshold,
        "macs": tuned.macs,
        "touch_like": [float(value) for value in measured[:, at]],
        "best_threshold_mean": float(np.max(measured.mean(axis=0))),
    }
