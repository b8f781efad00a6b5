"""Two to twelve touches: counts, positions, and the frames that the core reports as uncertain (the
paper's Fig. 12 and Table 1)."""

from dataclasses import asdict
from typing import Any

from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace
from eitskin_studies.experiments.multitouch import ambiguity_tables, tables
from eitskin_studies.experiments.multitouch.cells import NARROW, RING, WIDE
from eitskin_studies.experiments.multitouch.gallery import gallery
from eitskin_studies.experiments.multitouch.measure import (
    Ambiguities,
    CountedScenes,
    Limit,
    ambiguities,
    count_all,
    limits,
    prepare_mixed,
)
from eitskin_studies.experiments.multitouch.test_data import TouchData
from eitskin_studies.experiments.multitouch.text import closing, conditions, doubtful

TITLE = "Many touches at once: how many, where, and when to say that it cannot be told"


def run(workspace: Workspace) -> ExperimentOutcome:
    """Run the whole study; results that the workspace has kept are not computed again.

    Raises:
        FileError: the workspace's folder cannot be written.
        MissingExtraError: scipy or netgen is not installed.
    """
    from eitskin_studies.pictures import multitouch_pictures as pictures

    touch_data = TouchData(workspace)
    prepare_mixed(touch_data, workspace)
    counted = count_all(touch_data, workspace)
    limited = limits(touch_data, workspace)
    ambiguous = ambiguities(touch_data, workspace, counted)
    examples = gallery(touch_data, workspace)
    made = (
        tables.asked_table(counted),
        tables.exact_table(counted, RING, "exact-ring"),
        tables.exact_table(counted, WIDE, "exact-4-radii"),
        tables.exact_table(counted, NARROW, "exact-2.5-radii"),
        tables.detail_table(counted),
        tables.single_table(counted),
        tables.uneven_table(counted),
        tables.limit_table(limited),
        ambiguity_tables.ambiguity_table(ambiguous),
        ambiguity_tables.rule_table(ambiguous),
        ambiguity_tables.chance_table(ambiguous),
        ambiguity_tables.touch_score_table(ambiguous),
    )
    return ExperimentOutcome(
        made,
        data(counted, limited, ambiguous),
        {
            "exact.svg": pictures.counts_drawing(counted),
            "gallery.png": lambda path: pictures.draw_gallery(path, touch_data.skin, examples),
            "doubt.svg": pictures.doubt_drawing(ambiguous),
            "touch_scores.svg": pictures.touch_scores_drawing(ambiguous),
        },
        {
            "conditions": conditions(touch_data, workspace),
            "closing": closing(counted, limited),
            "doubtful": doubtful(ambiguous),
        },
    )


def data(counted: CountedScenes, limited: list[Limit], ambiguous: Ambiguities) -> dict[str, Any]:
    """Everything, for JSON."""
    return {
        "counts": [
            {
                "places": geometry,
                "touches": touches,
                "method": method,
                "snr_db": snr_db,
                **asdict(score),
            }
            for (geometry, touches, method, snr_db), score in counted.scores.items()
        ],
        "do not fit": [
            {"places": geometry, "touches": k, "why": why}
            for (geometry, k), why in counted.unfit.items()
        ],
        "ceiling": [asdict(one) for one in limited],
        "rule": asdict(ambiguous.rule),
        "reliability": {
            name: {
                snr: asdict(one)
                for snr, one in ambiguity_tables.reliabilities(ambiguous, name).items()
            }
            for name in ambiguous.mixed
        },
        "tables": {
            table.name: [dict(zip(table.head, row, strict=True)) for row in table.rows]
            for table in (
                ambiguity_tables.ambiguity_table(ambiguous),
                ambiguity_tables.touch_score_table(ambiguous),
            )
        },
    }
