"""Weights at four radii, a calibration that makes one weight read the same anywhere, and the
smallest weight that is detected."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.force import anywhere, curves, detection, scenes, sheet, shown
from eitskin_studies.experiments.force.law import NOMINAL, drawn_laws
from eitskin_studies.experiments.force.readouts import (
    READOUTS,
    TOUCH,
    Instruments,
    Readout,
    as_lists,
    from_lists,
)
from eitskin_studies.harness.drawings import Drawing
from eitskin_studies.pictures.force_pictures import draw_curves, draw_detection, draw_skin

if TYPE_CHECKING:
    from eitskin_studies.experiments.force.scenes import PressSet

TITLE = (
    "Weights at four radii, the calibration that makes one weight read the same anywhere, and the"
    " smallest weight (Figs. 9 to 11)"
)

SNR_DB, AVERAGED_DB = 60.0, 72.0  # the second is what the mean of sixteen frames at the first has
SNRS_DB = (40.0, 50.0, SNR_DB, AVERAGED_DB, 84.0)


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again."""
    settings, skin = workspace.settings, paper_skin()
    protocol = adjacent(skin.electrodes.count)
    radius_mm = (skin.outline.diameter_mm or 0.0) / 2
    solver, instruments = workspace.scenes(skin, protocol), Instruments(skin, protocol)
    laws = (NOMINAL, *drawn_laws(settings.seed, settings.count(16)))
    put = partial(scenes.solved, workspace, solver)
    nominal = put("force curves", settings.seed, scenes.curve_rows(radius_mm))
    uncertain = put("force laws", settings.seed, scenes.law_rows(radius_mm, len(laws)), laws)
    tuning = scenes.spiral(settings.tuning_seed, settings.count(24, 8), radius_mm)
    tuned = put("force tuning", settings.tuning_seed, scenes.spread_rows(tuning))
    places = scenes.spiral(settings.seed, settings.count(36, 8), radius_mm)
    reported = put("force reported", settings.seed, scenes.spread_rows(places))
    light = put("force light", settings.seed, scenes.light_rows(radius_mm, settings.count(15, 6)))

    nominal_read, of_laws = (
        _read(workspace, instruments, one, SNR_DB) for one in (nominal, uncertain)
    )
    drawn = curves.curves_of(nominal, nominal_read, uncertain, of_laws)
    judged: dict[tuple[str, float], anywhere.Anywhere] = {}
    for snr in workspace.progress(SNRS_DB, "calibrating"):
        on, read = (_read(workspace, instruments, one, snr) for one in (tuned, reported))
        for name in READOUTS:
            facts = {
                "part": "anywhere",
                "snr_db": snr,
                "reading": name,
                "sets": [tuned.facts, reported.facts],
            }
            scored = partial(
                anywhere.scored, tuned, on[name], reported, read[name], instruments.radius_mm
            )
            judged[name, snr] = anywhere.Anywhere.from_dict(
                workspace.kept(facts, partial(_as_dict, scored))
            )
    reps, untouched = settings.count(30, 4), settings.count(4000, 80)
    found = []
    for snr in workspace.progress(detection.SNRS_DB, "light presses"):
        facts = {
            "part": "detection",
            "snr_db": snr,
            "reps": reps,
            "quiet": untouched,
            "set": light.facts,
        }
        look = partial(detection.detect, instruments, light, snr, reps, untouched)
        found.append(
            detection.Detection.from_dict(
                workspace.kept(facts, lambda look=look: look().as_dict())  # type: ignore[misc]
            )
        )

    under_sheet = sheet.measured(workspace, solver, instruments, light, found)
    both = (SNR_DB, AVERAGED_DB)
    tables = (
        curves.table_of(drawn), anywhere.table_of(judged, both), anywhere.by_load(judged, both),
        anywhere.over_snr(judged, SNRS_DB), detection.table_of(found), *under_sheet.tables(),
    )  # fmt: skip
    data = {
        "slopes": {
            name: {"a_gram": one.slopes.tolist(), "mean": one.mean.tolist()}
            for name, one in drawn.items()
        },
        "anywhere": [
            {"reading": name, "snr_db": snr, **one.as_dict()} for (name, snr), one in judged.items()
        ],
        "detection": [one.as_dict() for one in found],
        "sheet": under_sheet.as_dict(),
    }
    touch = judged[TOUCH, AVERAGED_DB]
    return ExperimentOutcome(
        tables,
        data,
        {
            "curves.svg": Drawing(draw_curves, shown.curves_shown(drawn)),
            "skin.svg": Drawing(draw_skin, shown.skin_shown(skin, places, judged, AVERAGED_DB)),
            "detection.svg": Drawing(draw_detection, shown.detection_shown(found)),
        },
        {
            "sets": _sets(workspace, tuned, reported, laws, reps, touch),
            "pressures": sheet.pressures(),
        },
    )


def _read(
    workspace: Workspace, instruments: Instruments, presses: PressSet, snr_db: float
) -> dict[str, Readout]:
    facts = {"part": "readings", "set": presses.facts, "snr_db": snr_db}
    return from_lists(
        workspace.kept(facts, lambda: as_lists(instruments.read(presses.session, snr_db)))
    )


def _sets(
    workspace: Workspace,
    tuned: PressSet,
    reported: PressSet,
    laws: tuple[object, ...],
    reps: int,
    touch: anywhere.Anywhere,
) -> str:
    def of(one: PressSet) -> str:
        return f"{len(set(map(tuple, one.place_mm.tolist())))} places"

    seed, tuning_seed = workspace.settings.seed, workspace.settings.tuning_seed
    return (
        f"Calibrated on {of(tuned)} of seed {tuning_seed}, reported on {of(reported)} of seed"
        f" {seed}, each with five weights; {len(laws) - 1} laws beside the nominal one; {reps}"
        f" frames of each light press; at {AVERAGED_DB:g} dB the touch's law is *{touch.form}*, its"
        f" gain of order {touch.order}."
    )


def _as_dict(scored: Callable[[], anywhere.Anywhere]) -> dict[str, Any]:
    return scored().as_dict()
