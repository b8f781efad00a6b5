"""The paper's many touches: weights placed one after another from the most sensitive place near the
boundary, one to twelve."""

from functools import partial
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin.model.build import linearise
from eitskin.model.prebuilt import load_prebuilt
from eitskin.scene.random_touches import TouchScene, TouchSet, TrueTouch, rim_distance_mm
from eitskin.scoring.matching import match
from eitskin.skin.skin import Skin
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.compare.baselines import PlainFista, gauss_newton
from eitskin_studies.compare.families import Method, setup_for
from eitskin_studies.experiments.experiment import (
    MODEL_ELEMENTS,
    ExperimentOutcome,
    Table,
    Workspace,
)
from eitskin_studies.experiments.multitouch.counts import share
from eitskin_studies.experiments.multitouch.variants import read_images
from eitskin_studies.harness.sections import AS_EVERYWHERE
from eitskin_studies.harness.sessions import FrameSession
from eitskin_studies.pictures.weights_picture import draw_weights

TITLE = "The paper, claim by claim; its weights placed one after another (Fig. 12)"

PAPERS_MOST = 7  # weights that the paper tells apart
MOST, RADIUS_MM, CONTRAST, FROM_RIM_MM, APART_MM = 12, 5.0, 5.0, 6.0, 30.0
SNRS_DB, CLASSICAL_DB = (40.0, 60.0, 80.0), 60.0
CONTACTS, NOISES = 4, 6  # so many sessions, so many frames of each scene in each
# middles 6 mm from the boundary, and edges
READINGS = {"middles 6 mm from the boundary": FROM_RIM_MM,
            "edges 6 mm from the boundary": FROM_RIM_MM + RADIUS_MM}  # fmt: skip
SHOWN = "edges 6 mm from the boundary"  # of the picture
# as the study of many touches chose them
GAUSS_NEWTON, FISTA = (3e-6, 0.4), (0.003, 0.3)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    model, blob = load_prebuilt()
    skin, seed = model.skin, workspace.settings.seed
    solver = workspace.scenes(skin, model.protocol)
    sessions, contacts = {}, workspace.settings.count(CONTACTS, 1)
    places: dict[str, Any] = {}
    for name, from_rim_mm in READINGS.items():
        facts = {"part": "places", "from_rim_mm": from_rim_mm, "apart_mm": APART_MM}
        find = partial(_places, skin, model.protocol, from_rim_mm)
        places[name] = workspace.kept(facts, find)
        for k in range(contacts):
            role = f"paper {from_rim_mm:g} mm, contacts {k}"
            drawn = TouchSet(role, seed, tuple(_scenes(places[name], role)))
            sessions[name, k] = solver.session(drawn, workspace.progress)
    core = Reconstructor(model, blob=blob)
    setup = setup_for(skin, model.protocol, elements=MODEL_ELEMENTS)
    classical: dict[str, tuple[Method, float]] = {
        "Gauss-Newton": (gauss_newton(setup.jacobian, GAUSS_NEWTON[0]), GAUSS_NEWTON[1]),
        "plain FISTA 300": (PlainFista(setup.jacobian, 300, FISTA[0], False), FISTA[1]),
    }
    exact: dict[tuple[str, str], list[list[bool]]] = {}
    for (name, _), session in workspace.progress(list(sessions.items()), "counting"):
        for snr in SNRS_DB:
            facts = {
                "part": "core",
                "set": session.touches.name,
                "places": places[name],
                "snr": snr,
            }
            look = partial(_by_core, core, session, snr)
            exact.setdefault((name, f"eitskin, {snr:g} dB"), []).extend(workspace.kept(facts, look))
        for method, (one, threshold) in classical.items():
            see = partial(
                read_images, one, threshold=threshold,
                index=setup.grid.index, centres_mm=setup.grid.centres_mm(),
            )  # fmt: skip
            facts = {"part": method, "set": session.touches.name, "places": places[name]}
            look = partial(_by_images, see, session)
            column = f"{method}, {CLASSICAL_DB:g} dB"
            exact.setdefault((name, column), []).extend(workspace.kept(facts, look))
    seen = sessions[SHOWN, 0]
    facts = {"part": "images", "set": seen.touches.name, "places": places[SHOWN]}
    images = workspace.kept_arrays(facts, partial(_images, core, classical, seen))
    panels = partial(
        draw_weights, skin=skin, scenes=seen.touches.scenes[:PAPERS_MOST], images=images,
        grids={"eitskin": model.grid, **dict.fromkeys(classical, setup.grid)},
    )  # fmt: skip
    return ExperimentOutcome(
        (_table(exact),),
        {"places_mm": places, "exact": {f"{a}; {b}": values for (a, b), values in exact.items()}},
        {"weights.png": panels},
        {"sets": _words(contacts, seed)},
    )


def _places(skin: Skin, protocol: Any, from_rim_mm: float) -> list[list[float]]:
    """Return the middles of the weights: each one is where a disc changes the frame most, among
    all places that are that far from the rim and far enough from those before."""
    linear = linearise(skin, protocol, pixels_across=64, elements=MODEL_ELEMENTS)
    centres = linear.grid.centres_mm()
    room = rim_distance_mm(skin.outline, centres) >= from_rim_mm
    found: list[list[float]] = []
    answers = np.full(len(centres), -1.0)
    for k in np.flatnonzero(room):
        disc = np.linalg.norm(centres - centres[k], axis=1) <= RADIUS_MM
        answers[k] = np.linalg.norm(linear.jacobian[:, disc].sum(axis=1)) / disc.sum()
    while len(found) < MOST:
        best = int(np.argmax(answers))
        if answers[best] < 0:
            break
        found.append([round(float(value), 3) for value in centres[best]])
        answers[np.linalg.norm(centres - centres[best], axis=1) < APART_MM] = -1.0
    return found


def _scenes(places: list[list[float]], role: str) -> list[TouchScene]:
    weights = [TrueTouch(x, y, RADIUS_MM, CONTRAST) for x, y in places]
    return [TouchScene(f"{role}-{k}", tuple(weights[:k])) for k in range(1, len(weights) + 1)]


def _by_core(core: Reconstructor, session: FrameSession, snr_db: float) -> list[list[bool]]:
    """For each noise, whether the scenes are exact."""
    measured = session.measured(snr_db, held=NOISES)
    core.tare(measured.untouched_v)
    found: list[list[bool]] = []
    for frames in np.moveaxis(measured.frames_v, 1, 0):
        found.append([])
        for scene, frame in zip(session.touches.scenes, frames, strict=True):
            core.forget()
            touches = core.reconstruct(frame).touches
            found[-1].append(_exact(scene, [(one.x_mm, one.y_mm) for one in touches]))
    return found


def _images(
    core: Reconstructor, classical: dict[str, tuple[Method, float]], session: FrameSession
) -> dict[str, FloatArray]:
    """The images of one to ``PAPERS_MOST`` weights, each the first frame of its scene, at 60 dB."""
    measured = session.measured(CLASSICAL_DB)
    frames = measured.frames_v[:PAPERS_MOST, -1]
    core.tare(measured.untouched_v)
    shown = []
    for frame in frames:
        core.forget()
        shown.append(np.asarray(core.reconstruct(frame).image, dtype=np.float64))
    differences = frames - measured.untouched_v.mean(axis=0)
    others = {
        name: np.asarray(one.reconstruct(differences)) for name, (one, _) in classical.items()
    }
    return {"eitskin": np.array(shown), **others}


def _by_images(see: Any, session: FrameSession) -> list[list[bool]]:
    measured = session.measured(CLASSICAL_DB, held=NOISES)
    differences = measured.frames_v - measured.untouched_v.mean(axis=0)
    return [
        [
            _exact(scene, places)
            for scene, places in zip(session.touches.scenes, see(frames), strict=True)
        ]
        for frames in np.moveaxis(differences, 1, 0)
    ]


def _exact(scene: TouchScene, found: Any) -> bool:
    return bool(match(scene.centres_mm(), found).exact)


def _table(exact: dict[tuple[str, str], list[list[bool]]]) -> Table:
    columns = list(exact)
    rows = []
    for k in range(MOST):
        cells = []
        for column in columns:
            reported = [frame[k] for frame in exact[column] if k < len(frame)]
            cells.append(
                f"{100 * share(sum(reported), len(reported)).mean:.0f}" if reported else "-"
            )
        rows.append((str(k + 1), *cells))
    short = {name: name.split(" 6 mm")[0] for name in READINGS}
    head = ("weights", *(f"{short[name]}: {what}" for name, what in columns))
    return Table("placed", head, tuple(rows))


def _words(contacts: int, seed: int) -> str:
    return (
        f"Seed {seed}; discs of radius {RADIUS_MM:g} mm and contrast {CONTRAST:g}. Each one is"
        f" placed where it changes the frame most, at least {APART_MM:g} mm from those before. Each"
        f" number is from {contacts * NOISES} frames: {contacts} draws of contacts with {NOISES} of"
        f" noise each, {AS_EVERYWHERE}; the prebuilt model with its defaults. Numbers are the"
        " scenes that are counted exactly, in %."
    )
