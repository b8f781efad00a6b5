"""Touches as discs depend on more than the data: the radius's prior, the model's electrodes, the
signs looked for."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from eitskin.model.build import linearise
from eitskin_studies.experiments.experiment import MODEL_ELEMENTS, Workspace
from eitskin_studies.experiments.tank.evaluation import (
    EvaluationSets,
    curves_of,
    increases,
    places_of,
)
from eitskin_studies.experiments.tank.imagers import CoreImager, Levers, SimulatedTank
from eitskin_studies.experiments.tank.tanks import touch_like, truth_of
from eitskin_studies.harness.thresholds import match_all

KIND = "log-ratio"
# name, changes of options, of electrodes, whether decreases are looked for too
VARIANTS: tuple[tuple[str, dict[str, Any], dict[str, Any], bool], ...] = (
    ("defaults: expected change 2 of the water's, weight of the radius 1", {}, {}, False),
    ("weight of the radius 0.3", {"touch_radius_weight": 0.3}, {}, False),
    ("weight of the radius 3", {"touch_radius_weight": 3.0}, {}, False),
    ("expected change 1.5 of the water's", {"touch_change_s_per_m": 0.045}, {}, False),
    ("expected change 2.25 of the water's", {"touch_change_s_per_m": 0.0675}, {}, False),
    ("expected change 2.5 of the water's", {"touch_change_s_per_m": 0.075}, {}, False),
    ("expected change 3 of the water's", {"touch_change_s_per_m": 0.09}, {}, False),
    ("expected change 4 of the water's", {"touch_change_s_per_m": 0.12}, {}, False),
    ("electrodes of 15 mm in the model", {}, {"width_mm": 15.0}, False),
    ("electrodes of 35 mm in the model", {}, {"width_mm": 35.0}, False),
    ("contact impedance 0.0001 ohm m2", {}, {"contact_impedance_ohm_m2": 0.0001}, False),
    ("contact impedance 0.03 ohm m2", {}, {"contact_impedance_ohm_m2": 0.03}, False),
    ("both signs", {}, {}, True),
)


def varied(
    workspace: Workspace,
    tank: SimulatedTank,
    evaluation_sets: EvaluationSets,
    facts: dict[str, Any],
) -> list[dict[str, Any]]:
    """Every variant on the metal set that is chosen by, and on the touch-like frames."""
    watched: Iterable[Any] = workspace.progress(VARIANTS, "discs")
    return [
        workspace.kept(
            {**facts, "discs": repr(one)}, partial(_variant, tank, evaluation_sets, *one)
        )
        for one in watched
    ]


def _variant(
    tank: SimulatedTank,
    evaluation_sets: EvaluationSets,
    name: str,
    options: dict[str, Any],
    electrodes: dict[str, Any],
    signed: bool,
) -> dict[str, Any]:
    if electrodes:
        skin = replace(tank.skin, electrodes=replace(tank.skin.electrodes, **electrodes))
        tank = SimulatedTank(
            skin, tank.protocol, linearise(skin, tank.protocol, elements=MODEL_ELEMENTS)
        )
    imager = CoreImager(tank, Levers(kind=KIND), painted=True, options=options)
    frames, chosen = evaluation_sets.phantoms, touch_like(evaluation_sets.phantoms)
    tuned = imager.show(evaluation_sets.metal.untouched_v, evaluation_sets.metal.frames_v, signed)
    shown = imager.show(frames.reference_voltage_v, frames.voltage_v[chosen], signed)
    truth = truth_of(frames, evaluation_sets.image_scorer.raster)[0][chosen]
    at_tuned = match_all(
        evaluation_sets.metal.conductive_mm,
        increases(tuned, None, evaluation_sets.grid),
        evaluation_sets.gate_mm,
    )
    at_shown = match_all(
        [places_of(frames, k, 1) for k in chosen],
        increases(shown, None, evaluation_sets.grid),
        evaluation_sets.gate_mm,
    )
    return {
        "name": name,
        "tuned": float(
            np.mean(
                curves_of(tuned, evaluation_sets.metal.conductive, evaluation_sets.image_scorer)[
                    :, 0
                ]
            )
        ),
        "touch_like": [
            float(value) for value in curves_of(shown, truth, evaluation_sets.image_scorer)[:, 0]
        ],
        "tuned_exact": float(np.mean([one.exact for one in at_tuned])),
        "found": sum(one.hits for one in at_shown),
        "true": sum(one.hits + one.misses for one in at_shown),
        "false": sum(one.false_touches for one in at_shown),
    }
