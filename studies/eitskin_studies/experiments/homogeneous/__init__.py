"""The waveform of an untouched skin (the paper's Fig. 4b): its evenness, the causes of unevenness,
and the doctor's findings."""

from functools import partial
from typing import Any

import numpy as np

from eitskin.scene.session import MeshCache
from eitskin.skin.protocol import Protocol, adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.experiment import SIMULATED_ELEMENTS, ExperimentOutcome, Workspace
from eitskin_studies.experiments.homogeneous.cases import (
    CASES,
    ELECTRODES,
    IDEAL,
    MEASURED_TANK,
    SIMULATED_TANK,
    TankCase,
    doctored,
    examined,
)
from eitskin_studies.experiments.homogeneous.measured import load_tank, tank_skin
from eitskin_studies.experiments.homogeneous.tables import Row, data, tables, words
from eitskin_studies.experiments.homogeneous.uniformity import fold_for, uniformity

TITLE = "The 208 values of an untouched skin"
SESSIONS = 8


def run(workspace: Workspace) -> ExperimentOutcome:
    """All cases in sessions of their own, and the measured tank where there is one.

    Raises:
        FileError: the workspace's folder cannot be written, or the measured frames cannot be read.
        GeometryError, MissingExtraError: from meshing and simulating.
    """
    from eitskin_studies.pictures import homogeneous_pictures as pictures

    mesh_cache, sessions = MeshCache(), workspace.settings.count(SESSIONS)
    tank = load_tank(workspace.settings.data)
    wanted = [(case, k) for case in CASES for k in range(1 if case.name == IDEAL else sessions)]
    found: dict[str, list[dict[str, Any]]] = {}
    for case, k in workspace.progress(wanted, "sessions"):
        found.setdefault(case.name, []).append(_kept(workspace, case, k, mesh_cache))
    rows = [_row(case.name, found[case.name], adjacent(ELECTRODES), case.fault) for case in CASES]
    if tank is not None:
        ideal = TankCase(SIMULATED_TANK, {})
        seed, of_tank = workspace.settings.seed, tank_skin()
        facts = {
            "experiment": "homogeneous",
            "case": SIMULATED_TANK,
            "elements": SIMULATED_ELEMENTS,
        }
        kept = workspace.kept(
            facts, lambda: examined(ideal, of_tank, seed, 0, SIMULATED_ELEMENTS, mesh_cache)
        )
        rows.append(_row(SIMULATED_TANK, [kept], adjacent(ELECTRODES)))
        reference = {"reference_v": tank.frames.reference_voltage_v.mean(axis=0).tolist()}
        rows.append(
            _row(
                MEASURED_TANK,
                [{**reference, **doctored(tank.frames, tank.skin)}],
                tank.frames.protocol,
            )
        )
    drawn = {
        "waveform.png": partial(pictures.draw_waveforms, rows=rows),
        "deviations.png": partial(pictures.draw_deviations, rows=rows),
    }
    return ExperimentOutcome(
        tables(rows), data(rows), drawn, words(rows, workspace.settings, sessions, tank is not None)
    )


def _kept(
    workspace: Workspace, case: TankCase, session: int, mesh_cache: MeshCache
) -> dict[str, Any]:
    """A session under its own seed, its failing electrode another in each."""
    seed = 1000 * workspace.settings.seed + session
    facts = {
        "experiment": "homogeneous",
        "case": case.name,
        "session": session,
        "elements": SIMULATED_ELEMENTS,
    }
    kept: dict[str, Any] = workspace.kept(
        facts,
        lambda: examined(
            case, paper_skin(), seed, (3 * session) % ELECTRODES, SIMULATED_ELEMENTS, mesh_cache
        ),
    )
    return kept


def _row(name: str, found: list[dict[str, Any]], protocol: Protocol, fault: bool = False) -> Row:
    fold = fold_for(protocol)
    references = [np.array(one["reference_v"]) for one in found]
    return Row(
        name,
        np.array([fold.of(reference) for reference in references]),
        tuple(uniformity(reference, protocol, fold) for reference in references),
        tuple(tuple((finding[0], finding[1]) for finding in one["findings"]) for one in found),
        tuple(one["measured"] for one in found),
        fault,
    )
